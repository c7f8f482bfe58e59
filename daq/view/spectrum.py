"""The order spectrum, measured at both probes and predicted, with its lines named."""

import math

import numpy as np

from analysis.snapshot import OrderFrame
from daq.view.axes import Axis, Plot, Reach
from daq.view.drawing import Anchor, Drawing
from daq.view.palette import MEASURED_X, MEASURED_Y, MODEL, TEXT, dimmed
from model.prediction import Prediction

BOUNDS = ((-34.0, 308.0), (-18.0, 214.0))
HIGHEST_ORDER = 3.0
_LETTERS = 7.5
_MICRO = 1e6


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
            drawing.text(name, (296.0, 14.0 + 12.0 * row), _LETTERS, color, Anchor.RIGHT)
        return drawing

    def measured(self, frame: OrderFrame | None) -> Drawing:
        """Return the measured spectra and the names of 1X, 2X and what is below."""
        drawing = Drawing()
        if frame is None or not frame.orders.size:
            return drawing
        plot = self._plot()
        shown = frame.orders <= HIGHEST_ORDER + 1e-9
        for row, color in ((1, MEASURED_Y), (0, MEASURED_X)):
            amplitude = np.abs(frame.spectrum[row, shown]) * _MICRO
            drawing.line(plot.place(frame.orders[shown], amplitude), color, 1.7)
        for order, vector in ((1, frame.vectors[0]), (2, frame.vectors[1])):
            size = float(np.abs(vector).max()) * _MICRO
            if size > 0.02 * self._reach.end:
                self._name(drawing, float(order), size, f"{order}X {size:.3g} µm")
        for whirl in frame.whirls:
            size = float(np.abs(whirl.vectors).max()) * _MICRO
            self._name(drawing, whirl.order, size, f"{whirl.order:.2f}X {size:.3g} µm")
        return drawing

    def model(self, prediction: Prediction | None) -> Drawing:
        """Return the predicted spectra and the name of the predicted whirl."""
        drawing = Drawing()
        if prediction is None or not prediction.orders.size:
            return drawing
        plot = self._plot()
        shown = prediction.orders <= HIGHEST_ORDER + 1e-9
        for row, share in ((1, 0.6), (0, 1.0)):
            amplitude = prediction.spectrum[row, shown] * _MICRO
            drawing.line(
                plot.place(prediction.orders[shown], amplitude), dimmed(MODEL, share), 3.0 if row == 0 else 2.0
            )
        if math.isfinite(prediction.whirl_order) and prediction.whirl_amplitude > 0.0:
            size = prediction.whirl_amplitude * _MICRO
            at = plot.place([prediction.whirl_order], [size])[0]
            text = f"model {prediction.whirl_order:.2f}X {size:.3g} µm"
            drawing.text(text, (float(at[0]) + 5.0, float(at[1]) + 9.0), _LETTERS, MODEL)
        return drawing

    def _name(self, drawing: Drawing, order: float, size: float, name: str) -> None:
        at = self._plot().place([order], [size])[0]
        drawing.text(name, (float(at[0]) + 4.0, float(at[1]) - 2.0), _LETTERS, TEXT)

    def _plot(self) -> Plot:
        axes = Axis(0.0, HIGHEST_ORDER, "order, X", ticks=6), Axis(0.0, self._reach.end, "amplitude, µm peak")
        return Plot(0.0, 0.0, 300.0, 180.0, *axes, letters=_LETTERS)
