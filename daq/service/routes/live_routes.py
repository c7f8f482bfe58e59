"""Starting a run, ending it, and naming its moments."""

from functools import partial
from typing import Protocol

from fastapi import Response

from analysis.signals.header import RunHeader
from daq.errors import RigError
from daq.schemas import OrderDocument, StartedDocument, StopDocument, StoppingDocument
from daq.schemas.alarm import AcknowledgedDocument, AcknowledgeDocument
from daq.schemas.mark import MarkDocument, MarkOrder
from daq.schemas.units import moment
from daq.service.problem_types import Kind
from daq.service.problems import ProblemError
from daq.service.routing import Routing
from daq.service.workers import Workers


class Steering(Protocol):
    """Who can end the run that is under way."""

    def stop(self) -> str | None:
        """Ask for its end; return its id, None where no run is under way."""
        ...

    def mark(self, text: str) -> MarkDocument | None:
        """Name the present moment of the run that is recorded; None where none is."""
        ...

    def acknowledge(self) -> AcknowledgedDocument | None:
        """Take note of the alarms of the run that is shown; None where none is."""
        ...


class Desk(Protocol):
    """Who starts runs, one at a time."""

    @property
    def rigs(self) -> tuple[str, ...]:
        """Names of the rigs that may be chosen."""
        ...

    def start(self, rig: str, note: str, duration: float | None) -> RunHeader:
        """Begin a run and return its header once samples come; RigError where it cannot be."""
        ...


class LiveRoutes:
    """The beginning of a run, its end, and what is said to it.

    Parameters
    ----------
    steering : Steering or None
        Who can end it; None: nobody here.
    desk : Desk or None
        Who can start one; None: nobody here.
    """

    def __init__(self, steering: Steering | None, desk: Desk | None) -> None:
        self._desk = desk
        self._starting = Workers(threads=1, waiting=0)
        self._steering = steering

    def add_to(self, routing: Routing) -> None:
        """Make the addresses known."""
        if self._steering is not None:
            routing.add(
                "POST /live/stop", self.stop, "stop_live", "live", "End the run under way",
                Kind.NO_LIVE_RUN, status=202,
            )  # fmt: skip
            routing.add(
                "POST /live/marks", self.mark, "mark_live", "live", "Name this moment of the run under way",
                Kind.NO_LIVE_RUN, status=201,
            )  # fmt: skip
            routing.add(
                "POST /live/acknowledge", self.acknowledge, "acknowledge_live", "live", "Take note of the alarms",
                Kind.NO_LIVE_RUN,
            )  # fmt: skip

        if self._desk is not None:
            routing.add(
                "POST /runs", self.start, "start_run", "runs", "Start a run",
                Kind.RUN_NOT_POSSIBLE, Kind.BUSY, Kind.STORAGE_UNAVAILABLE, status=201,
            )  # fmt: skip

    async def start(self, order: OrderDocument, response: Response) -> StartedDocument:
        """Start a run with a rig that the service was started with, and answer when samples come, which takes seconds.

        One run goes at a time. `/live` follows it, `/live/stop` ends it, and so does the service's own end.
        """
        if self._desk is None:
            raise ProblemError(Kind.RUN_NOT_POSSIBLE, "this service starts no runs")
        rig = order.rig or self._desk.rigs[0]
        if rig not in self._desk.rigs:
            raise ProblemError(Kind.RUN_NOT_POSSIBLE, f"rig: {rig!r}, expected one of {', '.join(self._desk.rigs)}")
        try:
            header = await self._starting.run(partial(self._desk.start, rig, order.note, order.duration_s))
        except RigError as error:
            raise ProblemError(Kind.RUN_NOT_POSSIBLE, str(error)) from error
        response.headers["Location"] = f"/api/v1/runs/{header.run}"
        return StartedDocument(run=header.run, rig=header.rig, started_at=moment(header.started_ns))

    async def stop(self, _order: StopDocument) -> StoppingDocument:
        """Ask for the end, as Ctrl-C at the bench does: the file is finished and kept. `/live` tells when that is done.

        What is sent is `{}`, as `application/json`; pages of other sites are turned away.
        """
        run = None if self._steering is None else self._steering.stop()
        if run is None:
            raise ProblemError(Kind.NO_LIVE_RUN, "no run is under way")
        return StoppingDocument(run=run)

    async def mark(self, order: MarkOrder) -> MarkDocument:
        """Keep a word on this moment in the recording, as a line typed at the command's terminal does.

        It is in the run's summary when the run has ended. A run that is replayed takes none.
        """
        made = None if self._steering is None else self._steering.mark(order.text)
        if made is None:
            raise ProblemError(Kind.NO_LIVE_RUN, "no run is being recorded")
        return made

    async def acknowledge(self, _order: AcknowledgeDocument) -> AcknowledgedDocument:
        """Take note of the alarms in sight: those that are over go, those that last stay until they are over.

        It is kept in the recording and told among the summary's marks; a replay forgets it. What is sent is `{}`.
        """
        noted = None if self._steering is None else self._steering.acknowledge()
        if noted is None:
            raise ProblemError(Kind.NO_LIVE_RUN, "there is no run whose alarms could be acknowledged")
        return noted
