"""Orders over speed: Bode and polar plot of one order, and the components below 1X from onset to end."""

from collections.abc import Callable
from itertools import cycle

import numpy as np

from analysis.signals.blocks import RampDirection
from analysis.signals.units import MICROMETRE, RPM, phase_lag_degrees
from analysis.spectra.order_map import order_map
from analysis.vectors.order_track import OrderTrack, track_order
from analysis.vectors.speed_curve import Resonance, SpeedCurve, speed_curves
from analysis.whirl.tracks import SubsynchronousTrack, subsynchronous_tracks
from daq.reports.analysis_result import AnalysisResult, columns
from daq.reports.errors import translated_errors
from daq.reports.parameters import SubSynchronousQuery, VectorsQuery
from daq.reports.plots.layouts import DISTINCT_COLOURS, RampCurve, bode, polar
from daq.reports.plots.panel import Curve, Panel, Style, Values
from daq.reports.run_samples import RunSamples, record_over_interval

PEAK_UNIT = "µm zero-to-peak"
MAX_PHASE_SIGMA = np.radians(30.0)  # a more uncertain lag is not drawn
MIN_PEAK_RATIO = 20.0  # of a resonance amplitude to its standard deviation
MAX_PEAKS = 3  # reported for each curve
ARROWS = {RampDirection.RUN_UP: "▲", RampDirection.RUN_DOWN: "▼"}


def analyse_bode(run: RunSamples, query: VectorsQuery) -> AnalysisResult:
    """Return the vectors of an order over speed as a Bode plot."""
    return _vectors(run, query, lambda title, what, ramps, caption: bode(title, what, PEAK_UNIT, ramps, caption))


def analyse_polar(run: RunSamples, query: VectorsQuery) -> AnalysisResult:
    """Return the vectors of an order over speed as a polar plot; a lag of 0 points to the probe."""
    zeros = run.probe_angles
    return _vectors(run, query, lambda title, what, ramps, text: polar(title, what, PEAK_UNIT, ramps, zeros, text))


def _vectors(
    run: RunSamples, query: VectorsQuery, drawn: Callable[[str, str, list[RampCurve], str], list[Panel]]
) -> AnalysisResult:
    prepared = record_over_interval(run, query, query.order)
    run.report_progress("computing")
    with translated_errors(f"run {run.header.run}"):
        track = track_order(prepared.record, query.order, revolutions=query.revolutions)
    curves = speed_curves(track, query.width_rpm * RPM)
    what = f"{query.order:g}X{prepared.title_suffix}"
    sigma = float(np.median(np.concatenate([curve.sigma.ravel() for curve in curves]))) / MICROMETRE
    ramps = [_ramp_curve(curve, ARROWS[curve.direction] if len(curves) > 1 else "") for curve in curves]
    title = f"{run.header.run} · {prepared.position}"
    made = f"{query.revolutions} revolutions per vector, bins of {query.width_rpm:g} r/min"
    caption = f"{what}: {made}; ± {sigma:.2g} µm (median 1 σ)"
    resonances = [(curve, probe, one) for curve in curves for probe in (0, 1) for one in _resonances(curve, probe)]
    scalars = {"sigma_peak_um": sigma, **prepared.scalars}
    largest = max(resonances, key=lambda each: each[2].amplitude, default=None)
    if largest is not None:
        scalars |= {
            "resonance_rpm": largest[2].speed / RPM,
            "largest_peak_um": largest[2].amplitude / MICROMETRE,
            "amplification_factor": largest[2].amplification_factor,
            "amplification_factor_sigma": largest[2].amplification_factor_sigma,
            "resonance_sigma_rpm": largest[2].speed_sigma / RPM,
            "largest_sigma_peak_um": largest[2].amplitude_sigma / MICROMETRE,
        }
    return AnalysisResult(
        title=f"{title} · {what}",
        columns=columns(
            ramp_direction=np.concatenate([np.full(curve.speeds.size, curve.direction.value) for curve in curves]),
            speed_rpm=np.concatenate([curve.speeds for curve in curves]) / RPM,
            **{name: np.concatenate(parts) for name, parts in _by_probe(curves).items()},
            frames=np.concatenate([curve.frames for curve in curves]),
        ),
        panels=tuple(drawn(title, what, ramps, caption)),
        scalars=scalars,
        remarks=(*(_resonance(*each) for each in resonances), *neighbour_remarks(track), *prepared.remarks),
    )


