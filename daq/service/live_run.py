"""The run under way, as all addresses see it."""

from typing import Protocol

from daq.service.problem_types import Kind
from daq.service.problems import ProblemError
from daq.session.live_update import LiveFrame


class Live(Protocol):
    """The run that is under way."""

    def latest(self) -> LiveFrame | None:
        """Return its latest moment at once; None where there is no run."""
        ...


def require_ended(live: Live, run: str) -> None:
    """Raise ProblemError where a run, by its id, is the one that is under way."""
    frame = live.latest()
    if frame is not None and frame.header.run == run and frame.status.state.is_under_way:
        raise ProblemError(Kind.RUN_UNDER_WAY, f"run {run} is still {frame.status.state.value}")
