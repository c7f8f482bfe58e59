"""Orders as they swell and fade, and their waveforms, by the Vold-Kalman filter of the second generation."""

import math

import numpy as np
from numpy.typing import NDArray

from analysis.shaft_angle import ShaftAngle
from analysis.vold_kalman import PASSED, OrderEnvelopes, probe_envelopes
from daq.service.analyses.analysis import Analysis
from daq.service.analyses.columns import columns
from daq.service.analyses.not_told import told_or_refused
from daq.service.analyses.orbits import orders_of
from daq.service.analyses.questions import EnvelopesQuery, WaveformsQuery
from daq.service.analyses.run_samples import RunSamples, Stretch, moved
from daq.service.analyses.turning import MICRO, RPM, in_degrees
from daq.service.layouts import OTHERS, SPEED
from daq.service.panel import Curve, Panel, Style
from daq.service.sample_answers import TooMuchError

FloatArray = NDArray[np.float64]
Pair = tuple[OrderEnvelopes, OrderEnvelopes]

BANDWIDTH = 4.0  # Hz, where none is named
MOST_UNKNOWNS = 2_000_000  # orders times samples that are solved for together: about 1.5 GB at six orders
FINE = 128  # instants of a waveform a revolution
SETTLING = 2.0  # over the bandwidth: time about a moment in which the filter settles, s Hz


def envelopes(run: RunSamples, query: EnvelopesQuery) -> Analysis:
    """Return amplitude and phase of several orders at both probes over time."""
    orders = orders_of(query.orders)
    stretch = run.stretch(query.segment, query.from_s, query.duration_s)
    hertz = query.bandwidth_hz
    if hertz is None and query.bandwidth_percent is None:
        hertz = BANDWIDTH
    times, found, speeds = _solved(run, stretch, orders, hertz, query.bandwidth_percent)
    picked = np.unique(np.linspace(0, times.size - 1, min(query.entries, times.size)).round().astype(np.intp))
    times, speeds = times[picked], speeds[picked]
    band = f"{hertz:g} Hz" if hertz is not None else f"{query.bandwidth_percent:g} % of each order"
    title = f"{run.header.run} · Vold-Kalman · {times[0]:.1f} to {times[-1]:.1f} s"
    sigma = float(np.median([pair.sigma for pair in found])) * MICRO
    caption = f"solved together, band of {band}; ± {sigma:.2g} µm (median 1 σ)"
    panels = [
        Panel(
            title if probe == 0 else "the same at probe y", "s", f"µm zero-to-peak at {'xy'[probe]}",
            tuple(
                Curve(f"{order:g}X", times.tolist(), (np.abs(envelope[picked]) * MICRO).tolist(), colour=colour)
                for order, envelope, colour in zip(orders, pair.envelopes, OTHERS, strict=False)
            ),
            caption if probe == 0 else "",
        )
        for probe, pair in enumerate(found)
    ]  # fmt: skip
    panels.append(Panel("speed", "s", "r/min", (Curve("", times.tolist(), speeds.tolist(), colour=SPEED),)))
    return Analysis(
        title=title,
        columns=columns(
            time_s=np.tile(times, len(orders)),
            speed_rpm=np.tile(speeds, len(orders)),
            order=np.repeat(orders, times.size),
            **_by_probe(found, picked),
        ),
        panels=tuple(panels),
        figures={"sigma_peak_um": sigma},
    )


