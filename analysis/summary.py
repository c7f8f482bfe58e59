"""What a run was: the answer to the operator's last question, built from snapshots as they come."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from analysis.findings import Moment, WhirlFinding
from analysis.samples import SegmentEnd
from analysis.snapshot import TachoReport
from analysis.speed_table import SpeedRow

FloatArray = NDArray[np.float64]


class Severity(StrEnum):
    """How the largest vibration stands to the limits."""

    GOOD = "good"
    ALARM = "alarm"
    DANGER = "danger"


@dataclass(frozen=True, slots=True)
class ProbeSummary:
    """One probe over the whole run.

    Parameters
    ----------
    name : str
        The channel's name, as "x".
    gap_mean, gap_least, gap_most : float
        Mean, smallest and largest gap voltage over update intervals, V; NaN without snapshots.
    gap_ok : bool
        Whether it lay in its window throughout.
    largest_peak_to_peak : float
        Largest overall vibration, m peak-to-peak; 0 without snapshots.
    largest : Moment or None
        Where that was; None without snapshots.
    severity : Severity
        The largest vibration against the limits.
    """

    name: str
    gap_mean: float
    gap_least: float
    gap_most: float
    gap_ok: bool
    largest_peak_to_peak: float
    largest: Moment | None
    severity: Severity


@dataclass(frozen=True, slots=True, eq=False)
class RunSummary:
    """What a run was.

    Parameters
    ----------
    run, rig, note : str
        Its id, its rig, the operator's words.
    started_ns : int
        Wall clock at the start, ns since 1970.
    duration : float
        Sampled time of all its segments together, s.
    samples : int
        Samples per channel in all its segments together.
    lost : int
        Samples per channel known to be lost.
    lost_is_exact : bool
        False where ``lost`` is only a lower bound.
    segments : tuple of SegmentEnd
        How each segment ended.
    lowest_speed, highest_speed : float
        Range of shaft speed, rad/s; NaN where the tacho never told.
    probes : tuple of ProbeSummary
        The probes x and y.
    clipped : tuple of int
        Samples at the converter's rails, per channel.
    snapshots, frames : int
        Number of snapshots, and of those with an order frame.
    tacho : TachoReport or None
        The last report; None without snapshots.
    tacho_states : dict of str to int
        Number of snapshots in each state of the tacho (`TachoState` values; those that occurred).
    rows : tuple of SpeedRow
        Amplitude, phase and peak-to-peak against speed, in rising order of speed.
    whirls : tuple of WhirlFinding
        Sub-synchronous components in the order in which they began.
    """

    run: str
    rig: str
    note: str
    started_ns: int
    duration: float
    samples: int
    lost: int
    lost_is_exact: bool
    segments: tuple[SegmentEnd, ...]
    lowest_speed: float
    highest_speed: float
    probes: tuple[ProbeSummary, ...]
    clipped: tuple[int, ...]
    snapshots: int
    frames: int
    tacho: TachoReport | None
    tacho_states: dict[str, int]
    rows: tuple[SpeedRow, ...]
    whirls: tuple[WhirlFinding, ...]

    @property
    def is_gap_free(self) -> bool:
        """Whether the run is one known stretch of samples of which none was lost."""
        return len(self.segments) == 1 and self.segments[0].is_gap_free

    @property
    def largest_peak_to_peak(self) -> float:
        """Largest overall vibration of either probe, m peak-to-peak."""
        return max((probe.largest_peak_to_peak for probe in self.probes), default=0.0)

    @property
    def severity(self) -> Severity:
        """The worst of the probes' verdicts."""
        worst = [Severity.GOOD, Severity.ALARM, Severity.DANGER]
        return max((probe.severity for probe in self.probes), key=worst.index, default=Severity.GOOD)
