"""Orbits and Poincaré sections at a time of the run."""

import math

import numpy as np

from analysis.shaft.orbit import Orbit, direct_orbit, filtered_orbit, orbit_without
from analysis.shaft.poincare import Pattern, PoincareSection, poincare_section
from analysis.signals.units import MICROMETRE, MILLISECOND, RPM
from daq.reports.analysis_result import AnalysisResult
from daq.reports.columns import columns
from daq.reports.errors import translated_errors
from daq.reports.kinds.prepared_record import PreparedRecord, record_before_frame
from daq.reports.parameters import OrbitFilter, OrbitQuery, PoincareQuery
from daq.reports.plots.layouts import orbit
from daq.reports.plots.panel import Curve, Panel, Style
from daq.reports.run_samples import RunSamples

AVERAGED_REVOLUTIONS = 16  # for the vectors of a filtered orbit
PATTERNS = {
    Pattern.POINT: "a point: synchronous only",
    Pattern.CLUSTERS: "clusters: subharmonic 1/{period}",
    Pattern.CURVE: "a closed curve: whirl at an irrational frequency ratio",
    Pattern.CLOUD: "a cloud: chaos, noise, or a whirl of varying amplitude",
    Pattern.UNKNOWN: "unknown: too few revolutions",
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
            found = orbit_without(
                prepared.record, orders, revolutions=query.revolutions, averaging_revolutions=AVERAGED_REVOLUTIONS
            )
            return found, f"not-{named}"


def _timebase(found: Orbit, begin: float) -> Panel:
    """Return a plot of X and Y over time with the keyphasor mark."""
    times = (found.times - begin) / MILLISECOND
    curves = [
        Curve(name, times.ravel().tolist(), (row / MICROMETRE).ravel().tolist(), colour=colour)
        for colour, (name, row) in enumerate(zip(("X", "Y"), found.motion, strict=True))
    ]
    marks = [
        Curve("", times[:, 0].tolist(), (row / MICROMETRE).tolist(), Style.KEYPHASOR) for row in found.keyphasor_points
    ]
    return Panel(
        "time base, dots: keyphasor mark", "time, ms", "displacement, µm", (*curves, *marks), y_from_zero=False
    )


def analyse_poincare(run: RunSamples, query: PoincareQuery) -> AnalysisResult:
    """Return the shaft positions at the keyphasor mark in the last revolutions before a time."""
    prepared = record_before_frame(run, query, query.revolutions)
    with translated_errors(f"run {run.header.run}"):
        found = poincare_section(prepared.record)
    points = found.points / MICROMETRE
    title = f"{run.header.run} · Poincaré section{prepared.title_suffix} · {prepared.position}"
    pattern = _pattern(found)
    scatter = found.scatter / MICROMETRE
    caption = f"{query.revolutions} turns: {pattern}; scatter {scatter:.3g} µm RMS"
    dots = Curve("", points[0].tolist(), points[1].tolist(), Style.DOTS)
    return AnalysisResult(
        title=title,
        columns=columns(
            revolution=np.arange(points.shape[1]),
            time_s=prepared.record.times[:-1],
            speed_rpm=found.speeds / RPM,
            X_um=points[0],
            Y_um=points[1],
        ),
        panels=(Panel(title, "X at the mark, µm", "Y at the mark, µm", (dots,), caption, is_square=True),),
        scalars={"period": float(found.period), "scatter_um": scatter, **prepared.scalars},
        remarks=(f"pattern of the points: {pattern}", *prepared.remarks),
    )


def _pattern(found: PoincareSection) -> str:
    return PATTERNS[found.pattern].format(period=found.period)