def waveforms(run: RunSamples, query: WaveformsQuery) -> Analysis:
    """Return the waveforms of single orders in the last revolutions before a moment."""
    orders = orders_of(query.orders)
    stretch, end = run.moment(query.segment, query.time_s, query.speed_rpm, query.revolutions)
    room = SETTLING / query.bandwidth_hz
    begin = max(stretch.first / run.rate - room, 0.0)
    wide = run.stretch(stretch.segment, begin, stretch.stop / run.rate + room - begin)
    times, found, speeds = _solved(run, wide, orders, query.bandwidth_hz, None)
    turns = found[0].angle / (2.0 * np.pi)
    last = float(np.interp(end, times, turns))
    shown = (turns > last - query.revolutions) & (turns <= last)
    fine = np.linspace(times[shown][0], times[shown][-1], FINE * query.revolutions + 1)
    turned = np.interp(fine, times, turns)
    waves = np.stack([_waves(pair, times, fine, turned) for pair in found]) * MICRO
    speed = float(speeds[shown].mean())
    sigma = float(np.median([pair.sigma[:, shown] for pair in found])) * MICRO
    title = f"{run.header.run} · order waveforms · {speed:,.0f} r/min at {end:.1f} s"
    passed = np.arange(math.ceil(turned[0]), turned[-1])
    marks, shifted = np.interp(passed, turned, fine) - fine[0], 1e3 * (fine - fine[0])
    caption = f"solved together, band of {query.bandwidth_hz:g} Hz; ± {sigma:.2g} µm (median 1 σ); dots: the mark"
    panels = tuple(
        Panel(
            title if probe == 0 else "the same at probe y", "ms", f"µm at {'xy'[probe]}",
            (
                *(
                    Curve(f"{order:g}X", shifted.tolist(), waves[probe, row].tolist(), colour=OTHERS[row])
                    for row, order in enumerate(orders)
                ),
                *(
                    Curve("", (1e3 * marks).tolist(), np.interp(1e3 * marks, shifted, row).tolist(), Style.MARKS)
                    for row in waves[probe]
                ),
            ),
            caption if probe == 0 else "", y_from_zero=False,
        )
        for probe in (0, 1)
    )  # fmt: skip
    return Analysis(
        title=title,
        columns=columns(
            time_s=np.tile(fine, len(orders)),
            angle_deg=np.tile(360.0 * (turned % 1.0), len(orders)),
            order=np.repeat(orders, fine.size),
            displacement_x_um=waves[0].ravel(),
            displacement_y_um=waves[1].ravel(),
        ),
        panels=panels,
        figures={"sigma_peak_um": sigma},
    )


def _waves(pair: OrderEnvelopes, times: FloatArray, fine: FloatArray, turns: FloatArray) -> FloatArray:
    """Return the waveforms of the orders at instants between the envelopes' own, shape (n_orders, n)."""
    rows = []
    for order, envelope in zip(pair.orders, pair.envelopes, strict=True):
        between = np.interp(fine, times, envelope.real) + 1j * np.interp(fine, times, envelope.imag)
        rows.append((between * np.exp(2j * np.pi * order * turns)).real)
    return np.stack(rows)


def _solved(
    run: RunSamples, stretch: Stretch, orders: tuple[float, ...], hertz: float | None, percent: float | None
) -> tuple[FloatArray, Pair, FloatArray]:
    """Return times, s in the segment, envelopes at both probes, and speeds, r/min."""
    angle = run.angle(stretch)[1]
    _require_solvable(run, stretch, orders, angle)
    displacement = run.displacement(stretch)
    begin = stretch.first / run.rate
    run.tell("solving for the orders")
    with told_or_refused(f"run {run.header.run}"):
        times, found = probe_envelopes(
            displacement, run.rate, moved(angle, -begin), orders, bandwidth=hertz, bandwidth_percent=percent
        )
    turning = np.gradient(found[0].angle, times)
    return times + begin, found, turning * RPM


def _require_solvable(run: RunSamples, stretch: Stretch, orders: tuple[float, ...], angle: ShaftAngle) -> None:
    """Raise TooMuchError where more would be solved for together than memory bears."""
    fastest = float(angle.speed(np.linspace(angle.first, angle.last, 1_000)).max()) / (2.0 * np.pi)
    level = max(math.floor(math.log2(PASSED * run.rate / (max(orders) * fastest))), 0)
    unknowns = len(orders) ** 2 * (stretch.stop - stretch.first) / 2**level
    if unknowns > MOST_UNKNOWNS:
        longest = MOST_UNKNOWNS / unknowns * (stretch.stop - stretch.first) / run.rate
        raise TooMuchError(f"{len(orders)} orders over this stretch: ask for {longest:.0f} s at most, or fewer orders")


def _by_probe(found: Pair, picked: NDArray[np.intp]) -> dict[str, FloatArray]:
    table: dict[str, FloatArray] = {}
    for name, pair in zip("xy", found, strict=True):
        vectors = pair.envelopes[:, picked]
        table[f"amplitude_peak_{name}_um"] = np.abs(vectors).ravel() * MICRO
        table[f"sigma_peak_{name}_um"] = pair.sigma[:, picked].ravel() * MICRO
        table[f"lag_{name}_deg"] = in_degrees(vectors).ravel()
    return table
