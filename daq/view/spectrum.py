"""The order spectrum, measured at both probes and predicted, with its lines named."""

import math
from collections.abc import Iterator
from typing import TypeAlias

import numpy as np

from analysis.signals.snapshot import OrderFrame
from daq.view.axes import Axis, Plot, Reach
from daq.view.drawing import Anchor, Drawing, text_width
from daq.view.palette import MEASURED_X, MEASURED_Y, MODEL, MODEL_DASH, TEXT, Color, dimmed
from daq.view.status_text import micrometres
from model.prediction.prediction_map import Prediction

BOUNDS = ((-34.0, 308.0), (-18.0, 214.0))
HIGHEST_ORDER = 3.0
LETTERS = 7.5
_LINE = 1.4 * LETTERS  # from one name to the next above it
_MICRO = 1e6

_Named: TypeAlias = tuple[float, float, str, Color]  # order, size in µm, name
PlacedName: TypeAlias = tuple[float, float, str, Color]
"""Left end and foot of a name in the plane, its letters and colour."""


class SpectrumPlot:
    """Draws order spectra of one run, µm peak over orders 0 to 3."""

    def __init__(self) -> None:
        self._reach = Reach(smallest=2.0)

    def follow(self, frame: OrderFrame | None, prediction: Prediction | None) -> float:
        """Choose the scale for what is drawn next; returns its end, µm, by which a changed frame is known."""
        spectra = [np.abs(one.spectrum) for one in (frame, prediction) if one is not None and one.spectrum.size]
        # a fifth is left above the highest line for its name
        return self._reach.follow(1.2 * _MICRO * max((float(s.max()) for s in spectra), default=math.nan))

    def axes(self) -> Drawing:
        """Return frame, numbers and legend."""
        drawing = Drawing()
        self._plot().draw_frame(drawing)
        for row, (name, color) in enumerate((("x", MEASURED_X), ("y", MEASURED_Y), ("model", MODEL))):
            at = 12.0 + 12.0 * row
            drawing.text(name, (272.0, at), LETTERS, color, Anchor.RIGHT)
            dash = MODEL_DASH if name == "model" else 0.0
            drawing.line([(276.0, at - 0.4 * LETTERS), (296.0, at - 0.4 * LETTERS)], color, 1.7, dash)
        return drawing

    def measured(self, frame: OrderFrame | None) -> Drawing:
        """Return the measured spectra."""
        drawing = Drawing()
        if frame is None or not frame.orders.size:
            return drawing
        plot = self._plot()
        shown = frame.orders <= HIGHEST_ORDER + 1e-9
        for row, color in ((1, MEASURED_Y), (0, MEASURED_X)):
            amplitude = np.abs(frame.spectrum[row, shown]) * _MICRO
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
            amplitude = prediction.spectrum[row, shown] * _MICRO
            width = 2.2 if row == 0 else 1.7
            drawing.line(plot.place(prediction.orders[shown], amplitude), dimmed(MODEL, share), width, MODEL_DASH)
        return drawing

    def names(self, frame: OrderFrame | None, prediction: Prediction | None) -> Drawing:
        """Return the names of 1X, 2X and what is below, measured and predicted."""
        drawing = Drawing()
        for left, bottom, name, color in self.placed_names(frame, prediction):
            drawing.text(name, (left, bottom), LETTERS, color)
        return drawing

    def placed_names(self, frame: OrderFrame | None, prediction: Prediction | None) -> list[PlacedName]:
        """Return where each name stands: beside its line, the largest first, and above any that is there already."""
        placed: list[PlacedName] = []
        for order, size, name, color in sorted(self._named(frame, prediction), key=lambda one: -one[1]):
            left, bottom = (float(value) for value in self._plot().place([order], [size])[0] + (4.0, -2.0))
            right = left + text_width(name) * LETTERS
            for other in sorted(placed, key=lambda one: -one[1]):  # from below
                apart = right < other[0] or other[0] + text_width(other[2]) * LETTERS < left
                if not apart and abs(bottom - other[1]) < _LINE:
                    bottom = other[1] - _LINE
            placed.append((left, bottom, name, color))
        return placed

    def _named(self, frame: OrderFrame | None, prediction: Prediction | None) -> Iterator[_Named]:
        if frame is not None and frame.orders.size:
            for order, vector in ((1, frame.vectors[0]), (2, frame.vectors[1])):
                size = float(np.abs(vector).max())
                if size * _MICRO > 0.02 * self._reach.end:
                    yield order, size * _MICRO, f"{order}X {micrometres(size)}", TEXT
            for whirl in frame.whirls:
                size = float(np.abs(whirl.vectors).max()) * _MICRO
                yield whirl.order, size, f"{whirl.order:.2f}X {micrometres(whirl.amplitude)}", TEXT
        if prediction is not None and math.isfinite(prediction.whirl_order) and prediction.whirl_amplitude > 0.0:
            size = prediction.whirl_amplitude
            name = f"model {prediction.whirl_order:.2f}X {micrometres(size)}"
            yield prediction.whirl_order, size * _MICRO, name, MODEL

    def _plot(self) -> Plot:
        axes = Axis(0.0, HIGHEST_ORDER, "order, X", ticks=6), Axis(0.0, self._reach.end, "amplitude, µm peak")
        return Plot(0.0, 0.0, 300.0, 180.0, *axes, letters=LETTERS)
