"""What an inspection of a recording's file found."""

from dataclasses import dataclass
from enum import StrEnum


class Check(StrEnum):
    """What was looked at."""

    FILE = "file"  # beginning, end, records that lead from one to the next
    CRC = "crc"
    INDEX = "index"
    HEADER = "header"
    CONTINUITY = "continuity"
    COUNTS = "counts"
    CALIBRATION = "calibration"


@dataclass(frozen=True, slots=True)
class Finding:
    """Something found in a file.

    Parameters
    ----------
    check : Check
        What was looked at.
    where : str
        Where it is, as "byte 1234" or "segment 0".
    what : str
        What is there, and what was expected.
    is_fault : bool
        Whether the recording is not whole for it; else it is worth knowing.
    """

    check: Check
    where: str
    what: str
    is_fault: bool = True
