"""Shaft position: orbit and Poincaré section at a time; bifurcation diagram and centreline over speed."""

import math

import numpy as np

from analysis.shaft.orbit import Orbit, centreline, direct_orbit, filtered_orbit, orbit_without
from analysis.shaft.poincare import Pattern, PoincareSection, bifurcation_diagram, poincare_section
from analysis.signals.units import MICROMETRE, MILLISECOND, RPM
from daq.reports.analysis_result import AnalysisResult, columns
from daq.reports.errors import translated_errors
from daq.reports.parameters import BifurcationQuery, CentrelineQuery, OrbitFilter, OrbitQuery, PoincareQuery
from daq.reports.plots.layouts import orbit
from daq.reports.plots.panel import Curve, Panel, Style
from daq.reports.run_samples import PreparedRecord, RunSamples, record_before_frame, record_over_interval

AVERAGED_REVOLUTIONS = 16  # for the vectors of a filtered orbit
PATTERNS = {
    Pattern.POINT: "a point: synchronous only",
    Pattern.CLUSTERS: "clusters: a component locked to {numerator}/{period} of the speed",
    Pattern.CURVE: "a closed curve: whirl that is not locked to the speed",
    Pattern.CLOUD: "a cloud: chaos, noise, or several components",
    Pattern.UNKNOWN: "unknown: needs {needed:,} revolutions",
}


def orders_of(text: str) -> tuple[float, ...]:
    """Return the orders of a comma-separated list."""
    return tuple(float(part) for part in text.split(","))


def analyse_orbit(run: RunSamples, query: OrbitQuery) -> AnalysisResult:
    """Return the orbit of the last revolutions before a time."""
    orders = orders_of(query.orders)
    used = max(query.revolutions, AVERAGED_REVOLUTIONS)
    prepared = record_before_frame(run, query, used, max(1.0, *orders))
    with translated_errors(f"run {run.header.run}"):
        shaft_orbit, orbit_name = _orbit(prepared, query, orders)
    motion = shaft_orbit.motion / MICROMETRE
    n_revolutions, points = motion.shape[1:]
    begin = shaft_orbit.times[0, 0]
    scalars, ellipses = dict(prepared.scalars), []
    for order, ellipse in zip(orders, shaft_orbit.ellipses, strict=False):
        sense = "forward" if ellipse.minor >= 0.0 else "backward"
        major, minor, sigma = (size / MICROMETRE for size in (ellipse.major, abs(ellipse.minor), shaft_orbit.sigma))
        size = f"{major:.3g} × {minor:.3g} ± {sigma:.2g} µm peak"
        ellipses.append(f"{order:g}X {sense}, {size}, tilt {math.degrees(ellipse.tilt):.0f}°")
    if shaft_orbit.ellipses:
        first = shaft_orbit.ellipses[0]
        scalars |= {
            "major_peak_um": first.major / MICROMETRE,
            "minor_peak_um": first.minor / MICROMETRE,
            "tilt_deg": math.degrees(first.tilt),
            "sigma_peak_um": shaft_orbit.sigma / MICROMETRE,
        }
    x, y = shaft_orbit.peak_to_peak / MICROMETRE
    title = f"{run.header.run} · {orbit_name} orbit{prepared.title_suffix} · {prepared.position}"
    extent = f"{n_revolutions} revolutions, X {x:.3g}, Y {y:.3g} µm peak-to-peak"
    caption = "; ".join([*ellipses[:1], extent])
    paths = [(motion[0, index].tolist(), motion[1, index].tolist()) for index in range(n_revolutions)]
    return AnalysisResult(
        title=title,
        columns=columns(
            revolution=np.repeat(np.arange(n_revolutions), points),
            angle_deg=np.tile(np.arange(points) * 360.0 / points, n_revolutions),
            time_s=shaft_orbit.times.ravel(),
            X_um=motion[0].ravel(),
            Y_um=motion[1].ravel(),
        ),
        panels=(orbit(title, paths, run.probe_angles, caption), _timebase(shaft_orbit, begin)),
        scalars=scalars,
        remarks=(*ellipses, *prepared.remarks),
    )


def _orbit(prepared: PreparedRecord, query: OrbitQuery, orders: tuple[float, ...]) -> tuple[Orbit, str]:
    named = " and ".join(f"{order:g}X" for order in orders)
    match query.filter:
        case OrbitFilter.DIRECT:
            return direct_orbit(prepared.record, query.revolutions), "direct"
        case OrbitFilter.ORDERS:
            return filtered_orbit(
                prepared.record, orders, revolutions=query.revolutions, averaging_revolutions=AVERAGED_REVOLUTIONS
            ), named
        case OrbitFilter.WITHOUT:
            orbit = orbit_without(
                prepared.record, orders, revolutions=query.revolutions, averaging_revolutions=AVERAGED_REVOLUTIONS
            )
            return orbit, f"not-{named}"