def neighbour_remarks(track: OrderTrack) -> list[str]:
    """Return what to say of components that the frames do not resolve from the order."""
    near = track.neighbour[np.isfinite(track.neighbour)]
    if not near.size:
        return []
    leakage = float(track.leakage.max()) / MICROMETRE
    order = float(np.median(near))
    remark = (
        f"{track.revolutions} revolutions do not resolve a component at {order:.3f}X: up to {leakage:.2g} µm of it "
        f"were subtracted; {track.revolutions_needed:,} revolutions resolve it"
    )
    return [remark]


def _by_probe(curves: tuple[SpeedCurve, ...]) -> dict[str, list[np.ndarray]]:
    curve_columns: dict[str, list[np.ndarray]] = {}
    for probe, name in enumerate("xy"):
        curve_columns[f"amplitude_peak_{name}_um"] = [curve.amplitudes[probe] / MICROMETRE for curve in curves]
        curve_columns[f"sigma_peak_{name}_um"] = [curve.sigma[probe] / MICROMETRE for curve in curves]
        curve_columns[f"lag_{name}_deg"] = [phase_lag_degrees(curve.vectors[probe]) for curve in curves]
        curve_columns[f"lag_sigma_{name}_deg"] = [np.degrees(curve.phase_sigma[probe]) for curve in curves]
    return curve_columns


def _ramp_curve(curve: SpeedCurve, arrow: str) -> RampCurve:
    """Return a curve for plotting; lags that are too uncertain are None."""
    lags = np.where(curve.phase_sigma < MAX_PHASE_SIGMA, phase_lag_degrees(curve.vectors), np.nan)
    rows = [[None if np.isnan(value) else value for value in row] for row in lags.tolist()]
    x, y = (curve.amplitudes / MICROMETRE).tolist()
    known: tuple[Values, Values] = (rows[0], rows[1])
    return RampCurve(arrow, (curve.speeds / RPM).tolist(), (x, y), known)


def _resonances(curve: SpeedCurve, probe: int) -> list[Resonance]:
    """Return the largest resonances that clearly exceed the noise."""
    noise = np.interp([one.speed for one in curve.resonances(probe)], curve.speeds, curve.sigma[probe])
    clear = [
        one for one, sigma in zip(curve.resonances(probe), noise, strict=True) if one.amplitude > MIN_PEAK_RATIO * sigma
    ]
    return sorted(clear, key=lambda one: one.amplitude, reverse=True)[:MAX_PEAKS]


def _resonance(curve: SpeedCurve, probe: int, one: Resonance) -> str:
    factor = (
        ", not resolved"
        if np.isnan(one.amplification_factor)
        else f", amplification {one.amplification_factor:.2f} ± {one.amplification_factor_sigma:.2g}"
    )
    where = f"{one.speed / RPM:,.0f} r/min {ARROWS[curve.direction]}"
    size = f"{one.amplitude / MICROMETRE:.3g} ± {one.amplitude_sigma / MICROMETRE:.2g} µm"
    return f"peak at {'xy'[probe]}: {size} at {where}{factor}"


GUIDE_ORDERS = (0.5, 1.0)
HIGHEST_ORDER = 2.0  # needed by the search


