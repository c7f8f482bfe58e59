"""Shaft position over speed: bifurcation diagram and shaft centreline."""

import numpy as np

from analysis.shaft.orbit import centreline
from analysis.shaft.poincare import bifurcation_diagram
from analysis.signals.units import MICROMETRE, RPM
from daq.reports.analysis_result import AnalysisResult
from daq.reports.columns import columns
from daq.reports.errors import translated_errors
from daq.reports.kinds.prepared_record import PreparedRecord, record_over_interval
from daq.reports.parameters import BifurcationQuery, CentrelineQuery
from daq.reports.plots.panel import Curve, Panel, Style
from daq.reports.run_samples import RunSamples

MAX_DOTS = 20_000  # of a plot
REFERENCE_TOLERANCE = 0.05  # of the clearance
LABEL_SPACING = 0.12  # of the clearance, between speed labels of a centreline


def analyse_bifurcation(run: RunSamples, query: BifurcationQuery) -> AnalysisResult:
    """Return the shaft position at the keyphasor mark of every revolution over speed."""
    prepared = record_over_interval(run, query, 1.0)
    run.report_progress("computing")
    with translated_errors(f"run {run.header.run}"):
        speeds, positions = bifurcation_diagram(prepared.record, averaging_revolutions=query.averaging_revolutions)
    speeds, positions = speeds / RPM, positions / MICROMETRE
    step = -(-speeds.size // MAX_DOTS)
    shown = slice(None, None, step)
    title = f"{run.header.run} · bifurcation diagram{prepared.title_suffix} · {prepared.position}"
    caption = f"one point per revolution at the keyphasor mark, minus the moving mean of {query.averaging_revolutions}"
    reach = 1.05 * float(np.abs(positions).max())
    panels = tuple(
        Panel(
            title if row == 0 else "Y", "speed, r/min", f"{name} at the keyphasor mark, µm",
            (Curve("", speeds[shown].tolist(), positions[row, shown].tolist(), Style.DOTS, colour=row),),
            caption if row == 0 else "", y_range=(-reach, reach),
        )
        for row, name in enumerate(("X", "Y"))
    )  # fmt: skip
    return AnalysisResult(
        title=title,
        columns=columns(time_s=prepared.record.times[:-1], speed_rpm=speeds, X_um=positions[0], Y_um=positions[1]),
        panels=panels,
        scalars=prepared.scalars,
        remarks=prepared.remarks,
    )


def analyse_centreline(run: RunSamples, query: CentrelineQuery) -> AnalysisResult:
    """Return the mean position of the shaft in its clearance over time and speed."""
    prepared = record_over_interval(run, query, 1.0)
    clearance = run.header.limits.clearance
    rest, reference = _rest_position(prepared, query)
    run.report_progress("computing")
    with translated_errors(f"run {run.header.run}"):
        found = centreline(prepared.record, rest, clearance, revolutions=query.revolutions)
    x, y = found.positions / MICROMETRE
    sigma, speeds = found.sigma / MICROMETRE, found.speeds / RPM
    title = f"{run.header.run} · shaft centreline · {prepared.position}"
    caption = f"{reference}; ± {np.median(sigma):.2g} µm (1 σ); circle: clearance of {clearance / MICROMETRE:g} µm"
    around, above = (found.circle() / MICROMETRE).tolist()
    notes: list[tuple[str, float, float]] = []
    for speed, across, up in zip(speeds.tolist(), x.tolist(), y.tolist(), strict=True):
        if all(np.hypot(across - a, up - b) > LABEL_SPACING * clearance / MICROMETRE for _, a, b in notes):
            notes.append((f"{speed:,.0f}", across, up))
    panel = Panel(
        title, "X to the right, µm; r/min along the path", "Y up, µm",
        (Curve("", x.tolist(), y.tolist()), Curve("", around, above, Style.GUIDE)), caption, is_square=True,
        notes=tuple(notes),
    )  # fmt: skip
    outside = int(np.count_nonzero(found.eccentricity_ratio > 1.0 + REFERENCE_TOLERANCE))
    remarks = (
        () if not outside else (f"{outside} positions outside the clearance: rest position or clearance is wrong",)
    )
    return AnalysisResult(
        title=title,
        columns=columns(
            time_s=found.times, speed_rpm=speeds, X_um=x, Y_um=y, X_sigma_um=sigma[0], Y_sigma_um=sigma[1],
            eccentricity_ratio=found.eccentricity_ratio, attitude_deg=np.degrees(found.attitude),
        ),
        panels=(panel,),
        scalars=prepared.scalars,
        remarks=(reference, *remarks, *prepared.remarks),
    )  # fmt: skip


def _rest_position(prepared: PreparedRecord, query: CentrelineQuery) -> tuple[np.ndarray, str]:
    """Return the displacement at the probes at rest, m, and its source."""
    if query.rest_x_um is not None and query.rest_y_um is not None:
        rest = np.array([query.rest_x_um, query.rest_y_um]) * MICROMETRE
        return rest, "rest position as given"
    record = prepared.record
    slowest = np.argsort(record.speeds)[: min(query.revolutions, record.revolutions)]
    speed = float(record.speeds[slowest].mean()) / RPM
    source = f"the slowest {slowest.size} turns, {speed:,.0f} r/min, taken as the rest position"
    return record.waveform[:, slowest].mean(axis=(1, 2)), source