def _timebase(orbit: Orbit, begin: float) -> Panel:
    """Return a plot of X and Y over time with the keyphasor mark."""
    times = (orbit.times - begin) / MILLISECOND
    curves = [
        Curve(name, times.ravel().tolist(), (row / MICROMETRE).ravel().tolist(), colour=colour)
        for colour, (name, row) in enumerate(zip(("X", "Y"), orbit.motion, strict=True))
    ]
    marks = [
        Curve("", times[:, 0].tolist(), (row / MICROMETRE).tolist(), Style.KEYPHASOR) for row in orbit.keyphasor_points
    ]
    return Panel(
        "time base, dots: keyphasor mark", "time, ms", "displacement, µm", (*curves, *marks), y_from_zero=False
    )


def analyse_poincare(run: RunSamples, query: PoincareQuery) -> AnalysisResult:
    """Return the shaft positions at the keyphasor mark in the last revolutions before a time."""
    prepared = record_before_frame(run, query, query.revolutions)
    with translated_errors(f"run {run.header.run}"):
        section = poincare_section(prepared.record)
    points = section.points / MICROMETRE
    title = f"{run.header.run} · Poincaré section{prepared.title_suffix} · {prepared.position}"
    pattern = _pattern(section)
    scatter = section.scatter / MICROMETRE
    caption = f"{query.revolutions} turns: {pattern}; scatter {scatter:.3g} µm RMS"
    dots = Curve("", points[0].tolist(), points[1].tolist(), Style.DOTS)
    return AnalysisResult(
        title=title,
        columns=columns(
            revolution=np.arange(points.shape[1]),
            time_s=prepared.record.times[:-1],
            speed_rpm=section.speeds / RPM,
            X_um=points[0],
            Y_um=points[1],
        ),
        panels=(Panel(title, "X at the mark, µm", "Y at the mark, µm", (dots,), caption, is_square=True),),
        scalars={
            "period": float(section.period),
            "scatter_um": scatter,
            "order": section.order,
            "order_sigma": section.order_sigma,
            "revolutions_needed": float(section.revolutions_needed),
            **prepared.scalars,
        },
        remarks=(f"pattern of the points: {pattern}", *prepared.remarks),
    )


def _pattern(section: PoincareSection) -> str:
    numerator = round(section.order * section.period) if section.period > 1 else 1
    pattern = PATTERNS[section.pattern].format(
        period=section.period, numerator=numerator, needed=section.revolutions_needed
    )
    order = "" if math.isnan(section.order) else f" ({section.order:.4f} ± {2.0 * section.order_sigma:.1g}X)"
    return pattern + order


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
        shaft_centreline = centreline(prepared.record, rest, clearance, revolutions=query.revolutions)
    x, y = shaft_centreline.positions / MICROMETRE
    sigma, speeds = shaft_centreline.sigma / MICROMETRE, shaft_centreline.speeds / RPM
    title = f"{run.header.run} · shaft centreline · {prepared.position}"
    caption = f"{reference}; ± {np.median(sigma):.2g} µm (1 σ); circle: clearance of {clearance / MICROMETRE:g} µm"
    around, above = (shaft_centreline.circle() / MICROMETRE).tolist()
    notes: list[tuple[str, float, float]] = []
    for speed, across, up in zip(speeds.tolist(), x.tolist(), y.tolist(), strict=True):
        if all(np.hypot(across - a, up - b) > LABEL_SPACING * clearance / MICROMETRE for _, a, b in notes):
            notes.append((f"{speed:,.0f}", across, up))
    panel = Panel(
        title, "X to the right, µm; r/min along the path", "Y up, µm",
        (Curve("", x.tolist(), y.tolist()), Curve("", around, above, Style.GUIDE)), caption, is_square=True,
        notes=tuple(notes),
    )  # fmt: skip
    outside = int(np.count_nonzero(shaft_centreline.eccentricity_ratio > 1.0 + REFERENCE_TOLERANCE))
    remarks = (
        () if not outside else (f"{outside} positions outside the clearance: rest position or clearance is wrong",)
    )
    return AnalysisResult(
        title=title,
        columns=columns(
            time_s=shaft_centreline.times, speed_rpm=speeds, X_um=x, Y_um=y, X_sigma_um=sigma[0], Y_sigma_um=sigma[1],
            eccentricity_ratio=shaft_centreline.eccentricity_ratio, attitude_deg=np.degrees(shaft_centreline.attitude),
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
