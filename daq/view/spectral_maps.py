"""Cascade and waterfall: order spectra over speed or time as colours, with the predicted whirl."""

import math
from collections import deque
from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from analysis.signals.header import RunHeader
from analysis.signals.snapshot import OrderFrame, Snapshot
from analysis.signals.units import MICROMETRE, RPM
from analysis.spectra.waterfall import Cascade, Waterfall
from daq.colours import CLEARANCE, LABEL, MODEL, TEXT
from daq.session.live_update import TimedMarker
from daq.view.axes import Axis, Plot
from daq.view.drawing import Anchor, Drawing, dimmed, shades
from daq.view.traces import draw_horizontal_marker
from model.prediction.prediction_map import Prediction

FloatArray = NDArray[np.float64]

HIGHEST_ORDER = 2.5
MIN_AMPLITUDE, MAX_AMPLITUDE = 0.1, 50.0  # µm peak: ends of the logarithmic colour scale
COLUMNS, ROWS = 150, 100
FONT_SIZE = 3.9
MAP_BOUNDS = ((-24.0, 172.0), (-12.0, 118.0))
_ORDERS = (np.arange(COLUMNS) + 0.5) * HIGHEST_ORDER / COLUMNS


def map_plot(y_axis: Axis) -> Plot:
    """Return the plot over orders with this y axis; one pixel of the image is one unit of the plane."""
    return Plot(
        0.0, 0.0, float(COLUMNS), float(ROWS), Axis(0.0, HIGHEST_ORDER, "order, X"), y_axis, font_size=FONT_SIZE
    )


def map_axes(plot: Plot) -> Drawing:
    """Return axes, lines at 0.5X, 1X and 2X, and the colour scale."""
    drawing = Drawing()
    plot.draw_frame(drawing, grid=False)
    for order in (0.5, 1.0, 2.0):
        drawing.line(plot.place([order, order], [plot.y.low, plot.y.high]), dimmed(CLEARANCE, 0.35), 0.25, 1.5)
    drawing.text("colour: µm peak", (float(COLUMNS), -0.8 * FONT_SIZE), FONT_SIZE, LABEL, Anchor.RIGHT)
    left, steps = COLUMNS + 4.5, 40
    for step, (red, green, blue) in enumerate(shades(np.linspace(0.0, 1.0, steps))):
        bottom = ROWS * (1.0 - step / steps)
        drawing.line([(left, bottom), (left, bottom - ROWS / steps)], (int(red), int(green), int(blue), 255), 3.0)
    for value in (0.1, 1.0, 10.0, 50.0):
        bottom = ROWS * (1.0 - math.log(value / MIN_AMPLITUDE) / math.log(MAX_AMPLITUDE / MIN_AMPLITUDE))
        drawing.text(f"{value:g}", (left + 3.5, bottom + 0.5 * FONT_SIZE), FONT_SIZE, LABEL)
    return drawing


def map_picture(orders: FloatArray, amplitudes: FloatArray) -> rr.Image:
    """Return amplitudes of shape (`ROWS`, n_orders), m peak, lowest row first, as a colour image."""
    level = np.stack([np.interp(_ORDERS, orders, row) for row in amplitudes]) / MICROMETRE
    with np.errstate(divide="ignore"):
        level = np.log(level / MIN_AMPLITUDE) / math.log(MAX_AMPLITUDE / MIN_AMPLITUDE)
    return rr.Image(np.ascontiguousarray(shades(level)[::-1]), color_model="RGB")


