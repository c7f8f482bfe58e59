"""What can be drawn of a run: the same documents that REST gives as numbers."""

from daq.service.documents.course import CascadeDocument, OrderVectorsDocument
from daq.service.documents.document import Document
from daq.service.documents.moment import FullSpectrumDocument, OrbitDocument, OrderSpectrumDocument
from daq.service.drawing import Panel, Values, drawing

CASCADE_HEIGHT = 0.08  # of the speed axis, that the largest line of a cascade takes


def plot(document: Document) -> str:
    """Return a document as a drawing, SVG; ValueError where it is none that can be drawn."""
    if isinstance(document, OrderSpectrumDocument):
        curves = (
            ("x", document.orders, document.amplitude_peak_x_um),
            ("y", document.orders, document.amplitude_peak_y_um),
        )
        return drawing([Panel(_title(document), "order", "µm zero-to-peak", curves)])
    if isinstance(document, FullSpectrumDocument):
        full = (("", document.orders, document.amplitude_peak_um),)
        return drawing([Panel(_title(document), "order (negative: against the rotation)", "µm", full)])
    if isinstance(document, OrbitDocument):
        path = (("", document.orbit_x_um, document.orbit_y_um),)
        return drawing([Panel(_title(document), "X, µm", "Y, µm", path, is_square=True)])
    if isinstance(document, OrderVectorsDocument):
        return drawing(_bode(document))
    if isinstance(document, CascadeDocument):
        return drawing([_cascade(document)])
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


def _cascade(document: CascadeDocument) -> Panel:
    """Return spectra one above the other: each line's foot stands at its speed."""
    largest = max((value or 0.0 for row in document.amplitude_peak_um for value in row), default=0.0) or 1.0
    span = max((speed or 0.0 for speed in document.speeds_rpm), default=1.0)
    scale = CASCADE_HEIGHT * span / largest
    curves: list[tuple[str, Values, Values]] = [
        ("", document.orders, [(speed or 0.0) + scale * (value or 0.0) for value in row])
        for speed, row in zip(document.speeds_rpm, document.amplitude_peak_um, strict=True)
    ]
    title = f"{document.run} · cascade, largest line {largest:.1f} µm zero-to-peak"
    return Panel(title, "order", "r/min", tuple(curves))
