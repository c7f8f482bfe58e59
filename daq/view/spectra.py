"""Spectra in the live view: order spectrum, and cascade and waterfall as colours, with the predicted whirl."""

import math
from collections import deque
from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from analysis.signals.header import RunHeader
from analysis.signals.snapshot import OrderFrame
from analysis.signals.units import MICROMETRE, RPM
from analysis.spectra.waterfall import Cascade, Waterfall
from daq.colours import CLEARANCE, LABEL, MEASURED_X, MEASURED_Y, MODEL, TEXT, Color
from daq.session.live_update import LiveUpdate
from daq.view.drawing import MODEL_DASH, Anchor, AutoScale, Axis, Drawing, LivePlot, Plot, dimmed, text_width
from daq.view.status import micrometres
from daq.view.waveforms import draw_horizontal_marker
from model.prediction.prediction_map import Prediction

FloatArray = NDArray[np.float64]

SPECTRUM_BOUNDS = ((-34.0, 308.0), (-18.0, 214.0))
HIGHEST_ORDER = 3.0
FONT_SIZE = 7.5
_LINE = 1.4 * FONT_SIZE  # line spacing of labels

_Label: TypeAlias = tuple[float, float, str, Color]  # order and amplitude in µm, or left end and baseline; label


class SpectrumPlot(LivePlot):
    """Order spectrum plot of one run, µm peak over orders 0 to 3."""

    def __init__(self) -> None:
        self._scale = AutoScale(minimum=2.0)

    def follow(self, update: LiveUpdate) -> float:
        """Update the scale; return its end, µm."""
        sources = (update.order_frame, update.prediction)
        spectra = [np.abs(one.spectrum) for one in sources if one is not None and one.spectrum.size]
        # a fifth above the highest line is for its label
        return self._scale.follow(1.2 * max((float(s.max()) for s in spectra), default=math.nan) / MICROMETRE)

    def axes(self) -> Drawing:
        """Return axes and legend."""
        drawing = Drawing()
        self._plot().draw_frame(drawing)
        for row, (name, color) in enumerate((("x", MEASURED_X), ("y", MEASURED_Y), ("model", MODEL))):
            at = 12.0 + 12.0 * row
            drawing.text(name, (272.0, at), FONT_SIZE, color, Anchor.RIGHT)
            dash = MODEL_DASH if name == "model" else 0.0
            drawing.line([(276.0, at - 0.4 * FONT_SIZE), (296.0, at - 0.4 * FONT_SIZE)], color, 1.7, dash)
        return drawing

    def layers(self, update: LiveUpdate) -> dict[str, Drawing | rr.Image]:
        """Return the predicted and measured spectra, and the labels of 1X, 2X and components below 1X."""
        labels = Drawing()
        for left, bottom, name, color in self.placed_labels(update.order_frame, update.prediction):
            labels.text(name, (left, bottom), FONT_SIZE, color)
        return {
            "model": self._model(update.prediction),
            "measured": self._measured(update.order_frame),
            "labels": labels,
        }

    def _measured(self, frame: OrderFrame | None) -> Drawing:
        drawing = Drawing()
        if frame is not None and frame.orders.size:
            shown = frame.orders <= HIGHEST_ORDER + 1e-9
            for row, color in ((1, MEASURED_Y), (0, MEASURED_X)):
                amplitude = np.abs(frame.spectrum[row, shown]) / MICROMETRE
                drawing.line(self._plot().place(frame.orders[shown], amplitude), color, 1.7)
        return drawing

    def _model(self, prediction: Prediction | None) -> Drawing:
        drawing = Drawing()
        if prediction is not None and prediction.orders.size:
            shown = prediction.orders <= HIGHEST_ORDER + 1e-9
            for row, width, color in ((1, 1.7, dimmed(MODEL, 0.6)), (0, 2.2, MODEL)):
                amplitude = prediction.spectrum[row, shown] / MICROMETRE
                drawing.line(self._plot().place(prediction.orders[shown], amplitude), color, width, MODEL_DASH)
        return drawing

    def placed_labels(self, frame: OrderFrame | None, prediction: Prediction | None) -> list[_Label]:
        """Return left end, baseline, text and colour of the labels, moved up where they would overlap."""
        placed: list[_Label] = []
        for order, size, name, color in sorted(self._labels(frame, prediction), key=lambda one: -one[1]):
            left, bottom = (float(value) for value in self._plot().place([order], [size])[0] + (4.0, -2.0))
            right = left + text_width(name) * FONT_SIZE
            for other in sorted(placed, key=lambda one: -one[1]):  # from the lowest
                apart = right < other[0] or other[0] + text_width(other[2]) * FONT_SIZE < left
                if not apart and abs(bottom - other[1]) < _LINE:
                    bottom = other[1] - _LINE
            placed.append((left, bottom, name, color))
        return placed

    def _labels(self, frame: OrderFrame | None, prediction: Prediction | None) -> Iterator[_Label]:
        if frame is not None and frame.orders.size:
            for order, vector in ((1, frame.vectors[0]), (2, frame.vectors[1])):
                size = float(np.abs(vector).max())
                if size / MICROMETRE > 0.02 * self._scale.end:
                    yield order, size / MICROMETRE, f"{order}X {micrometres(size)}", TEXT
            for whirl in frame.whirls:
                size = float(np.abs(whirl.vectors).max()) / MICROMETRE
                yield whirl.order, size, f"{whirl.order:.2f}X {micrometres(whirl.amplitude)}", TEXT
        if prediction is not None and math.isfinite(prediction.whirl_order) and prediction.whirl_amplitude > 0.0:
            size = prediction.whirl_amplitude
            name = f"model {prediction.whirl_order:.2f}X {micrometres(size)}"
            yield prediction.whirl_order, size / MICROMETRE, name, MODEL

    def _plot(self) -> Plot:
        axes = Axis(0.0, HIGHEST_ORDER, "order, X", ticks=6), Axis(0.0, self._scale.end, "amplitude, µm peak")
        return Plot(0.0, 0.0, 300.0, 180.0, *axes, font_size=FONT_SIZE)


