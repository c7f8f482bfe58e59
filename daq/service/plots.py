"""What can be drawn of a run: the same documents that REST gives as numbers."""

import math

from analysis.direction import Direction as SpeedDirection
from daq.service.documents.course import CascadeDocument, OrderVectorsDocument, WaterfallDocument
from daq.service.documents.document import Document
from daq.service.documents.moment import FullSpectrumDocument, OrbitDocument, OrderSpectrumDocument
from daq.service.documents.vibration import ProbesDocument
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
            paths: tuple[tuple[str, Values, Values], ...] = (("", document.orbit_x_um, document.orbit_y_um),)
            across, up = document.compensated_orbit_x_um, document.compensated_orbit_y_um
            if across is not None and up is not None:
                paths = (("compensated", across, up), ("", document.orbit_x_um, document.orbit_y_um))
            return [Panel(_title(document), "X, µm", "Y, µm", paths, is_square=True)]
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


def _courses(document: OrderVectorsDocument) -> tuple[str, list[tuple[str, list[tuple[float | None, ProbesDocument]]]]]:
    """Return what is drawn of 1X, and its vectors by speed, run-up and run-down apart, each with its arrow.

    Where run-out was known, what it left is drawn, and nothing of the speeds before it was.
    """
    compensated = any(row.order_1x_compensated is not None for row in document.by_speed)
    courses = []
    for course, arrow in ((SpeedDirection.UP, "▲"), (SpeedDirection.DOWN, "▼")):
        rows = [row for row in document.by_speed if row.course is course]
        points = [(row.speed_rpm, row.order_1x_compensated if compensated else row.order_1x) for row in rows]
        known = [(speed, line) for speed, line in points if line is not None]
        if known:
            courses.append((arrow, known))
    return "1X compensated" if compensated else "1X", courses


def _bode(document: OrderVectorsDocument) -> list[Panel]:
    what, courses = _courses(document)
    size: list[tuple[str, Values, Values]] = []
    lag: list[tuple[str, Values, Values]] = []
    for arrow, points in courses:
        speeds = [speed for speed, _ in points]
        for probe in ("x", "y"):
            name = f"{probe} {arrow}" if len(courses) > 1 else probe
            size.append((name, speeds, [getattr(line, f"amplitude_peak_{probe}_um") for _, line in points]))
            lag.append((name, speeds, [getattr(line, f"lag_{probe}_deg") for _, line in points]))
    return [
        Panel(f"{document.run} · {what}", "r/min", "µm zero-to-peak", tuple(size)),
        Panel(f"phase lag of {what}", "r/min", "degrees", tuple(lag)),
    ]


def _polar(document: OrderVectorsDocument) -> list[Panel]:
    """Return the vectors of 1X in the plane, for each probe: the lag goes clockwise from the right."""
    what, courses = _courses(document)
    panels = []
    for probe in ("x", "y"):
        curves: list[tuple[str, Values, Values]] = []
        notes: list[tuple[str, float, float]] = []
        for arrow, points in courses:
            known = [place for speed, line in points if (place := _place(speed, line, probe)) is not None]
            reach = max((math.hypot(across, up) for _, across, up in known), default=0.0)
            written: list[tuple[str, float, float]] = []
            for speed, across, up in known:
                if not written or math.hypot(across - written[-1][1], up - written[-1][2]) > NOTES_APART * reach:
                    written.append((f"{speed:,.0f}", across, up))
            notes += written
            name = arrow if len(courses) > 1 else ""
            curves.append((name, [across for _, across, _ in known], [up for _, _, up in known]))
        title = f"{document.run} · {what} at probe {probe} by r/min"
        label = "µm zero-to-peak; lag 0° to the right, clockwise"
        panels.append(Panel(title, label, "µm", tuple(curves), is_square=True, notes=tuple(notes)))
    return panels


def _place(speed: float | None, line: ProbesDocument, probe: str) -> tuple[float, float, float] | None:
    """Return a speed and where the vector of a probe then points; None where something is not known."""
    radius, angle = getattr(line, f"amplitude_peak_{probe}_um"), getattr(line, f"lag_{probe}_deg")
    if speed is None or radius is None or angle is None:
        return None
    return speed, radius * math.cos(math.radians(angle)), -radius * math.sin(math.radians(angle))


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
