"""Vectors of one order over speed, run-up and run-down separately: Bode plot and polar plot."""

from collections.abc import Callable

import numpy as np

from analysis.signals.blocks import RampDirection
from analysis.signals.units import MICROMETRE, RPM, phase_lag_degrees
from analysis.vectors.order_track import track_order
from analysis.vectors.speed_curve import Resonance, SpeedCurve, speed_curves
from daq.reports.analysis_result import AnalysisResult
from daq.reports.columns import columns
from daq.reports.errors import translated_errors
from daq.reports.kinds.prepared_record import record_over_interval
from daq.reports.parameters import VectorsQuery
from daq.reports.plots.layouts import RampCurve, bode, polar
from daq.reports.plots.panel import Panel, Values
from daq.reports.run_samples import RunSamples

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
    found = [(curve, probe, one) for curve in curves for probe in (0, 1) for one in _resonances(curve, probe)]
    scalars = {"sigma_peak_um": sigma, **prepared.scalars}
    largest = max(found, key=lambda each: each[2].amplitude, default=None)
    if largest is not None:
        scalars |= {
            "resonance_rpm": largest[2].speed / RPM,
            "largest_peak_um": largest[2].amplitude / MICROMETRE,
            "amplification_factor": largest[2].amplification_factor,
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
        remarks=(*(_resonance(*each) for each in found), *prepared.remarks),
    )


def _by_probe(curves: tuple[SpeedCurve, ...]) -> dict[str, list[np.ndarray]]:
    found: dict[str, list[np.ndarray]] = {}
    for probe, name in enumerate("xy"):
        found[f"amplitude_peak_{name}_um"] = [curve.amplitudes[probe] / MICROMETRE for curve in curves]
        found[f"sigma_peak_{name}_um"] = [curve.sigma[probe] / MICROMETRE for curve in curves]
        found[f"lag_{name}_deg"] = [phase_lag_degrees(curve.vectors[probe]) for curve in curves]
        found[f"lag_sigma_{name}_deg"] = [np.degrees(curve.phase_sigma[probe]) for curve in curves]
    return found


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
    factor = "" if np.isnan(one.amplification_factor) else f", amplification {one.amplification_factor:.1f}"
    where = f"{one.speed / RPM:,.0f} r/min {ARROWS[curve.direction]}"
    return f"peak at {'xy'[probe]}: {one.amplitude / MICROMETRE:.3g} µm at {where}{factor}"
