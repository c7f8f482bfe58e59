"""Samples of a recorded run for analyses, read in chunks so that memory is bounded, and the angular record of them."""

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from analysis.resampling.angular_record import PASSBAND_FRACTION, AngularRecord, angular_record, probe_displacement
from analysis.signals.errors import RecordTooShortError
from analysis.signals.header import CODE_MAX, CODE_MIN, Role, RunHeader
from analysis.signals.probes import ProbePair
from analysis.signals.snapshot import OrderFrame, Snapshot
from analysis.signals.units import MICROMETRE, MICROSECOND, RPM
from analysis.tacho.edges import edge_detector
from analysis.tacho.pulse_record import PulseRecord, pulse_record
from analysis.tacho.shaft_angle import ShaftAngle, shaft_angle
from analysis.vectors.runout import SlowRoll, slow_roll
from daq.reports.analysis_result import ProgressCallback
from daq.reports.errors import DataNotFoundError, InsufficientDataError, RequestTooLargeError, translated_errors
from daq.reports.parameters import FrameAnalysisQuery, FrameQuery, ShaftAngleIntervalQuery
from daq.reports.run_history import RunHistory, load_history, run_snapshots, snapshot_at
from recordings.mcap.reader import RunReader

FloatArray = NDArray[np.float64]

CHUNK_SIZE = 1_000_000  # samples per channel read at a time
MAX_SAMPLES = 30_000_000  # per probe held in memory
MAX_POINTS = 16_000_000  # per probe of an angular record
MAX_FREQUENCY_FRACTION = 0.3  # of the sample rate: interpolation is accurate up to it
MIN_POINTS = 64  # per revolution
CHUNK_ALIGNMENT = 4096  # samples: chunks begin at multiples of it, so that decimated samples lie at the same times
MARGIN_REVOLUTIONS, MARGIN_SAMPLES = 2.0, 128  # around a chunk: reach of the filters and the interpolator
GUARD_REVOLUTIONS = 12  # around a requested time, for an accurate angle at its ends
SPEED_MARGIN = 1.3  # by which the shaft may be slower in the revolutions before


@dataclass(frozen=True, slots=True)
class SampleRange:
    """Consecutive samples of a gap-free segment."""

    segment: int
    first: int
    stop: int


