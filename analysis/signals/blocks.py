"""Sample blocks and segment ends, as a source delivers them to its sinks, and times within a run.

Index conventions: a *segment* is a stretch of samples without a gap, numbered from 0. The time of a sample is its
index over the sample rate. Arrays have channels first, samples last.
"""

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class SampleBlock:
    """Consecutive samples of all channels, as codes of the A/D converter.

    Parameters
    ----------
    codes : ndarray of int16, shape (n_channels, n_samples)
        Converter codes, C-contiguous.
    segment : int
        Number of the segment in its run, from 0.
    first_sample : int
        Index of the first sample in its segment.
    host_time_ns : int
        Wall clock of the host when the block had been read, ns since 1970 (for the record, never used to compute).
    backlog : int
        Samples per channel that the device still held after this block was read.
    ticks : ndarray of int64, shape (n_pulses,), or None
        Tacho edges stamped by a counter: ticks of its timebase since the first sample of the segment, rising from
        block to block. Contains the edges up to the last sample of this block that no earlier block contains; a late
        edge lies before the first sample. None without a counter, or after it failed.
    """

    codes: NDArray[np.int16]
    segment: int
    first_sample: int
    host_time_ns: int
    backlog: int = 0
    ticks: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        if self.codes.ndim != 2 or self.codes.dtype != np.int16:
            raise ValueError(
                f"codes: {self.codes.dtype} of shape {self.codes.shape}, expected int16 (n_channels, n_samples)"
            )

    @property
    def n_samples(self) -> int:
        """Number of samples per channel."""
        return int(self.codes.shape[1])

    @property
    def end(self) -> int:
        """Index one past the last sample."""
        return self.first_sample + self.n_samples

    def relocated(self, segment: int, first_sample: int, ticks_per_sample: float) -> "SampleBlock":
        """Return the block with another segment and first sample, without edges from before the new segment.

        Parameters
        ----------
        segment, first_sample : int
            New position of the block in its run.
        ticks_per_sample : float
            Counter ticks per sample.
        """
        ticks = self.ticks
        if ticks is not None and first_sample != self.first_sample:
            ticks = ticks - round((self.first_sample - first_sample) * ticks_per_sample)
            ticks = ticks[ticks >= 0]
        return replace(self, segment=segment, first_sample=first_sample, ticks=ticks)


class EndReason(StrEnum):
    """Why a segment ended."""

    STOPPED = "stopped"  # by the operator
    FINISHED = "finished"  # end of the source: planned length reached, or recording replayed
    OVERRUN = "overrun"  # samples were lost between the device and this program
    UNPLUGGED = "unplugged"  # the device was disconnected
    DEVICE_ERROR = "device error"  # any other error that the driver reported
    RECORDER = "recorder"  # the recorder was too slow or could not write
    CUT = "cut"  # the recording was truncated: its writer was killed


@dataclass(frozen=True, slots=True)
class SegmentEnd:
    """The end of a segment and the number of samples lost there.

    Parameters
    ----------
    segment : int
        Number of the segment.
    samples : int
        Samples per channel that the segment delivered.
    reason : EndReason
        Reason for the end.
    lost : int
        Samples per channel known to be lost after its last sample; 0 where none were lost.
    lost_is_exact : bool
        False where ``lost`` is only a lower bound.
    detail : str
        Message and code of the driver, for the operator; empty without an error.
    """

    segment: int
    samples: int
    reason: EndReason
    lost: int = 0
    lost_is_exact: bool = True
    detail: str = ""

    @property
    def is_gap_free(self) -> bool:
        """Whether nothing was lost."""
        return self.lost == 0 and self.lost_is_exact


SourceItem = SampleBlock | SegmentEnd


@dataclass(frozen=True, slots=True)
class TimeInRun:
    """A time within a run, with the shaft speed at that time.

    Parameters
    ----------
    segment : int
        Segment of the run.
    time : float
        Time in that segment, s. For an order frame: its middle.
    speed : float
        Shaft speed, rad/s; NaN where unknown.
    """

    segment: int
    time: float
    speed: float
