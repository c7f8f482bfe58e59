"""Whether a text of numbers was written to its end: a number that is cut is still a number, but another one."""

import os
from pathlib import Path

from recordings.errors import ForeignFormatError


def require_ended(path: Path, line: int) -> None:
    """Raise ForeignFormatError where the last line of a file, the one of this number, has no end."""
    with path.open("rb") as file:
        if file.seek(0, os.SEEK_END) == 0:
            return
        file.seek(-1, os.SEEK_END)
        if file.read() not in b"\r\n":
            raise ForeignFormatError(
                f"line {line}, the last, has no end: the file may be cut inside its last number; "
                "take that line off, or end it where it is whole"
            )
