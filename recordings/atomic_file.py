"""Files that are there whole or not at all, whatever ends their writing."""

import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

PAUSES = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8)  # s between attempts to put a file where another one is being read


class Replaceable(Protocol):
    """A file that can be moved over another; a `Path`."""

    def replace(self, target: Path, /) -> object:
        """Move it there."""
        ...


@contextmanager
def atomic_write(place: Path) -> Iterator[Path]:
    """Give a name beside a file under which it is written; at the end the draft takes its place.

    Nothing is left of a draft whose writing fails or is interrupted; what was there before then stays.
    """
    temporary = place.with_name(f".{place.name}.{secrets.token_hex(4)}.part")
    try:
        yield temporary
        replace_with_retry(temporary, place)
    finally:
        temporary.unlink(missing_ok=True)


def replace_with_retry(file: Replaceable, place: Path) -> None:
    """Move a file to its place, over what is there; OSError where it cannot be.

    Windows moves neither a file that somebody reads nor over one, be it only a virus scanner for a moment: that is
    waited for, a second and a half at most.
    """
    for pause in PAUSES:
        try:
            file.replace(place)
        except PermissionError:
            time.sleep(pause)
        else:
            return
    file.replace(place)
