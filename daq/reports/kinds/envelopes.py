"""Envelopes and waveforms of orders over time, by the second-generation Vold-Kalman filter."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.signals.units import MICROMETRE, MILLISECOND, RPM, phase_lag_degrees
from analysis.tacho.shaft_angle import ShaftAngle
from analysis.vectors.vold_kalman import MAX_ORDER_FRACTION, MEAN_BANDWIDTH, probe_envelopes
from daq.reports.analysis_result import AnalysisResult, columns
from daq.reports.errors import InsufficientDataError, RequestTooLargeError, translated_errors
from daq.reports.kinds.orbits import orders_of
from daq.reports.parameters import EnvelopesQuery, WaveformsQuery
from daq.reports.plots.layouts import DISTINCT_COLOURS, SPEED_COLOUR
from daq.reports.plots.panel import Curve, Panel, Style
from daq.reports.run_samples import CHUNK_ALIGNMENT, RunSamples, SampleRange, moved

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

DEFAULT_BANDWIDTH = 4.0  # Hz
MIN_DURATION = 8.0  # s of envelopes in one solution
SETTLING = 6.0  # s Hz, over the bandwidth: margin on either side for an error of 1e-7
MAX_UNKNOWNS = 2_000_000  # orders squared times samples of one solution: about 1.5 GB
INSET = 0.02  # s at either end, needed by the filters
WAVEFORM_POINTS = 128  # per revolution


@dataclass(frozen=True, slots=True)
class OrderFilter:
    """Orders that are solved together, and the bandwidth.

    Parameters
    ----------
    orders : tuple of float
        Frequencies over shaft frequency.
    hertz, percent : float or None
        Full width at half power, Hz, or in per cent of each component's frequency.
    frequencies : tuple of float
        Fixed frequencies that are solved together with the orders, Hz.
    """

    orders: tuple[float, ...]
    hertz: float | None
    percent: float | None
    frequencies: tuple[float, ...] = ()

    @property
    def bandwidth_text(self) -> str:
        """Bandwidth as displayed."""
        width = f"{self.hertz:g} Hz" if self.hertz is not None else f"{self.percent:g} % of each order"
        return width + "".join(f", beside {frequency:g} Hz" for frequency in self.frequencies)

    def settling(self, slowest: float) -> float:
        """Return the margin on either side of a solution, s, at the slowest speed, revolutions per second."""
        lowest = min([min(self.orders) * slowest, *self.frequencies])
        narrowest = self.hertz if self.hertz is not None else 0.01 * (self.percent or 0.0) * lowest
        return SETTLING / min(narrowest, MEAN_BANDWIDTH * lowest)


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Envelopes at requested times.

    Parameters
    ----------
    envelopes : ndarray of complex128, shape (2, n_orders, n)
        At the probes x and y, m peak.
    sigma : ndarray of float64, shape (2, n_orders, n)
        Standard deviation of their amplitudes, m.
    """

    envelopes: ComplexArray
    sigma: FloatArray


