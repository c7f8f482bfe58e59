"""Files that are sent in: few at once, none too large or too slow, and nothing is left of what does not come whole."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

from anyio import CapacityLimiter, fail_after, to_thread
from fastapi import Request

from daq.service.problem_types import Kind
from daq.service.problems import ProblemError
from recordings.catalogue.arrival import Arrival, RunExistsError

RESERVE: Final = 1024**3  # bytes that stay free on the disk
AT_ONCE: Final = 2
LEAST: Final = 64 * 1024  # bytes that must come at a time, but for the last
PATIENCE: Final = 30.0  # s for them


class Incoming:
    """Takes the content of requests into files.

    Parameters
    ----------
    free_bytes : callable
        Returns the room left on the disk, bytes.
    most_bytes : int
        Most that one file may have.
    patience : float
        Longest time for a portion of 64 KiB, s.
    """

    def __init__(self, free_bytes: Callable[[], int], most_bytes: int, patience: float = PATIENCE) -> None:
        self._free_bytes = free_bytes
        self._most_bytes = most_bytes
        self._patience = patience
        self._threads = CapacityLimiter(AT_ONCE)
        self._arriving = 0

    async def take(self, request: Request, place: Path, look: Callable[[Path], None] | None = None) -> int:
        """Write the content of a request into a new file; return its size, bytes.

        Parameters
        ----------
        request : Request
            Whose content it is.
        place : Path
            Where it is to lie; its folder is made where it is missing.
        look : callable or None
            Looks through the file before it gets its place, and raises where it must not have it.

        Raises
        ------
        ProblemError, StorageError
            It cannot be taken; nothing is left of it.
        """
        limit = min(self._most_bytes, await to_thread.run_sync(self._free_bytes) - RESERVE)
        sent = request.headers.get("content-length", "0")
        if sent.isdecimal() and int(sent) > limit:
            raise ProblemError(Kind.TOO_LARGE, f"{int(sent):,} bytes, expected at most {max(limit, 0):,}")
        if self._arriving >= AT_ONCE:
            raise ProblemError(Kind.BUSY, f"{self._arriving} files are being sent in already")
        self._arriving += 1
        try:
            return await self._take(request, place, limit, look)
        except RunExistsError as error:
            raise ProblemError(Kind.RUN_EXISTS, str(error)) from error
        finally:
            self._arriving -= 1

    async def _take(self, request: Request, place: Path, limit: int, look: Callable[[Path], None] | None) -> int:
        aside = partial(to_thread.run_sync, limiter=self._threads)
        arrival = await aside(partial(Arrival, place))
        try:
            size = await self._received(request, arrival, limit)
            await aside(arrival.close)
            if look is not None:
                await aside(look, arrival.draft)
            await aside(arrival.settle)
        finally:
            await to_thread.run_sync(arrival.abandon)
        return size

    async def _received(self, request: Request, arrival: Arrival, limit: int) -> int:
        size, stream = 0, request.stream()
        is_whole = False
        while not is_whole:
            portion = bytearray()
            try:
                with fail_after(self._patience):
                    while len(portion) < LEAST and not is_whole:
                        piece = await anext(stream, None)
                        is_whole = piece is None
                        portion += piece or b""
            except TimeoutError as error:
                told = f"{len(portion):,} bytes in {self._patience:g} s after {size:,}"
                raise ProblemError(Kind.TOO_SLOW, told) from error
            size += len(portion)
            if size > limit:
                raise ProblemError(Kind.TOO_LARGE, f"more than {max(limit, 0):,} bytes")
            await to_thread.run_sync(arrival.write, bytes(portion), limiter=self._threads)
        return size
