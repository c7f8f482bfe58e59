"""Angular record for an analysis: run-out subtracted, with quality values and title texts."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from analysis.resampling.angular_record import AngularRecord
from analysis.signals.units import MICROMETRE, MICROSECOND, RPM
from daq.reports.parameters import FrameAnalysisQuery, ShaftAngleIntervalQuery
from daq.reports.run_samples import RunSamples

FloatArray: TypeAlias = NDArray[np.float64]

MAX_REPAIRED_FRACTION = 0.02  # of the pulses, filled or rejected, above which a remark is made


@dataclass(frozen=True, slots=True, eq=False)
class PreparedRecord:
    """Angular record with its quality.

    Parameters
    ----------
    record : AngularRecord
        Displacement against angle, minus run-out if requested.
    title_suffix : str
        Suffix of a title: " compensated" or empty.
    scalars : dict of str to float
        Quality values by names of `QUANTITIES`.
    remarks : tuple of str
        Notes on the quality.
    """

    record: AngularRecord
    title_suffix: str
    scalars: dict[str, float]
    remarks: tuple[str, ...]

    @property
    def position(self) -> str:
        """Speed and time of the record as displayed in a title."""
        speeds = self.record.speeds / RPM
        if float(np.ptp(speeds)) < 0.02 * float(speeds.max()):
            return f"{speeds.mean():,.0f} r/min at {self.record.times[-1]:.1f} s"
        begin, end = self.record.times[[0, -1]]
        return f"{speeds.min():,.0f} to {speeds.max():,.0f} r/min, {begin:.1f} to {end:.1f} s"


def record_over_interval(run: RunSamples, query: ShaftAngleIntervalQuery, highest_order: float) -> PreparedRecord:
    """Return the record of a time interval."""
    span = run.sample_range(query.segment, query.from_s, query.duration_s)
    return _prepared(run, run.angular_record(span, highest_order), query.slow_roll_rpm, query.segment)


def record_before_frame(
    run: RunSamples, query: FrameAnalysisQuery, revolutions: int, highest_order: float = 1.0
) -> PreparedRecord:
    """Return the record of the last revolutions before a time."""
    span, end = run.range_before_frame(query.segment, query.time_s, query.speed_rpm, revolutions)
    record = run.last_revolutions(span, end, revolutions, highest_order)
    return _prepared(run, record, query.slow_roll_rpm, span.segment)


def _prepared(
    run: RunSamples, record: AngularRecord, slow_roll_rpm: float | None, segment: int | None
) -> PreparedRecord:
    scalars = {
        "speed_min_rpm": float(record.speeds.min()) / RPM,
        "speed_max_rpm": float(record.speeds.max()) / RPM,
        "revolutions": float(record.revolutions),
        "jitter_us": record.angle_jitter / MICROSECOND,
    }
    remarks = []
    if record.pulses is not None:
        scalars |= {"pulses_filled": float(record.pulses.filled), "pulses_rejected": float(record.pulses.rejected)}
        if record.pulses.too_fast:
            remarks.append("the speed exceeded the response of the tacho sensor: missing pulses may go unnoticed")
        if record.pulses.repaired_fraction > MAX_REPAIRED_FRACTION:
            remarks.append(f"{100 * record.pulses.repaired_fraction:.0f} % of the tacho's pulses were repaired")
    if any(record.clipped):
        x, y = record.clipped
        remarks.append(f"clipped: {x:,} samples at x, {y:,} at y; amplitudes near them are too small")
    if slow_roll_rpm is None:
        return PreparedRecord(record, "", scalars, tuple(remarks))
    roll = run.slow_roll(segment, slow_roll_rpm, record.points)
    x, y = roll.peak_to_peak / MICROMETRE
    source = f"compensated: run-out of {roll.revolutions} turns up to {slow_roll_rpm:,.0f} r/min subtracted, "
    remarks.append(source + f"x {x:.2f} and y {y:.2f} µm peak-to-peak, ± {roll.sigma.max() / MICROMETRE:.2f} µm")
    return PreparedRecord(roll.subtract_waveform(record), " compensated", scalars, tuple(remarks))
