"""What can be drawn of a run: the same documents that REST gives as numbers."""

from analysis.signals.ramp import RampDirection
from daq.reports.plots.layouts import FULL_SPECTRUM_LABEL, RampCurve, bode, orbit, polar, spectrum, stacked
from daq.reports.plots.panel import Panel, Values
from daq.schemas.results import CascadeSchema, OrderVectorsSchema, WaterfallSchema
from daq.schemas.snapshot import FullSpectrumSchema, OrbitSchema, OrderSpectrumSchema
from daq.schemas.units import Schema

PEAK = "µm zero-to-peak"


def result_panels(document: Schema, what: str, directions: tuple[float, float]) -> list[Panel]:
    """Return a document as panels of a drawing; ValueError where it is none that can be drawn.

    Parameters
    ----------
    document : Document
        What an address answers.
    what : str
        Name of the plot, which tells how vectors over speed are shown: "bode" or "polar".
    directions : tuple of float
        Where the probes x and y sit, rad from X.
    """
    match document:
        case OrderSpectrumSchema():
            rows = (("x", document.amplitude_peak_x_um), ("y", document.amplitude_peak_y_um))
            return spectrum(_title(document), "order", PEAK, document.orders, rows)
        case FullSpectrumSchema():
            return spectrum(
                _title(document), FULL_SPECTRUM_LABEL, PEAK, document.orders, (("", document.amplitude_peak_um),)
            )
        case OrbitSchema():
            turns = _turns(document, document.orbit_x_um, document.orbit_y_um)
            measured = orbit(_title(document), turns, directions)
            across, up = document.compensated_orbit_x_um, document.compensated_orbit_y_um
            if across is None or up is None:
                return [measured]
            less = _turns(document, across, up)
            return [orbit(_title(document), less, directions, "compensated: less run-out"), measured]
        case OrderVectorsSchema():
            what_of, ramps = _ramp_curves(document)
            if what == "polar":
                return polar(document.run, what_of, PEAK, ramps, directions)
            return bode(document.run, what_of, PEAK, ramps)
        case CascadeSchema():
            return [_stacked(document, "cascade", document.speeds_rpm, "r/min")]
        case WaterfallSchema():
            return [_stacked(document, "waterfall", document.times_s, "s")]
        case _:
            raise ValueError(f"document: {type(document).__name__}, expected one that can be drawn")


def _title(document: OrderSpectrumSchema | FullSpectrumSchema | OrbitSchema) -> str:
    frame = document.frame
    return f"{document.run} · {frame.speed_rpm or 0.0:,.0f} r/min at {frame.time_s:.1f} s"


def _turns(document: OrbitSchema, xs: Values, ys: Values) -> list[tuple[Values, Values]]:
    points = document.points_per_revolution
    return [(xs[k : k + points], ys[k : k + points]) for k in range(0, len(xs), points)]


def _ramp_curves(document: OrderVectorsSchema) -> tuple[str, list[RampCurve]]:
    """Return what is drawn of 1X, and its vectors by speed, run-up and run-down apart, each with its arrow.

    Where run-out was known, what it left is drawn, and nothing of the speeds before it was.
    """
    compensated = any(row.order_1x_compensated is not None for row in document.by_speed)
    ways = []
    for way, arrow in ((RampDirection.RUN_UP, "▲"), (RampDirection.RUN_DOWN, "▼")):
        rows = [row for row in document.by_speed if row.ramp_direction is way]
        points = [(row.speed_rpm, row.order_1x_compensated if compensated else row.order_1x) for row in rows]
        known = [(speed, line) for speed, line in points if line is not None]
        if known:
            ways.append((arrow, known))
    ramps = [
        RampCurve(
            arrow if len(ways) > 1 else "",
            [speed for speed, _ in known],
            ([line.amplitude_peak_x_um for _, line in known], [line.amplitude_peak_y_um for _, line in known]),
            ([line.lag_x_deg for _, line in known], [line.lag_y_deg for _, line in known]),
        )
        for arrow, known in ways
    ]
    return "1X compensated" if compensated else "1X", ramps


def _stacked(document: CascadeSchema | WaterfallSchema, name: str, feet: Values, label: str) -> Panel:
    is_full = any((order or 0.0) < 0.0 for order in document.orders)
    title, across = f"{document.run} · {name}", FULL_SPECTRUM_LABEL if is_full else "order"
    return stacked(title, across, label, document.orders, feet, document.amplitude_peak_um, PEAK)
