"""Order spectrum plot: measured at both probes and predicted, with labelled lines."""

import math
from collections.abc import Iterator
from typing import TypeAlias

import numpy as np

from analysis.signals.snapshot import OrderFrame
from analysis.signals.units import MICROMETRE
from daq.colours import MEASURED_X, MEASURED_Y, MODEL, TEXT, Color
from daq.view.axes import AutoScale, Axis, Plot
from daq.view.drawing import MODEL_DASH, Anchor, Drawing, dimmed
from daq.view.status_text import micrometres
from daq.view.stroke_font import text_width
from model.prediction.prediction_map import Prediction

BOUNDS = ((-34.0, 308.0), (-18.0, 214.0))
HIGHEST_ORDER = 3.0
FONT_SIZE = 7.5
_LINE = 1.4 * FONT_SIZE  # line spacing of labels

_Label: TypeAlias = tuple[float, float, str, Color]  # order, amplitude in µm, label
PlacedLabel: TypeAlias = tuple[float, float, str, Color]
"""Left end and baseline of a label in the plane, text and colour."""


class SpectrumPlot:
    """Order spectrum plot of one run, µm peak over orders 0 to 3."""

    def __init__(self) -> None:
        self._scale = AutoScale(minimum=2.0)

    def follow(self, frame: OrderFrame | None, prediction: Prediction | None) -> float:
        """Update the scale; return its end, µm, to detect changed axes."""
        spectra = [np.abs(one.spectrum) for one in (frame, prediction) if one is not None and one.spectrum.size]
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

    def measured(self, frame: OrderFrame | None) -> Drawing:
        """Return the measured spectra."""
        drawing = Drawing()
        if frame is None or not frame.orders.size:
            return drawing
        plot = self._plot()
        shown = frame.orders <= HIGHEST_ORDER + 1e-9
        for row, color in ((1, MEASURED_Y), (0, MEASURED_X)):
            amplitude = np.abs(frame.spectrum[row, shown]) / MICROMETRE
            drawing.line(plot.place(frame.orders[shown], amplitude), color, 1.7)
        return drawing

    def model(self, prediction: Prediction | None) -> Drawing:
        """Return the predicted spectra."""
        drawing = Drawing()
        if prediction is None or not prediction.orders.size:
            return drawing
        plot = self._plot()
        shown = prediction.orders <= HIGHEST_ORDER + 1e-9
        for row, share in ((1, 0.6), (0, 1.0)):
            amplitude = prediction.spectrum[row, shown] / MICROMETRE
            width = 2.2 if row == 0 else 1.7
            drawing.line(plot.place(prediction.orders[shown], amplitude), dimmed(MODEL, share), width, MODEL_DASH)
        return drawing

    def labels(self, frame: OrderFrame | None, prediction: Prediction | None) -> Drawing:
        """Return the labels of 1X, 2X and components below 1X, measured and predicted."""
        drawing = Drawing()
        for left, bottom, name, color in self.placed_labels(frame, prediction):
            drawing.text(name, (left, bottom), FONT_SIZE, color)
        return drawing

    def placed_labels(self, frame: OrderFrame | None, prediction: Prediction | None) -> list[PlacedLabel]:
        """Return the labels beside their lines, the largest first, moved up where they would overlap."""
        placed: list[PlacedLabel] = []
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