_SHADES = np.array(
    [(13, 16, 21), (16, 34, 62), (24, 74, 120), (44, 132, 178), (110, 200, 226), (214, 244, 248), (255, 255, 255)],
    dtype=np.float64,
)


HIGHEST_MAP_ORDER = 2.5
MIN_AMPLITUDE, MAX_AMPLITUDE = 0.1, 50.0  # µm peak: ends of the logarithmic colour scale
COLUMNS, ROWS = 150, 100
MAP_FONT_SIZE = 3.9
MAP_BOUNDS = ((-24.0, 172.0), (-12.0, 118.0))
_ORDERS = (np.arange(COLUMNS) + 0.5) * HIGHEST_MAP_ORDER / COLUMNS
_SPAN = 60.0  # s of the waterfall


def shades(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return RGB of shape ``values.shape + (3,)`` for values from 0 (background) to 1 (white), clipped."""
    stops = np.linspace(0.0, 1.0, len(_SHADES))
    clipped = np.clip(np.nan_to_num(values, nan=0.0), 0.0, 1.0)
    return np.stack([np.interp(clipped, stops, _SHADES[:, k]) for k in range(3)], axis=-1).astype(np.uint8)


def map_picture(orders: FloatArray, amplitudes: FloatArray) -> rr.Image:
    """Return amplitudes of shape (`ROWS`, n_orders), m peak, lowest row first, as a colour image."""
    level = np.stack([np.interp(_ORDERS, orders, row) for row in amplitudes]) / MICROMETRE
    with np.errstate(divide="ignore"):
        level = np.log(level / MIN_AMPLITUDE) / math.log(MAX_AMPLITUDE / MIN_AMPLITUDE)
    return rr.Image(np.ascontiguousarray(shades(level)[::-1]), color_model="RGB")


class _OrderMap(LivePlot):
    """Plot of spectra over orders as colours; one pixel of the image is one unit of the plane.

    Parameters
    ----------
    y_axis : Axis
        Axis of the speed or time.
    """

    def __init__(self, y_axis: Axis) -> None:
        orders = Axis(0.0, HIGHEST_MAP_ORDER, "order, X")
        self._plot = Plot(0.0, 0.0, float(COLUMNS), float(ROWS), orders, y_axis, font_size=MAP_FONT_SIZE)

    def axes(self) -> Drawing:
        """Return axes, lines at 0.5X, 1X and 2X, and the colour scale."""
        drawing = Drawing()
        self._plot.draw_frame(drawing, grid=False)
        for order in (0.5, 1.0, 2.0):
            drawing.line(
                self._plot.place([order, order], [self._plot.y.low, self._plot.y.high]),
                dimmed(CLEARANCE, 0.35),
                0.25,
                1.5,
            )
        drawing.text("colour: µm peak", (float(COLUMNS), -0.8 * MAP_FONT_SIZE), MAP_FONT_SIZE, LABEL, Anchor.RIGHT)
        left, steps = COLUMNS + 4.5, 40
        for step, (red, green, blue) in enumerate(shades(np.linspace(0.0, 1.0, steps))):
            bottom = ROWS * (1.0 - step / steps)
            drawing.line([(left, bottom), (left, bottom - ROWS / steps)], (int(red), int(green), int(blue), 255), 3.0)
        for value in (0.1, 1.0, 10.0, 50.0):
            bottom = ROWS * (1.0 - math.log(value / MIN_AMPLITUDE) / math.log(MAX_AMPLITUDE / MIN_AMPLITUDE))
            drawing.text(f"{value:g}", (left + 3.5, bottom + 0.5 * MAP_FONT_SIZE), MAP_FONT_SIZE, LABEL)
        return drawing

    def _label_model(self, drawing: Drawing, order: float, y: float, offset: float) -> None:
        at = self._plot.place([order], [y])[0]
        drawing.text("model", (float(at[0]) + 2.0, float(at[1]) + offset), MAP_FONT_SIZE, MODEL)


class CascadePlot(_OrderMap):
    """Cascade of one run.

    The largest amplitude at each speed remains, so that a coast-down does not overwrite the run-up.

    Parameters
    ----------
    header : RunHeader
        Header with the highest speed and the orders of the spectra.
    """

    def __init__(self, header: RunHeader) -> None:
        top = header.limits.speed
        super().__init__(Axis(0.0, top / RPM, "speed, r/min"))
        self._cascade = Cascade(header.settings, top, ROWS)
        self._predicted: FloatArray = np.full(ROWS, np.nan)
        self._row_width = top / ROWS

    def add(self, update: LiveUpdate) -> None:
        """Add the spectrum of the snapshot and the predicted whirl."""
        prediction = update.prediction
        if update.snapshot is None:
            return
        self._cascade.add_snapshot(update.snapshot)
        if prediction is not None and 0.0 <= prediction.speed < ROWS * self._row_width:
            whirls = prediction.whirl_amplitude > 0.0
            self._predicted[int(prediction.speed / self._row_width)] = prediction.whirl_order if whirls else np.nan

    def layers(self, update: LiveUpdate) -> dict[str, Drawing | rr.Image]:
        """Return the spectra as a colour image, and the predicted whirl with a line at the present speed."""
        drawing = Drawing()
        rows, speeds = _nearest(self._cascade.filled), self._cascade.speeds / RPM
        drawing.line(self._plot.place(self._predicted[rows], speeds), MODEL, 0.9)
        known = np.flatnonzero(np.isfinite(self._predicted))
        if known.size:
            self._label_model(drawing, float(self._predicted[known[-1]]), float(speeds[known[-1]]), 0.0)
        if update.order_frame is not None:
            speed = update.order_frame.speed / RPM
            drawing.line(self._plot.place([0.0, HIGHEST_MAP_ORDER], [speed, speed]), dimmed(TEXT, 0.6), 0.35)
        return {"measured": map_picture(self._cascade.orders, self._cascade.amplitudes[rows]), "model": drawing}


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


class WaterfallPlot(_OrderMap):
    """Waterfall of the last minute, the newest spectrum at the top.

    Parameters
    ----------
    header : RunHeader
        Header with the orders of the spectra.
    """

    def __init__(self, header: RunHeader) -> None:
        super().__init__(Axis(-_SPAN, 0.0, "time before now, s", ticks=6))
        self._waterfall = Waterfall(header.settings, ROWS, _SPAN)
        self._predicted: deque[tuple[float, float]] = deque(maxlen=4 * ROWS)  # time in the run, s, and order

    def add(self, update: LiveUpdate) -> None:
        """Add the spectrum of the snapshot and the predicted whirl."""
        prediction = update.prediction
        if update.snapshot is not None:
            self._waterfall.add_snapshot(update.snapshot)
            whirls = prediction is not None and prediction.whirl_amplitude > 0.0
            order = prediction.whirl_order if prediction is not None and whirls else math.nan
            self._predicted.append((update.status.elapsed, order))

    def layers(self, update: LiveUpdate) -> dict[str, Drawing | rr.Image]:
        """Return the spectra as a colour image, and the predicted whirl with the markers of the last minute."""
        drawing, elapsed = Drawing(), update.status.elapsed
        recent = np.array([(order, time - elapsed) for time, order in self._predicted if time >= elapsed - _SPAN])
        if recent.size:
            drawing.line(self._plot.place(recent[:, 0], recent[:, 1]), MODEL, 0.9)
            if math.isfinite(recent[-1, 0]):
                self._label_model(drawing, float(recent[-1, 0]), float(recent[-1, 1]), 1.5 * MAP_FONT_SIZE)
        for marker in update.status.markers:
            if elapsed - _SPAN <= marker.elapsed <= elapsed:
                draw_horizontal_marker(drawing, self._plot, marker.elapsed - elapsed, marker)
        return {"measured": map_picture(self._waterfall.orders, self._waterfall.amplitudes), "model": drawing}