class RunSamples:
    """Reader of a run's samples as displacement, angle and angular record.

    Parameters
    ----------
    reader : RunReader
        Reader of the run's file.
    on_progress : callable
        Receives the progress.
    chunk_size : int
        Samples per channel read at a time.
    """

    def __init__(self, reader: RunReader, on_progress: ProgressCallback, chunk_size: int = CHUNK_SIZE) -> None:
        self._reader = reader
        self._on_progress = on_progress
        self._history: RunHistory | None = None
        self.chunk_size = chunk_size
        self.header: RunHeader = reader.header
        self.rate = reader.header.acquisition.rate

    @property
    def pair(self) -> ProbePair:
        """Angles of the probes as a pair."""
        return ProbePair(*self.probe_angles)

    @property
    def probe_angles(self) -> tuple[float, float]:
        """Angles of probes x and y, rad from X."""
        acquisition = self.header.acquisition
        x, y = (acquisition.channels[acquisition.row(role)].angle for role in (Role.PROBE_X, Role.PROBE_Y))
        return x, y

    def report_progress(self, task: str, fraction: float | None = None) -> None:
        """Report the current task and the fraction done, 0 to 1."""
        self._on_progress(task, fraction)

    def sample_range(self, segment: int | None, start: float = 0.0, duration: float | None = None) -> SampleRange:
        """Return the range of a time interval, s, by default of the longest segment; DataNotFoundError where empty."""
        held = {end.segment: end.samples for end in self._reader.segment_ends}
        chosen = max(held, key=lambda one: held[one], default=0) if segment is None else segment
        if not held.get(chosen):
            raise DataNotFoundError(f"run {self.header.run}: no samples in segment {chosen}")
        first = math.ceil(start * self.rate - 1e-6)
        stop = held[chosen] if duration is None else min(held[chosen], first + max(round(duration * self.rate), 1))
        if first >= stop:
            there = f"segment {chosen} holds {held[chosen] / self.rate:g} s"
            raise DataNotFoundError(f"run {self.header.run}: {there}, no samples from {start:g} s")
        return SampleRange(chosen, first, stop)

    def shaft_angle(self, span: SampleRange) -> tuple[PulseRecord, ShaftAngle]:
        """Return the tacho pulses and the shaft angle; times in the segment, s."""
        times = self._pulse_times(span)
        with translated_errors(f"run {self.header.run}, {self._span(span)}"):
            pulses = pulse_record(times, self.header.acquisition.tacho)
            return pulses, shaft_angle(pulses)

    def angular_record(self, span: SampleRange, highest_order: float = 1.0) -> AngularRecord:
        """Return displacement against shaft angle; times in the segment, s.

        Raises
        ------
        InsufficientDataError
            The tacho gives no angle, or the range has no whole revolution.
        RequestTooLargeError
            More revolutions than fit in memory.
        """
        points = max(MIN_POINTS, 2 ** math.ceil(math.log2(highest_order / PASSBAND_FRACTION)))
        pulses, angle = self.shaft_angle(span)
        self._require_order(highest_order, angle)
        first, last = math.ceil(angle.first), math.floor(angle.last)
        if (last - first) * points > MAX_POINTS:
            most = MAX_POINTS // points
            raise RequestTooLargeError(
                f"{last - first:,} revolutions, expected at most {most:,}: request a shorter interval"
            )
        with translated_errors(f"run {self.header.run}, {self._span(span)}"):
            return replace(self._resampled(span, angle, range(first, last + 1), points), pulses=pulses)

    def displacement(self, span: SampleRange, task: str = "reading samples") -> FloatArray:
        """Return the displacement towards the probes, shape (2, n), m.

        ``task`` is reported with the progress; empty reports none. RequestTooLargeError where the range is too long.
        """
        size = span.stop - span.first
        if size > MAX_SAMPLES:
            longest = MAX_SAMPLES / self.rate
            raise RequestTooLargeError(
                f"{size:,} samples, expected at most {MAX_SAMPLES:,}: request {longest:,.0f} s at most"
            )
        displacement = np.empty((2, size))
        for low in range(0, size, self.chunk_size):
            high = min(low + self.chunk_size, size)
            displacement[:, low:high] = self._probes(SampleRange(span.segment, span.first + low, span.first + high))[0]
            if task:
                self._on_progress(task, high / size)
        return displacement

    def range_before_frame(
        self, segment: int | None, time: float | None, speed_rpm: float | None, revolutions: int
    ) -> tuple[SampleRange, float]:
        """Return the samples up to the recorded frame nearest to a time or speed, and its end, s in the segment.

        The samples include ``revolutions`` before that end. DataNotFoundError where no frame is within the tolerance.
        """
        history = self._history_with_speed()
        index = history.nearest(segment, time, None if speed_rpm is None else speed_rpm * RPM)
        end, speed = float(history.time[index]), float(history.frame_speed[index])
        turn = 2.0 * math.pi / speed
        begin = max(end - SPEED_MARGIN * (revolutions + GUARD_REVOLUTIONS) * turn, 0.0)
        after = end + GUARD_REVOLUTIONS * turn + MARGIN_SAMPLES / self.rate
        return self.sample_range(int(history.segment[index]), begin, after - begin), end

    def recorded_frame(self, query: FrameQuery) -> tuple[Snapshot, OrderFrame]:
        """Return the recorded frame nearest to a time or speed; DataNotFoundError where none is near enough."""
        history, speed = self.history(), None if query.speed_rpm is None else query.speed_rpm * RPM
        return snapshot_at(self._reader.path, history, history.nearest(query.segment, query.time_s, speed))

    def snapshots(self) -> Iterator[Snapshot]:
        """Yield the results of the run in order, as `history` holds them."""
        return run_snapshots(self._reader)

    def last_revolutions(self, span: SampleRange, end: float, revolutions: int, highest_order: float) -> AngularRecord:
        """Return the last whole revolutions before a time, s; InsufficientDataError where there are fewer."""
        record = self.angular_record(span, highest_order)
        if record.revolutions < revolutions:
            raise InsufficientDataError(
                f"run {self.header.run}: {record.revolutions} whole revolutions up to {end:.1f} s, expected at least "
                f"{revolutions}"
            )
        last = int(np.searchsorted(record.times, end + 0.5 / self.rate, side="right")) - 1
        last = min(max(last, revolutions), record.revolutions)
        return record.section(last - revolutions, last)

    def slow_roll(self, segment: int | None, speed_rpm: float, points: int) -> SlowRoll:
        """Return the run-out from the revolutions up to a speed; InsufficientDataError without any."""
        history = self._history_with_speed()
        slow = (history.frame_speed <= speed_rpm * RPM) & (history.segment == self.sample_range(segment).segment)
        if not slow.any():
            raise InsufficientDataError(f"run {self.header.run}: it never turned as slowly as {speed_rpm:,.0f} r/min")
        first = int(np.argmax(slow))
        last = first + int(np.argmin(np.append(slow[first:], False))) - 1
        turn = 2.0 * math.pi / float(history.frame_speed[first])
        begin = max(
            float(history.time[first]) - SPEED_MARGIN * (self.header.settings.revolutions + GUARD_REVOLUTIONS) * turn,
            0.0,
        )
        span = self.sample_range(
            int(history.segment[first]), begin, float(history.time[last]) + GUARD_REVOLUTIONS * turn - begin
        )
        with translated_errors(f"run {self.header.run}, slow roll up to {speed_rpm:,.0f} r/min"):
            return slow_roll(self.angular_record(span, points * PASSBAND_FRACTION), 0.0, speed_rpm * RPM)

    def history(self) -> RunHistory:
        """Return the results of the run: recorded, or from analysing the samples again."""
        if self._history is None:
            is_recorded = self._reader.is_complete and self._reader.skipped_samples == 0
            on_progress = None if is_recorded else partial(self._on_progress, "analysing")
            self._history = load_history(self._reader.path, on_progress)
        return self._history

    def _history_with_speed(self) -> RunHistory:
        """Return the results of the run; InsufficientDataError where no order frame has a speed."""
        history = self.history()
        if not np.isfinite(history.frame_speed).any():
            raise InsufficientDataError(
                f"run {self.header.run}: the tacho measured no speed, or for fewer revolutions than an order frame"
            )
        return history

    def _require_order(self, order: float, angle: ShaftAngle) -> None:
        """Raise InsufficientDataError where an order exceeds the usable frequency range."""
        fastest = float(angle.speed(np.linspace(angle.first, angle.last, 1_000)).max())
        reached, held = order * fastest / (2.0 * math.pi), MAX_FREQUENCY_FRACTION * self.rate
        if reached > held:
            raise InsufficientDataError(
                f"run {self.header.run}: order {order:g} reaches {reached:,.0f} Hz at {fastest / RPM:,.0f} r/min, "
                f"expected at most {held:,.0f} Hz at {self.rate:,.0f} samples a second"
            )

    def _pulse_times(self, span: SampleRange) -> FloatArray:
        """Return the times of the tacho's edges in the segment, s, without correction of the sensor delay."""
        acquisition, counter = self.header.acquisition, self.header.acquisition.tacho.counter
        if counter is not None and counter.is_reference:
            ticks = self._reader.ticks(span.segment, span.first, span.stop)
            if ticks.size:
                return np.asarray(ticks / counter.timebase, dtype=np.float64)
        row = acquisition.row(Role.TACHO)
        channel, detector = acquisition.channels[row], edge_detector(acquisition.tacho)
        edges = [np.empty(0)]
        for low in range(span.first, span.stop, self.chunk_size):
            high = min(low + self.chunk_size, span.stop)
            codes = self._reader.samples(span.segment, low, high)
            edges.append(detector.edges(channel.volts(codes[row]), low))
            self._on_progress("detecting tacho edges", (high - span.first) / (span.stop - span.first))
        return np.asarray(np.concatenate(edges) / acquisition.rate + row / acquisition.convert_rate, dtype=np.float64)

    def _resampled(self, span: SampleRange, angle: ShaftAngle, turns: range, points: int) -> AngularRecord:
        """Return the angular record of the revolutions between successive ``turns``."""
        times = np.asarray(angle.time(np.array(turns)), dtype=np.float64)
        breaks = np.flatnonzero(np.diff(np.floor(times[:-1] * self.rate / self.chunk_size))) + 1
        parts: list[AngularRecord] = []
        clipped = np.zeros(2, dtype=np.int64)
        for begin, end in zip([0, *breaks.tolist()], [*breaks.tolist(), len(turns) - 1], strict=True):
            piece = self._chunk(span, times, begin, end)
            displacement, at_rail = self._probes(piece)
            low, high = (np.clip(times[[begin, end]] * self.rate - piece.first, 0, None)).astype(np.int64)
            clipped += np.count_nonzero(at_rail[:, low:high], axis=1)
            with suppress(RecordTooShortError):  # the first and the last chunk may have no whole revolution
                parts.append(self._part(displacement, angle, piece, (turns[begin], turns[end]), points))
            self._on_progress("reading samples against angle", end / (len(turns) - 1))
        ends = [part.first_turn + part.revolutions for part in parts]
        if not parts or ends[:-1] != [part.first_turn for part in parts[1:]]:
            raise RecordTooShortError("the samples contain no whole revolution")
        return replace(
            parts[0],
            waveform=np.concatenate([part.waveform for part in parts], axis=1),
            times=np.concatenate([*(part.times[:-1] for part in parts), parts[-1].times[-1:]]),
            time_sigma=np.concatenate([*(part.time_sigma[:-1] for part in parts), parts[-1].time_sigma[-1:]]),
            clipped=(int(clipped[0]), int(clipped[1])),
        )

    def _chunk(self, span: SampleRange, times: FloatArray, begin: int, end: int) -> SampleRange:
        """Return the samples needed for the revolutions from index ``begin`` to ``end`` of ``times``."""
        low = times[begin] - MARGIN_REVOLUTIONS * (times[begin + 1] - times[begin])
        high = times[end] + MARGIN_REVOLUTIONS * (times[end] - times[end - 1])
        first = (
            math.floor(low * self.rate) - MARGIN_SAMPLES - span.first
        ) // CHUNK_ALIGNMENT * CHUNK_ALIGNMENT + span.first
        stop = math.ceil(high * self.rate) + MARGIN_SAMPLES
        return SampleRange(span.segment, max(first, span.first), min(stop, span.stop))

    def _part(
        self, displacement: FloatArray, angle: ShaftAngle, piece: SampleRange, turns: tuple[int, int], points: int
    ) -> AngularRecord:
        """Return the revolutions between two counts from the displacement of a chunk."""
        acquisition, shift = self.header.acquisition, piece.first / self.rate
        skews = tuple(acquisition.row(role) / acquisition.convert_rate for role in (Role.PROBE_X, Role.PROBE_Y))
        here = replace(moved(angle, -shift), first=float(turns[0]), last=float(turns[1]))
        part = angular_record(displacement, self.rate, here, self.pair, points=points, skews=(skews[0], skews[1]))
        return replace(part, times=part.times + shift)

    def _probes(self, span: SampleRange) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return the displacement towards the probes, m, and a mask of clipped samples."""
        codes = self._reader.samples(span.segment, span.first, span.stop)
        acquisition = self.header.acquisition
        rows = [acquisition.row(role) for role in (Role.PROBE_X, Role.PROBE_Y)]
        at_rail = (codes[rows] == CODE_MIN) | (codes[rows] == CODE_MAX)
        with translated_errors(f"run {self.header.run}, {self._span(span)}"):
            return probe_displacement(acquisition, codes), at_rail

    def _span(self, span: SampleRange) -> str:
        return f"segment {span.segment}, {span.first / self.rate:.1f} to {span.stop / self.rate:.1f} s"


def moved(angle: ShaftAngle, shift: float) -> ShaftAngle:
    """Return a shaft angle with its times shifted by ``shift`` s."""
    spline = angle.time
    return replace(angle, time=BSpline(spline.t, spline.c + shift, spline.k))


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
