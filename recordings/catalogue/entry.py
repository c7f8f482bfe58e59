"""A run as the catalogue lists it.

What tells whether two runs were measured with the same calibrations.
"""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from analysis.signals.header import Acquisition, RunHeader
from recordings.errors import RecordingError
from recordings.mcap.header import calibration_to_json
from recordings.mcap.reader import RunReader


def calibration_identity(acquisition: Acquisition) -> str:
    """Return what is equal for equal calibrations of the probes, and only then: hexadecimal digits."""
    documents = {
        channel.name: calibration_to_json(channel.calibration)
        for channel in acquisition.channels
        if channel.calibration is not None
    }
    return hashlib.sha256(json.dumps(documents, sort_keys=True).encode()).hexdigest()[:16]


NOT_FINISHED = "not finished: it is still being written, or its writer was ended by force"


@dataclass(frozen=True, slots=True)
class RunEntry:
    """A run as the catalogue lists it.

    Parameters
    ----------
    id : str
        The run's id.
    path : Path
        Its file.
    size : int
        Size of the file, bytes.
    changed_ns : int
        When the file was last written to, ns since 1970.
    header : RunHeader or None
        What was known when it started; None where the file cannot be read.
    duration : float
        Sample time, s.
    samples : int
        Samples per channel.
    is_complete : bool
        Whether it was finished properly.
    is_gap_free : bool
        Whether it is one segment without a loss.
    fault : str
        What is wrong with the file, for the operator; empty where all is well.
    remark : str
        Words added afterwards.
    tags : tuple of str
        Tags given afterwards.
    verdict : str
        What the last verification of the file as it is came to (a `Verdict`); empty where there was none.
    calibration : str
        Identity of the probes' calibrations (`recordings.catalogue.entry`).
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
        """When the run began, ns since 1970; the file's last change where that cannot be read."""
        return self.changed_ns if self.header is None else self.header.started_ns


def read_entry(path: Path, size: int, changed_ns: int) -> RunEntry:
    """Return the entry of a file, from the file alone; what is wrong with it is in the entry."""
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
