"""What a service can do beside telling of runs and of the live one."""

from dataclasses import dataclass
from typing import Final

from daq.service.jobs.queue import Jobs
from daq.service.routes.changes import ChangingCatalogue
from daq.service.routes.live_routes import Desk, Steering
from daq.service.run_reader import Readings


@dataclass(frozen=True, slots=True)
class Abilities:
    """What a service can do; what is None it cannot, and has no addresses for.

    Parameters
    ----------
    readings : Readings or None
        Answers what is asked of recorded runs beyond their summaries.
    steering : Steering or None
        Ends the run under way.
    desk : Desk or None
        Starts runs.
    folder : ChangingCatalogue or None
        Takes words on runs, puts runs away, takes runs in; only beside `readings`.
    jobs : Jobs or None
        Does what takes too long to wait for.
    origins : tuple of str
        Other sites whose pages may ask (CORS), as ``http://notebook.lab:8888``.
    """

    readings: Readings | None = None
    steering: Steering | None = None
    desk: Desk | None = None
    folder: ChangingCatalogue | None = None
    jobs: Jobs | None = None
    origins: tuple[str, ...] = ()


TELLING: Final = Abilities()
