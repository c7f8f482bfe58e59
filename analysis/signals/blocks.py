"""What travels from a source to its sinks: blocks of samples, and the end of each gap-free segment.

Index conventions, written once: a *segment* is a stretch of samples without a gap; its samples are numbered from 0.
A sample's time is its index over the rate. Channels come first, samples last.
"""

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class SampleBlock:
    """Consecutive samples of all channels as the converter's codes.

    Parameters
    ----------
    codes : ndarray of int16, shape (n_channels, n_samples)
        Converter codes, C-contiguous.
    segment : int
        Number of the segment in its run, from 0.
    first_sample : int
        Index of the first sample in its segment.
    host_time_ns : int
        Wall clock of the host when the block had been read, ns since 1970 (evidence, never used to compute).
    backlog : int
        Samples per channel that the device still held after this block was read.
    ticks : ndarray of int64, shape (n_pulses,), or None
        When the tacho's edges came, as a counter stamped them: ticks of its timebase since the segment's first sample,
        rising from block to block. Those known when this block had been read and not given before, up to its last
        sample; one that came late lies before its first. None where no counter stamps, or none does any more.
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
        """Return the block at another place of its run; what a counter stamped before the new segment is left out.

        Parameters
        ----------
        segment, first_sample : int
            Its new place.
        ticks_per_sample : float
            Of the acquisition's counter.
        """
        ticks = self.ticks
        if ticks is not None and first_sample != self.first_sample:
            ticks = ticks - round((self.first_sample - first_sample) * ticks_per_sample)
            ticks = ticks[ticks >= 0]
        return replace(self, segment=segment, first_sample=first_sample, ticks=ticks)


class EndReason(StrEnum):
    """Why a segment ended."""

    STOPPED = "stopped"  # somebody asked for it
    FINISHED = "finished"  # the source has no more to give (planned length reached, recording played)
    OVERRUN = "overrun"  # samples were lost between the device and us
    UNPLUGGED = "unplugged"  # the device went away
    DEVICE_ERROR = "device error"  # the driver reported anything else
    RECORDER = "recorder"  # the recorder could not keep up or could not write
    CUT = "cut"  # the recording breaks off here: its writer was ended by force


@dataclass(frozen=True, slots=True)
class SegmentEnd:
    """The end of a segment, with what was lost at it.

    Parameters
    ----------
    segment : int
        Number of the segment.
    samples : int
        Samples per channel that the segment delivered.
    reason : EndReason
        Why it ended.
    lost : int
        Samples per channel known to be lost after its last sample; 0 where none were lost.
    lost_is_exact : bool
        False where ``lost`` is only a lower bound.
    detail : str
        What the driver said, with its code, for the operator; empty where all is well.
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
