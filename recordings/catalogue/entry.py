"""A run's file in the data folder and its entry in the catalogue."""

import hashlib
import json
import stat
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from analysis.signals.header import Acquisition, RunHeader
from recordings.catalogue.annotations import annotations_path
from recordings.errors import RecordingError
from recordings.mcap.header import calibration_to_json
from recordings.mcap.reader import RunReader

NOT_FINISHED = "not finished: it is still being written, or its writer was killed"


@dataclass(frozen=True, slots=True)
class RunFile:
    """Size and modification times of a run's file: what changes when the file changes.

    Parameters
    ----------
    path : Path
        The file.
    size : int
        Bytes.
    changed_ns : int
        Modification time of the file, ns since 1970.
    remarked_ns : int
        Modification time of the annotations beside it, ns since 1970; 0 without annotations.
    """

    path: Path
    size: int
    changed_ns: int
    remarked_ns: int

    @classmethod
    def from_path(cls, path: Path, *, may_have_annotations: bool = True) -> Self | None:
        """Return the state of a file on disk; None if it is missing or not a regular file."""
        try:
            status = path.stat()
        except OSError:
            return None
        if not stat.S_ISREG(status.st_mode):
            return None
        remarked_ns = 0
        if may_have_annotations:
            with suppress(OSError):
                remarked_ns = annotations_path(path).stat().st_mtime_ns
        return cls(path, status.st_size, status.st_mtime_ns, remarked_ns)


@dataclass(frozen=True, slots=True)
class RunEntry:
    """A run as the catalogue lists it.

    Parameters
    ----------
    id : str
        Run id: the file's name without suffix.
    path : Path
        The run's file.
    size : int
        Size of the file, bytes.
    changed_ns : int
        Modification time of the file, ns since 1970.
    header : RunHeader or None
        The run's header; None if the file cannot be read.
    duration : float
        Sample time, s.
    samples : int
        Samples per channel.
    is_complete : bool
        Whether the run was finished properly.
    is_gap_free : bool
        Whether the run is one segment without a loss.
    fault : str
        What is wrong with the file, for the operator; empty if nothing is.
    remark : str
        Text added after recording.
    tags : tuple of str
        Tags added after recording.
    verdict : str
        Result of the last verification of the file in its present state (a `Verdict`); empty if not verified.
    calibration : str
        `calibration_identity` of the probes' calibrations.
    """

    id: str
    path: Path
    size: int
    changed_ns: int
    header: RunHeader | None = None
    duration: float = 0.0
    samples: int = 0
    is_complete: bool = False
    is_gap_free: bool = False
    fault: str = ""
    remark: str = ""
    tags: tuple[str, ...] = ()
    verdict: str = ""
    calibration: str = ""

    @property
    def started_ns(self) -> int:
        """Start of the run, ns since 1970; the file's modification time if the header cannot be read."""
        return self.changed_ns if self.header is None else self.header.started_ns


def read_entry(path: Path, size: int, changed_ns: int) -> RunEntry:
    """Return the entry of a file, read from the file alone; a read error becomes the entry's fault."""
    try:
        with RunReader(path) as reader:
            return RunEntry(
                path.stem,
                path,
                size,
                changed_ns,
                header=reader.header,
                duration=reader.duration,
                samples=reader.n_samples,
                is_complete=reader.is_complete,
                is_gap_free=reader.is_gap_free,
                fault="" if reader.is_complete else NOT_FINISHED,
                calibration=calibration_identity(reader.header.acquisition),
            )
    except RecordingError as error:
        return RunEntry(path.stem, path, size, changed_ns, fault=str(error))


def calibration_identity(acquisition: Acquisition) -> str:
    """Return a hash of the probes' calibrations, 16 hexadecimal digits: equal for equal calibrations only."""
    calibrations = {
        channel.name: calibration_to_json(channel.calibration)
        for channel in acquisition.channels
        if channel.calibration is not None
    }
    return hashlib.sha256(json.dumps(calibrations, sort_keys=True).encode()).hexdigest()[:16]
