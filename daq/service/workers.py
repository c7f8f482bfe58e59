"""Threads for work that waits on files, so that the event loop never does."""

from collections.abc import Callable
from typing import TypeVar

from anyio import CapacityLimiter, to_thread

from daq.service.problem_types import Kind
from daq.service.problems import ProblemError

T = TypeVar("T")


class Workers:
    """A bounded number of threads with a bounded queue before them.

    Parameters
    ----------
    threads : int
        How many pieces of work go on at once.
    waiting : int
        How many may wait; one more is turned away.
    """

    def __init__(self, threads: int, waiting: int) -> None:
        self._limiter = CapacityLimiter(threads)
        self._room = threads + waiting
        self._inside = 0

    async def run(self, work: Callable[[], T]) -> T:
        """Return what ``work`` returns, done in a thread; ProblemError (busy) where too many are waiting already."""
        if self._inside >= self._room:
            raise ProblemError(Kind.BUSY, f"{self._inside} requests for files are under way or waiting already")
        self._inside += 1  # here and not in the limiter, which counts only when the event loop comes round
        try:
            return await to_thread.run_sync(work, limiter=self._limiter)
        finally:
            self._inside -= 1
