"""What the watching process and its recorder say to one another, over an anonymous pipe."""

from dataclasses import dataclass
from pathlib import Path

from analysis.signals.blocks import SegmentEnd
from analysis.signals.header import RunHeader
from daq.config.rig import Rig


@dataclass(frozen=True, slots=True)
class Order:
    """What is to be recorded.

    Parameters
    ----------
    rig : Rig
        The rig.
    run : str
        Id of the run.
    started_ns : int
        Wall clock, ns since 1970.
    note, program : str
        The operator's words; name and version of the program.
    path : Path
        The file to be made.
    duration : float or None
        Sample time after which to stop, s.
    """

    rig: Rig
    run: str
    started_ns: int
    note: str
    program: str
    path: Path
    duration: float | None


@dataclass(frozen=True, slots=True)
class Opened:
    """The device delivers and the file is there."""

    header: RunHeader


@dataclass(frozen=True, slots=True)
class Refused:
    """Nothing was recorded."""

    message: str
    exit_code: int


@dataclass(frozen=True, slots=True)
class Acquired:
    """The samples have ended; results may still be sent."""

    ends: tuple[SegmentEnd, ...]


@dataclass(frozen=True, slots=True)
class Closed:
    """The file is finished; `message` says what went wrong, if anything did."""

    message: str


@dataclass(frozen=True, slots=True)
class Stop:
    """Stop the source."""


@dataclass(frozen=True, slots=True)
class Done:
    """No more results will come; so many samples were skipped by the live analysis."""

    skipped_samples: int
