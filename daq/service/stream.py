"""One look at the live run for all who follow it; who is slow loses the oldest, and holds up nobody.

The run under way, as all addresses see it.
"""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from typing import Protocol

from daq.schemas.units import Schema
from daq.service.problem_types import ProblemType
from daq.service.problems import ProblemError
from daq.session.live_update import LiveUpdate


class LiveFeed(Protocol):
    """The run that is under way."""

    def latest(self) -> LiveUpdate | None:
        """Return its latest moment at once; None where there is no run."""
        ...


def require_ended(live: LiveFeed, run: str) -> None:
    """Raise ProblemError where a run, by its id, is the one that is under way."""
    frame = live.latest()
    if frame is not None and frame.header.run == run and frame.status.state.is_under_way:
        raise ProblemError(ProblemType.RUN_UNDER_WAY, f"run {run} is still {frame.status.state.value}")


INTERVAL = 0.1  # s
MOST_CLIENTS = 64
MOST_WAITING = 4  # moments that wait for a client
SILENCE = 15.0  # s without a moment before a client is told that the service is still there


class LiveBroadcaster:
    """Follows the live run as long as anybody listens; lives on one event loop, but may be ended from any thread.

    Parameters
    ----------
    live : LiveFeed
        The run under way.
    told : callable
        Returns what is told of a moment of it.
    interval : float
        s between two looks.
    """

    def __init__(self, live: LiveFeed, told: Callable[[LiveUpdate], Schema], interval: float = INTERVAL) -> None:
        self._live = live
        self._told = told
        self._interval = interval
        self._clients: set[asyncio.Queue[str | None]] = set()
        self._following: asyncio.Task[None] | None = None
        self._ended = threading.Event()
        self._last: LiveUpdate | None = None
        self._text = "null"

    async def moments(self) -> AsyncIterator[str]:
        """Yield what is told, JSON, at once and whenever it changes; ``null`` where there is no run.

        An empty text says that the service is still there. ProblemError (busy) where too many listen already.
        """
        self.require_room()
        waiting: asyncio.Queue[str | None] = asyncio.Queue(MOST_WAITING)
        self._clients.add(waiting)
        try:
            if self._following is None or self._following.done():
                self._look()
                self._following = asyncio.get_running_loop().create_task(self._follow())
            yield self._text
            while True:
                try:
                    text = await asyncio.wait_for(waiting.get(), SILENCE)
                except TimeoutError:
                    text = ""
                if text is None:
                    return
                yield text
        finally:
            self._clients.discard(waiting)

    def require_room(self) -> None:
        """Raise ProblemError (busy) where too many listen already."""
        if len(self._clients) >= MOST_CLIENTS or self._ended.is_set():
            raise ProblemError(ProblemType.BUSY, f"{len(self._clients)} clients follow the live run already")

    def end(self) -> None:
        """Let all who listen go."""
        self._ended.set()

    async def _follow(self) -> None:
        while self._clients and not self._ended.is_set():
            await asyncio.sleep(self._interval)
            if self._look():
                for waiting in self._clients:
                    _put(waiting, self._text)
        for waiting in self._clients:
            _put(waiting, None)

    def _look(self) -> bool:
        """Look at the run; return whether there is something else to tell."""
        frame, before, text = self._live.latest(), self._last, self._text
        self._last = frame
        if frame is None or before is None:
            is_same = frame is before
        else:
            is_same = frame.snapshot is before.snapshot and frame.status == before.status
        if not is_same:
            self._text = "null" if frame is None else self._told(frame).model_dump_json()
        return self._text != text


def _put(waiting: asyncio.Queue[str | None], text: str | None) -> None:
    """Put a moment where a client waits for it, in place of the oldest where there is no room."""
    if waiting.full():
        with suppress(asyncio.QueueEmpty):
            waiting.get_nowait()
    waiting.put_nowait(text)
