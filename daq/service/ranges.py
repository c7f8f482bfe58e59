"""One stretch of a file, as the header Range asks for it (RFC 9110, 14)."""

import re
from collections.abc import AsyncIterator
from typing import BinaryIO

from anyio import to_thread

PORTION = 256 * 1024  # bytes read and sent at a time
FORM = re.compile(r"bytes=(\d{0,18})-(\d{0,18})")


class NoSuchRangeError(ValueError):
    """The range lies outside the file."""


def byte_range(header: str | None, size: int) -> tuple[int, int] | None:
    """Return begin and end of the stretch that a Range header asks for; None for the whole file.

    A header that is malformed, of another unit or asks for several stretches is passed over, as the RFC allows.

    Parameters
    ----------
    header : str or None
        The header.
    size : int
        Of the file, bytes.

    Raises
    ------
    NoSuchRangeError
        There is no such stretch.
    """
    match = FORM.fullmatch((header or "").replace(" ", ""))
    if match is None or match.group(0) == "bytes=-":
        return None
    first, last = match.groups()
    if not first:
        begin, end = max(size - int(last), 0), size
    else:
        begin, end = int(first), min(int(last) + 1, size) if last else size
        if last and int(last) < int(first):
            return None
    if begin >= end:
        raise NoSuchRangeError(f"{header}: the file has {size} bytes")
    return begin, end


async def portions(file: BinaryIO, begin: int, end: int) -> AsyncIterator[bytes]:
    """Yield a stretch of an open file, read in threads, and close it; it ends early where the file does."""
    with file:
        await to_thread.run_sync(file.seek, begin)
        while begin < end:
            portion = await to_thread.run_sync(file.read, min(PORTION, end - begin))
            if not portion:
                return
            begin += len(portion)
            yield portion
