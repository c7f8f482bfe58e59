"""Panels of the recorded results of a run."""

from analysis.signals.blocks import RampDirection
from daq.reports.plots.layouts import FULL_SPECTRUM_LABEL, RampCurve, bode, orbit, polar, spectrum, stacked
from daq.reports.plots.panel import Panel, Values
from daq.schemas.results import CascadeSchema, OrderVectorsSchema, WaterfallSchema
from daq.schemas.snapshot import FullSpectrumSchema, OrbitSchema, OrderSpectrumSchema
from daq.schemas.units import Schema

PEAK_UNIT = "µm zero-to-peak"


def result_panels(result: Schema, what: str, directions: tuple[float, float]) -> list[Panel]:
    """Return a result as panels; ValueError for a schema without a plot.

    Parameters
    ----------
    result : Schema
        Result of a run.
    what : str
        Name of the plot; "polar" or "bode" for vectors over speed.
    directions : tuple of float
        Angles of probes x and y, rad from X.
    """
    match result:
        case OrderSpectrumSchema():
            rows = (("x", result.amplitude_peak_x_um), ("y", result.amplitude_peak_y_um))
            return spectrum(_title(result), "order", PEAK_UNIT, result.orders, rows)
        case FullSpectrumSchema():
            return spectrum(
                _title(result), FULL_SPECTRUM_LABEL, PEAK_UNIT, result.orders, (("", result.amplitude_peak_um),)
            )
        case OrbitSchema():
            turns = _turns(result, result.orbit_x_um, result.orbit_y_um)
            measured = orbit(_title(result), turns, directions)
            across, up = result.compensated_orbit_x_um, result.compensated_orbit_y_um
            if across is None or up is None:
                return [measured]
            less = _turns(result, across, up)
            return [orbit(_title(result), less, directions, "compensated: minus run-out"), measured]
        case OrderVectorsSchema():
            what_of, ramps = _ramp_curves(result)
            if what == "polar":
                return polar(result.run, what_of, PEAK_UNIT, ramps, directions)
            return bode(result.run, what_of, PEAK_UNIT, ramps)
        case CascadeSchema():
            return [_stacked(result, "cascade", result.speeds_rpm, "speed, r/min")]
        case WaterfallSchema():
            return [_stacked(result, "waterfall", result.times_s, "time, s")]
        case _:
            raise ValueError(f"result: {type(result).__name__}, expected a schema with a plot")


def _title(result: OrderSpectrumSchema | FullSpectrumSchema | OrbitSchema) -> str:
    frame = result.frame
    return f"{result.run} · {frame.speed_rpm or 0.0:,.0f} r/min at {frame.time_s:.1f} s"


def _turns(result: OrbitSchema, xs: Values, ys: Values) -> list[tuple[Values, Values]]:
    points = result.points_per_revolution
    return [(xs[k : k + points], ys[k : k + points]) for k in range(0, len(xs), points)]


def _ramp_curves(result: OrderVectorsSchema) -> tuple[str, list[RampCurve]]:
    """Return the name and the curves of 1X over speed, run-up and run-down separately.

    Where the run-out is known, only compensated vectors are shown.
    """
    compensated = any(row.order_1x_compensated is not None for row in result.by_speed)
    found = []
    for direction, arrow in ((RampDirection.RUN_UP, "▲"), (RampDirection.RUN_DOWN, "▼")):
        rows = [row for row in result.by_speed if row.ramp_direction is direction]
        points = [(row.speed_rpm, row.order_1x_compensated if compensated else row.order_1x) for row in rows]
        known = [(speed, line) for speed, line in points if line is not None]
        if known:
            found.append((arrow, known))
    ramps = [
        RampCurve(
            arrow if len(found) > 1 else "",
            [speed for speed, _ in known],
            ([line.amplitude_peak_x_um for _, line in known], [line.amplitude_peak_y_um for _, line in known]),
            ([line.lag_x_deg for _, line in known], [line.lag_y_deg for _, line in known]),
        )
        for arrow, known in found
    ]
    return "1X compensated" if compensated else "1X", ramps


def _stacked(result: CascadeSchema | WaterfallSchema, name: str, feet: Values, label: str) -> Panel:
    is_full = any((order or 0.0) < 0.0 for order in result.orders)
    title, across = f"{result.run} · {name}", FULL_SPECTRUM_LABEL if is_full else "order"
    return stacked(title, across, label, result.orders, feet, result.amplitude_peak_um, PEAK_UNIT)
