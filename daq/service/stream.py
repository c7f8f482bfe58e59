"""The live run, and its updates for any number of clients."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable
from typing import Protocol

from daq.schemas.events import AcknowledgedAlarmsSchema, MarkerSchema
from daq.schemas.units import Schema
from daq.service.problem_types import ProblemType
from daq.service.problems import ProblemError
from daq.session.live_update import LiveUpdate

VALUES_INTERVAL = 0.1  # s
CURVES_INTERVAL = 0.25  # s
MAX_CLIENTS = 64
KEEP_ALIVE_INTERVAL = 15.0  # s without an update until a comment shows that the service is alive


class LiveRun(Protocol):
    """The live run, implemented by the program that starts the service, which the service does not import."""

    def latest(self) -> LiveUpdate | None:
        """Return the latest update without waiting; None if there is no run."""
        ...

    def stop(self) -> str | None:
        """Request the end of the run; return its id, None if no run is in progress."""
        ...

    def add_marker(self, text: str) -> MarkerSchema | None:
        """Add a marker at the current time of the recorded run; None if nothing is being recorded."""
        ...

    def acknowledge(self) -> AcknowledgedAlarmsSchema | None:
        """Acknowledge the alarms of the current run; None if there is no run."""
        ...


def require_ended(live: LiveRun, run: str) -> None:
    """Raise ProblemError if the run with this id is still in progress."""
    update = live.latest()
    if update is not None and update.header.run == run and update.status.state.is_active:
        raise ProblemError(ProblemType.RUN_UNDER_WAY, f"run {run} is still {update.status.state.value}")


class LiveStream:
    """Sends each change of the live run to all clients; a slow client skips updates and delays no other.

    Parameters
    ----------
    live : LiveRun
        The current run.
    schema_of : callable
        Converts an update to the schema that is sent.
    interval : float
        Polling interval, s.
    closing : Event
        Ends the updates of all clients.
    """

    def __init__(
        self, live: LiveRun, schema_of: Callable[[LiveUpdate], Schema], interval: float, closing: threading.Event
    ) -> None:
        self._live = live
        self._schema_of = schema_of
        self._interval = interval
        self._closing = closing
        self._n_clients = 0
        self._update: LiveUpdate | None = None
        self._text = "null"

    async def updates(self) -> AsyncIterator[str]:
        """Yield the current update as JSON, then each change; ``null`` if there is no run.

        An empty text is a keep-alive. Raises ProblemError (busy) if there are too many clients.
        """
        self.require_capacity()
        self._n_clients += 1
        sent, idle_time = "", 0.0
        try:
            while not self._closing.is_set():
                text = self._latest_text()
                if text != sent or idle_time >= KEEP_ALIVE_INTERVAL:
                    yield "" if text == sent else text
                    sent, idle_time = text, 0.0
                await asyncio.sleep(self._interval)
                idle_time += self._interval
        finally:
            self._n_clients -= 1

    def require_capacity(self) -> None:
        """Raise ProblemError (busy) if there are too many clients."""
        if self._n_clients >= MAX_CLIENTS or self._closing.is_set():
            raise ProblemError(ProblemType.BUSY, f"{self._n_clients} clients follow the live run already")

    def _latest_text(self) -> str:
        """Return the latest update as JSON, made once for all clients."""
        update, before = self._live.latest(), self._update
        if update is None or before is None:
            is_same = update is before
        else:
            is_same = update.snapshot is before.snapshot and update.status == before.status
        if not is_same:
            self._update = update
            self._text = "null" if update is None else self._schema_of(update).model_dump_json()
        return self._text