def analyse_envelopes(run: RunSamples, query: EnvelopesQuery) -> AnalysisResult:
    """Return amplitude and phase of several orders over time."""
    is_default = query.bandwidth_hz is None and query.bandwidth_percent is None
    chosen = OrderFilter(
        orders_of(query.orders),
        DEFAULT_BANDWIDTH if is_default else query.bandwidth_hz,
        query.bandwidth_percent,
        orders_of(query.frequencies_hz) if query.frequencies_hz else (),
    )
    span = run.sample_range(query.segment, query.from_s, query.duration_s)
    angle = run.shaft_angle(span)[1]
    begin, end = (float(angle.time(turn)) for turn in (angle.first, angle.last))
    begin, end = max(begin, span.first / run.rate) + INSET, min(end, span.stop / run.rate) - INSET
    if not begin < end:
        raise InsufficientDataError(f"run {run.header.run}: the interval is shorter than {2.0 * INSET:g} s")
    times = np.linspace(begin, end, query.entries)
    solution = solve_orders(run, span, angle, times, chosen)
    speeds = angle.speed(angle.turns(times)) / RPM
    sizes, sigma = np.abs(solution.envelopes) / MICROMETRE, solution.sigma / MICROMETRE
    title = f"{run.header.run} · Vold-Kalman · {times[0]:.1f} to {times[-1]:.1f} s"
    caption = f"solved together, band of {chosen.bandwidth_text}; ± {np.median(sigma):.2g} µm (median 1 σ)"
    panels = [
        Panel(
            title if probe == 0 else "the same at probe y", "time, s", f"amplitude, µm zero-to-peak, at {'xy'[probe]}",
            tuple(
                Curve(f"{order:g}X", times.tolist(), size.tolist(), colour=colour)
                for order, size, colour in zip(chosen.orders, sizes[probe], DISTINCT_COLOURS, strict=False)
            ),
            caption if probe == 0 else "",
        )
        for probe in (0, 1)
    ]  # fmt: skip
    panels.append(
        Panel("speed", "time, s", "speed, r/min", (Curve("", times.tolist(), speeds.tolist(), colour=SPEED_COLOUR),))
    )
    by_probe = {}
    for probe, name in enumerate("xy"):
        by_probe[f"amplitude_peak_{name}_um"] = sizes[probe].ravel()
        by_probe[f"sigma_peak_{name}_um"] = sigma[probe].ravel()
        by_probe[f"lag_{name}_deg"] = phase_lag_degrees(solution.envelopes[probe]).ravel()
    return AnalysisResult(
        title=title,
        columns=columns(
            time_s=np.tile(times, len(chosen.orders)),
            speed_rpm=np.tile(speeds, len(chosen.orders)),
            order=np.repeat(chosen.orders, times.size),
            **by_probe,
        ),
        panels=tuple(panels),
        scalars={"sigma_peak_um": float(np.median(sigma))},
    )


def analyse_waveforms(run: RunSamples, query: WaveformsQuery) -> AnalysisResult:
    """Return the waveforms of single orders in the last revolutions before a time."""
    chosen = OrderFilter(orders_of(query.orders), query.bandwidth_hz, None)
    about, end = run.range_before_frame(query.segment, query.time_s, query.speed_rpm, query.revolutions)
    margin = chosen.settling(_slowest(run.shaft_angle(about)[1]))
    begin = max(about.first / run.rate - margin, 0.0)
    span = run.sample_range(about.segment, begin, about.stop / run.rate + margin - begin)
    angle = run.shaft_angle(span)[1]
    end = min(end, float(angle.time(angle.last)) - INSET)
    last = float(angle.turns(np.array([end]))[0])
    turns = np.linspace(last - query.revolutions, last, WAVEFORM_POINTS * query.revolutions + 1)
    if turns[0] < angle.first:
        raise InsufficientDataError(
            f"run {run.header.run}: fewer than {query.revolutions} revolutions before {end:.1f} s"
        )
    times = np.asarray(angle.time(turns), dtype=np.float64)
    solution = solve_orders(run, span, angle, times, chosen)
    turning = np.exp(2j * np.pi * np.array(chosen.orders)[:, None] * turns)
    waves = (solution.envelopes * turning).real / MICROMETRE
    sigma = float(np.median(solution.sigma)) / MICROMETRE
    speed = query.revolutions / (times[-1] - times[0]) * 60.0
    title = f"{run.header.run} · order waveforms · {speed:,.0f} r/min at {end:.1f} s"
    caption = f"solved together, band of {chosen.bandwidth_text}; ± {sigma:.2g} µm (median 1 σ); dots: keyphasor mark"
    return AnalysisResult(
        title=title,
        columns=columns(
            time_s=np.tile(times, len(chosen.orders)),
            angle_deg=np.tile(360.0 * (turns % 1.0), len(chosen.orders)),
            order=np.repeat(chosen.orders, times.size),
            displacement_x_um=waves[0].ravel(),
            displacement_y_um=waves[1].ravel(),
        ),
        panels=tuple(
            _waves(title if probe == 0 else "the same at probe y", probe, chosen, (times, turns, waves[probe]), caption)
            for probe in (0, 1)
        ),
        scalars={"sigma_peak_um": sigma},
    )


