"""The live run, and the broadcast of its updates to any number of clients."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from typing import Protocol

from daq.schemas.events import AcknowledgedAlarmsSchema, MarkerSchema
from daq.schemas.units import Schema
from daq.service.problem_types import ProblemType
from daq.service.problems import ProblemError
from daq.session.live_update import LiveUpdate


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


VALUES_INTERVAL = 0.1  # s
CURVES_INTERVAL = 0.25  # s
MAX_CLIENTS = 64
MAX_QUEUED_UPDATES = 4  # per client
KEEP_ALIVE_INTERVAL = 15.0  # s without an update until a comment shows that the service is alive


class LiveBroadcaster:
    """Polls the live run while clients listen, and sends each change to all of them.

    A slow client loses its oldest updates and delays no other.

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
        self._clients: set[asyncio.Queue[str | None]] = set()
        self._task: asyncio.Task[None] | None = None
        self._last_update: LiveUpdate | None = None
        self._last_text = "null"

    async def updates(self) -> AsyncIterator[str]:
        """Yield the current update as JSON, then each change; ``null`` if there is no run.

        An empty text is a keep-alive. Raises ProblemError (busy) if there are too many clients.
        """
        self.require_capacity()
        queue: asyncio.Queue[str | None] = asyncio.Queue(MAX_QUEUED_UPDATES)
        self._clients.add(queue)
        try:
            if self._task is None or self._task.done():
                self._poll()
                self._task = asyncio.get_running_loop().create_task(self._run())
            yield self._last_text
            while True:
                try:
                    text = await asyncio.wait_for(queue.get(), KEEP_ALIVE_INTERVAL)
                except TimeoutError:
                    text = ""
                if text is None:
                    return
                yield text
        finally:
            self._clients.discard(queue)

    def require_capacity(self) -> None:
        """Raise ProblemError (busy) if there are too many clients."""
        if len(self._clients) >= MAX_CLIENTS or self._closing.is_set():
            raise ProblemError(ProblemType.BUSY, f"{len(self._clients)} clients follow the live run already")

    async def _run(self) -> None:
        while self._clients and not self._closing.is_set():
            await asyncio.sleep(self._interval)
            if self._poll():
                for queue in self._clients:
                    _put_latest(queue, self._last_text)
        for queue in self._clients:
            _put_latest(queue, None)

    def _poll(self) -> bool:
        """Read the latest update; return whether the text to send has changed."""
        update, before, text = self._live.latest(), self._last_update, self._last_text
        self._last_update = update
        if update is None or before is None:
            is_same = update is before
        else:
            is_same = update.snapshot is before.snapshot and update.status == before.status
        if not is_same:
            self._last_text = "null" if update is None else self._schema_of(update).model_dump_json()
        return self._last_text != text


def _put_latest(queue: asyncio.Queue[str | None], text: str | None) -> None:
    """Put a text into a client's queue; a full queue loses its oldest text."""
    if queue.full():
        with suppress(asyncio.QueueEmpty):
            queue.get_nowait()
    queue.put_nowait(text)