def analyse_sub_synchronous(run: RunSamples, query: SubSynchronousQuery) -> AnalysisResult:
    """Return the components below 1X in order of onset."""
    prepared = record_over_interval(run, query, HIGHEST_ORDER)
    run.report_progress("computing")
    with translated_errors(f"run {run.header.run}"):
        tracks = subsynchronous_tracks(
            order_map(prepared.record, revolutions=query.revolutions, highest_order=HIGHEST_ORDER)
        )
    title = f"{run.header.run} · components below 1X{prepared.title_suffix} · {prepared.position}"
    return AnalysisResult(
        title=title,
        columns=columns(**_table(tracks)),
        panels=_panels(
            title, tracks, float(prepared.record.speeds.min()) / RPM, float(prepared.record.speeds.max()) / RPM
        ),
        scalars=prepared.scalars,
        remarks=prepared.remarks if tracks else ("no component above the noise", *prepared.remarks),
        representative_rows=np.arange(len(tracks)),
    )


def _table(tracks: tuple[SubsynchronousTrack, ...]) -> dict[str, np.ndarray]:
    largest = [int(np.argmax(track.amplitudes)) for track in tracks]
    numbers: dict[str, list[float]] = {
        "component": [float(k) for k in range(1, len(tracks) + 1)],
        "order": [track.order for track in tracks],
        "order_sigma": [float(track.order_sigma[at]) for track, at in zip(tracks, largest, strict=True)],
        "onset_rpm": [track.onset_speed / RPM for track in tracks],
        "end_rpm": [track.end_speed / RPM for track in tracks],
        "begin_s": [float(track.times[0]) for track in tracks],
        "end_s": [float(track.times[-1]) for track in tracks],
        "largest_peak_um": [
            float(track.amplitudes[at]) / MICROMETRE for track, at in zip(tracks, largest, strict=True)
        ],
        "sigma_peak_um": [
            float(track.sigma[at]) * np.sqrt(2.0) / MICROMETRE for track, at in zip(tracks, largest, strict=True)
        ],
        "largest_at_rpm": [float(track.speeds[at]) / RPM for track, at in zip(tracks, largest, strict=True)],
        "exponent": [track.exponent for track in tracks],
        "exponent_sigma": [track.exponent_sigma for track in tracks],
        "lock_rpm": [track.lock_speed / RPM for track in tracks],
        "lock_sigma_rpm": [track.lock_speed_sigma / RPM for track in tracks],
    }
    texts = {
        "direction": ["forward" if track.is_forward else "backward" for track in tracks],
        "behaviour": [track.behaviour.value for track in tracks],
    }
    return {
        **{name: np.array(row, dtype=np.float64) for name, row in numbers.items()},
        **{name: np.array(row, dtype=np.str_) for name, row in texts.items()},
    }


def _panels(title: str, tracks: tuple[SubsynchronousTrack, ...], slowest: float, fastest: float) -> tuple[Panel, ...]:
    frequency, size = [], []
    for number, track in zip(cycle(DISTINCT_COLOURS), tracks, strict=False):
        arrow = "▲" if track.end_speed >= track.onset_speed else "▼"
        name = f"{track.order:.2f}X {track.behaviour.value} {arrow}"
        speeds = (track.speeds / RPM).tolist()
        hertz = (track.orders * track.speeds / (2.0 * np.pi)).tolist()
        frequency.append(Curve(name, speeds, hertz, colour=number))
        size.append(Curve(name, speeds, (track.amplitudes / MICROMETRE).tolist(), colour=number))
    ends = [slowest, fastest]
    guides = [
        Curve(f"{order:g}X", ends, [order * speed / 60.0 for speed in ends], Style.GUIDE) for order in GUIDE_ORDERS
    ]
    caption = "; ".join(_description(track) for track in tracks[:2]) or "no component above the noise"
    return (
        Panel(title, "speed, r/min", "frequency, Hz", (*frequency, *guides), caption),
        Panel(
            "half the major axis", "speed, r/min", "amplitude, µm zero-to-peak", tuple(size), x_range=(slowest, fastest)
        ),
    )


def _description(track: SubsynchronousTrack) -> str:
    exponent = (
        "" if np.isnan(track.exponent) else f", frequency ∝ speed^({track.exponent:.2f} ± {track.exponent_sigma:.2g})"
    )
    return f"{track.order:.2f}X from {track.onset_speed / RPM:,.0f} r/min{exponent}"