def _waves(
    title: str, probe: int, chosen: OrderFilter, waves: tuple[FloatArray, FloatArray, FloatArray], caption: str
) -> Panel:
    """Return a plot of the waveforms of single orders with the keyphasor mark."""
    times, turns, rows = waves
    shifted = (times - times[0]) / MILLISECOND
    marks = np.interp(np.arange(math.ceil(turns[0]), turns[-1]), turns, shifted)
    curves = [
        Curve(f"{order:g}X", shifted.tolist(), row.tolist(), colour=colour)
        for order, row, colour in zip(chosen.orders, rows, DISTINCT_COLOURS, strict=False)
    ]
    dots = [Curve("", marks.tolist(), np.interp(marks, shifted, row).tolist(), Style.KEYPHASOR) for row in rows]
    shown = caption if probe == 0 else ""
    return Panel(title, "time, ms", f"displacement, µm, at {'xy'[probe]}", (*curves, *dots), shown, y_from_zero=False)


def solve_orders(
    run: RunSamples,
    span: SampleRange,
    angle: ShaftAngle,
    times: FloatArray,
    chosen: OrderFilter,
    min_duration: float = MIN_DURATION,
) -> Solution:
    """Return the envelopes at rising ``times``, s in the segment.

    Solved in pieces of at least ``min_duration`` s that overlap by the settling time of the filter.
    """
    margin = chosen.settling(_slowest(angle))
    core = max(min_duration, 2.0 * margin)
    _require_solvable(run, min(core + 2.0 * margin, (span.stop - span.first) / run.rate), angle, chosen.orders)
    vectors = np.empty((2, len(chosen.orders), times.size), dtype=np.complex128)
    sigma = np.empty(vectors.shape)
    number = np.floor((times - times[0]) / core).astype(np.intp)
    for one in range(int(number[-1]) + 1):
        here = np.flatnonzero(number == one)
        if not here.size:
            continue
        before = max(math.floor((times[here[0]] - margin) * run.rate) - span.first, 0)
        first = span.first + before // CHUNK_ALIGNMENT * CHUNK_ALIGNMENT
        stop = min(math.ceil((times[here[-1]] + margin) * run.rate), span.stop)
        displacement = run.displacement(SampleRange(span.segment, first, stop), task="")
        sampled = (first + np.arange(displacement.shape[1])) / run.rate
        with translated_errors(f"run {run.header.run}"):
            found_times, solution = probe_envelopes(
                displacement, run.rate, moved(angle, -first / run.rate), chosen.orders,
                bandwidth=chosen.hertz, bandwidth_percent=chosen.percent,
                others=tuple(2.0 * np.pi * frequency * sampled for frequency in chosen.frequencies),
            )  # fmt: skip
        count = len(chosen.orders)
        for probe, pair in enumerate(solution):
            vectors[probe][:, here] = _between(times[here], found_times + first / run.rate, pair.envelopes[:count])
            sigma[probe][:, here] = _between(times[here], found_times + first / run.rate, pair.sigma[:count]).real
        run.report_progress("solving for the orders", float((one + 1) / (number[-1] + 1)))
    return Solution(vectors, sigma)


def _between(wanted: FloatArray, times: FloatArray, rows: ComplexArray | FloatArray) -> ComplexArray:
    """Return rows interpolated at times."""
    return np.stack([np.interp(wanted, times, row.real) + 1j * np.interp(wanted, times, row.imag) for row in rows])


def _slowest(angle: ShaftAngle) -> float:
    """Return the lowest speed, revolutions per second."""
    return float(angle.speed(np.linspace(angle.first, angle.last, 1_000)).min()) / (2.0 * math.pi)


def _require_solvable(run: RunSamples, duration: float, angle: ShaftAngle, orders: tuple[float, ...]) -> None:
    """Raise RequestTooLargeError where the solution of ``duration`` s would not fit in memory."""
    fastest = float(angle.speed(np.linspace(angle.first, angle.last, 1_000)).max()) / (2.0 * math.pi)
    level = max(math.floor(math.log2(MAX_ORDER_FRACTION * run.rate / (max(orders) * fastest))), 0)
    unknowns = len(orders) ** 2 * duration * run.rate / 2**level
    if unknowns > MAX_UNKNOWNS:
        longest = MAX_UNKNOWNS / unknowns * duration
        raise RequestTooLargeError(
            f"{len(orders)} orders so narrow are solved for {duration:,.0f} s at a time, expected at most "
            f"{longest:,.0f} s: request a shorter interval, fewer orders or a wider band"
        )