class CascadePlot:
    """Cascade of one run.

    The largest amplitude at each speed remains, so that a coast-down does not overwrite the run-up.

    Parameters
    ----------
    header : RunHeader
        Header with the highest speed and the orders of the spectra.
    """

    def __init__(self, header: RunHeader) -> None:
        top = header.limits.speed
        self._plot = map_plot(Axis(0.0, top / RPM, "speed, r/min"))
        self._cascade = Cascade(header.settings, top, ROWS)
        self._predicted: FloatArray = np.full(ROWS, np.nan)
        self._row_width = top / ROWS

    def add(self, snapshot: Snapshot, prediction: Prediction | None) -> None:
        """Add the spectrum of a snapshot and the predicted whirl."""
        self._cascade.add_snapshot(snapshot)
        if prediction is not None and 0.0 <= prediction.speed < ROWS * self._row_width:
            whirls = prediction.whirl_amplitude > 0.0
            self._predicted[int(prediction.speed / self._row_width)] = prediction.whirl_order if whirls else np.nan

    def axes(self) -> Drawing:
        """Return axes and colour scale."""
        return map_axes(self._plot)

    def picture(self) -> rr.Image:
        """Return the spectra as a colour image."""
        return map_picture(self._cascade.orders, self._cascade.amplitudes[_nearest(self._cascade.filled)])

    def lines(self, frame: OrderFrame | None) -> Drawing:
        """Return the predicted whirl over speed and a line at the present speed."""
        drawing = Drawing()
        speeds = self._cascade.speeds / RPM
        drawing.line(self._plot.place(self._predicted[_nearest(self._cascade.filled)], speeds), MODEL, 0.9)
        known = np.flatnonzero(np.isfinite(self._predicted))
        if known.size:
            at = self._plot.place(self._predicted[known[-1:]], speeds[known[-1:]])[0]
            drawing.text("model", (float(at[0]) + 2.0, float(at[1])), FONT_SIZE, MODEL)
        if frame is not None:
            speed = frame.speed / RPM
            drawing.line(self._plot.place([0.0, HIGHEST_ORDER], [speed, speed]), dimmed(TEXT, 0.6), 0.35)
        return drawing


def _nearest(filled: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the row shown in each row: itself, or the nearest filled one in a gap of few rows."""
    rows = np.arange(filled.size)
    known = np.flatnonzero(filled)
    if not known.size:
        return rows
    after = np.clip(np.searchsorted(known, rows), 0, known.size - 1)
    before = np.clip(after - 1, 0, known.size - 1)
    nearest = np.where(rows - known[before] <= known[after] - rows, known[before], known[after])
    between = (known[before] < rows) & (rows < known[after]) & (known[after] - known[before] <= 4)
    return np.asarray(np.where(between, nearest, rows), dtype=np.intp)


_SPAN = 60.0  # s


class WaterfallPlot:
    """Waterfall of the last minute, the newest spectrum at the top.

    Parameters
    ----------
    header : RunHeader
        Header with the orders of the spectra.
    """

    def __init__(self, header: RunHeader) -> None:
        self._plot = map_plot(Axis(-_SPAN, 0.0, "time before now, s", ticks=6))
        self._waterfall = Waterfall(header.settings, ROWS, _SPAN)
        self._predicted: deque[tuple[float, float]] = deque(maxlen=4 * ROWS)  # time in the run, s, and order

    def add(self, snapshot: Snapshot, prediction: Prediction | None, elapsed: float) -> None:
        """Add the spectrum of a snapshot and the predicted whirl at a run time, s."""
        self._waterfall.add_snapshot(snapshot)
        whirls = prediction is not None and prediction.whirl_amplitude > 0.0
        self._predicted.append((elapsed, prediction.whirl_order if prediction is not None and whirls else math.nan))

    def axes(self) -> Drawing:
        """Return axes and colour scale."""
        return map_axes(self._plot)

    def picture(self) -> rr.Image:
        """Return the spectra as a colour image."""
        return map_picture(self._waterfall.orders, self._waterfall.amplitudes)

    def lines(self, elapsed: float, markers: Sequence[TimedMarker] = ()) -> Drawing:
        """Return the predicted whirl and the markers of the last minute."""
        drawing = Drawing()
        recent = np.array([(order, time - elapsed) for time, order in self._predicted if time >= elapsed - _SPAN])
        if recent.size:
            drawing.line(self._plot.place(recent[:, 0], recent[:, 1]), MODEL, 0.9)
            if math.isfinite(recent[-1, 0]):
                at = self._plot.place(recent[-1:, 0], recent[-1:, 1])[0]
                drawing.text("model", (float(at[0]) + 2.0, float(at[1]) + 1.5 * FONT_SIZE), FONT_SIZE, MODEL)
        for marker in markers:
            if elapsed - _SPAN <= marker.elapsed <= elapsed:
                draw_horizontal_marker(drawing, self._plot, marker.elapsed - elapsed, marker)
        return drawing
