"""What can be drawn of a run: the same documents that REST gives as numbers."""

import math

from daq.service.documents.course import CascadeDocument, OrderVectorsDocument, WaterfallDocument
from daq.service.documents.document import Document
from daq.service.documents.moment import FullSpectrumDocument, OrbitDocument, OrderSpectrumDocument
from daq.service.drawing import Panel, Values

BOTH_WAYS = "order (negative: against the rotation)"
NOTES_APART = 0.15  # of the largest vector: from one speed to the next that is written at a polar plot
LINES = 40  # of a cascade, at most
LINE_HEIGHT = 0.12  # of the axis that the feet stand at, that the largest line of a cascade takes


def panels_of(document: Document, what: str) -> list[Panel]:
    """Return a document as panels of a drawing; ValueError where it is none that can be drawn.

    Parameters
    ----------
    document : Document
        What an address answers.
    what : str
        Name of the plot, which tells how vectors over speed are shown: "bode" or "polar".
    """
    match document:
        case OrderSpectrumDocument():
            x, y = document.amplitude_peak_x_um, document.amplitude_peak_y_um
            curves = (("x", document.orders, x), ("y", document.orders, y))
            return [Panel(_title(document), "order", "µm zero-to-peak", curves)]
        case FullSpectrumDocument():
            full = (("", document.orders, document.amplitude_peak_um),)
            return [Panel(_title(document), BOTH_WAYS, "µm", full)]
        case OrbitDocument():
            path = (("", document.orbit_x_um, document.orbit_y_um),)
            return [Panel(_title(document), "X, µm", "Y, µm", path, is_square=True)]
        case OrderVectorsDocument():
            return _polar(document) if what == "polar" else _bode(document)
        case CascadeDocument():
            return [_stacked(document, "cascade", document.speeds_rpm, "r/min")]
        case WaterfallDocument():
            return [_stacked(document, "waterfall", document.times_s, "s")]
        case _:
            raise ValueError(f"document: {type(document).__name__}, expected one that can be drawn")


def _title(document: OrderSpectrumDocument | FullSpectrumDocument | OrbitDocument) -> str:
    frame = document.frame
    return f"{document.run} · {frame.speed_rpm or 0.0:,.0f} r/min at {frame.time_s:.1f} s"


def _bode(document: OrderVectorsDocument) -> list[Panel]:
    rows = document.by_speed
    speeds = [row.speed_rpm for row in rows]
    size = (
        ("x", speeds, [row.order_1x.amplitude_peak_x_um for row in rows]),
        ("y", speeds, [row.order_1x.amplitude_peak_y_um for row in rows]),
    )
    lag = (
        ("x", speeds, [row.order_1x.lag_x_deg for row in rows]),
        ("y", speeds, [row.order_1x.lag_y_deg for row in rows]),
    )
    return [
        Panel(f"{document.run} · 1X", "r/min", "µm zero-to-peak", size),
        Panel("phase lag of 1X", "r/min", "degrees", lag),
    ]


def _polar(document: OrderVectorsDocument) -> list[Panel]:
    """Return the vectors of 1X in the plane, for each probe: the lag goes clockwise from the right."""
    panels = []
    for probe in ("x", "y"):
        points = [
            (
                row.speed_rpm,
                getattr(row.order_1x, f"amplitude_peak_{probe}_um"),
                getattr(row.order_1x, f"lag_{probe}_deg"),
            )
            for row in document.by_speed
        ]
        known = [
            (speed, radius * math.cos(math.radians(angle)), -radius * math.sin(math.radians(angle)))
            for speed, radius, angle in points
            if None not in (speed, radius, angle)
        ]
        reach = max((math.hypot(across, up) for _, across, up in known), default=0.0)
        notes: list[tuple[str, float, float]] = []
        for speed, across, up in known:
            if not notes or math.hypot(across - notes[-1][1], up - notes[-1][2]) > NOTES_APART * reach:
                notes.append((f"{speed:,.0f}", across, up))
        curve = (("", [across for _, across, _ in known], [up for _, _, up in known]),)
        title = f"{document.run} · 1X at probe {probe} by r/min"
        label = "µm zero-to-peak; lag 0° to the right, clockwise"
        panels.append(Panel(title, label, "µm", curve, is_square=True, notes=tuple(notes)))
    return panels


def _stacked(document: CascadeDocument | WaterfallDocument, name: str, feet: Values, label: str) -> Panel:
    """Return spectra one above the other: each line's foot stands at its speed or time."""
    together = -(-len(feet) // LINES)  # rows of which a line shows the largest
    rows = [document.amplitude_peak_um[k : k + together] for k in range(0, len(feet), together)]
    lines = [tuple(max(value or 0.0 for value in cell) for cell in zip(*group, strict=True)) for group in rows]
    stands = [foot or 0.0 for foot in feet[::together]]
    largest = max(map(max, lines), default=0.0) or 1.0
    scale = LINE_HEIGHT * ((max(stands) - min(stands)) or max(stands) or 1.0) / largest
    curves: list[tuple[str, Values, Values]] = [
        ("", document.orders, [foot + scale * value for value in line])
        for foot, line in zip(stands, lines, strict=True)
    ]
    title = f"{document.run} · {name}, largest line {largest:.1f} µm zero-to-peak"
    is_full = any((order or 0.0) < 0.0 for order in document.orders)
    return Panel(title, BOTH_WAYS if is_full else "order", label, tuple(curves), y_from_zero=False, is_stacked=True)
