"""The cascade: order spectra against speed as colours, the predicted whirl drawn over them."""

import math

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from analysis.run import RunHeader
from analysis.snapshot import OrderFrame, Snapshot
from daq.view.axes import Axis, Plot
from daq.view.drawing import Anchor, Drawing
from daq.view.palette import CLEARANCE, MODEL, QUIET, TEXT, dimmed, shades
from model.prediction import Prediction

FloatArray = NDArray[np.float64]

HIGHEST_ORDER = 2.5
FAINTEST, BRIGHTEST = 0.1, 50.0  # µm peak: the ends of the colours, which are logarithmic
_COLUMNS, _ROWS = 150, 100
_LETTERS = 3.9
_MICRO = 1e6
_TO_RPM = 30.0 / math.pi
BOUNDS = ((-24.0, 172.0), (-12.0, 118.0))


class CascadePlot:
    """Collects spectra by speed and draws them.

    The highest amplitude seen at a speed stays, so that a coast-down does not wipe out the run-up.

    Parameters
    ----------
    header : RunHeader
        Gives the highest speed.
    """

    def __init__(self, header: RunHeader) -> None:
        top = header.limits.speed * _TO_RPM
        axes = Axis(0.0, HIGHEST_ORDER, "order, X", ticks=5), Axis(0.0, top, "speed, r/min", ticks=5)
        self._plot = Plot(0.0, 0.0, float(_COLUMNS), float(_ROWS), *axes, letters=_LETTERS)
        self._orders = (np.arange(_COLUMNS) + 0.5) * HIGHEST_ORDER / _COLUMNS
        self._levels = np.zeros((_ROWS, _COLUMNS))  # µm peak, lowest speed first
        self._predicted: FloatArray = np.full(_ROWS, np.nan)
        self._last_row: int | None = None

    def add(self, snapshot: Snapshot, prediction: Prediction | None) -> None:
        """Take what a moment has to say of its speed."""
        if prediction is not None and (row := self._row(prediction.speed)) is not None:
            self._predicted[row] = prediction.whirl_order if prediction.whirl_amplitude > 0.0 else np.nan
        frame = snapshot.frame
        if frame is None or not frame.orders.size or (row := self._row(frame.speed)) is None:
            self._last_row = None
            return
        level = np.interp(self._orders, frame.orders, np.abs(frame.spectrum).max(axis=0) * _MICRO)
        first, last = sorted((row, row if self._last_row is None else self._last_row))
        if last - first > 3:  # a jump, not a fast run-up: nothing is known of the speeds between
            first = last = row
        np.maximum(self._levels[first : last + 1], level, out=self._levels[first : last + 1])
        self._last_row = row

    def axes(self) -> Drawing:
        """Return frame, numbers, and the scale of the colours."""
        drawing = Drawing()
        self._plot.draw_frame(drawing, grid=False)
        for order in (0.5, 1.0, 2.0):
            drawing.dashes(
                self._plot.place([order, order], [0.0, self._plot.y.high]), dimmed(CLEARANCE, 0.35), 0.25, 1.5
            )
        drawing.text("colour: µm peak", (float(_COLUMNS), -0.8 * _LETTERS), _LETTERS, QUIET, Anchor.RIGHT)
        left, steps = _COLUMNS + 3.0, 40
        colors = shades(np.linspace(0.0, 1.0, steps))
        for step, (red, green, blue) in enumerate(colors):
            bottom = _ROWS * (1.0 - step / steps)
            x = left + 1.5
            drawing.line([(x, bottom), (x, bottom - _ROWS / steps)], (int(red), int(green), int(blue), 255), 3.0)
        for value in (0.1, 1.0, 10.0, 50.0):
            bottom = _ROWS * (1.0 - math.log(value / FAINTEST) / math.log(BRIGHTEST / FAINTEST))
            drawing.text(f"{value:g}", (left + 5.0, bottom + 0.5 * _LETTERS), _LETTERS, QUIET)
        return drawing

    def picture(self) -> rr.Image:
        """Return the colours; one dot of the picture is one unit of the plane."""
        with np.errstate(divide="ignore"):
            level = np.log(self._levels / FAINTEST) / math.log(BRIGHTEST / FAINTEST)
        return rr.Image(np.ascontiguousarray(shades(level)[::-1]), color_model="RGB")

    def lines(self, frame: OrderFrame | None) -> Drawing:
        """Return the predicted whirl against speed and a line at the speed of now."""
        drawing = Drawing()
        top = self._plot.y.high
        speeds = (np.arange(_ROWS) + 0.5) / _ROWS * top
        drawing.line(self._plot.place(self._predicted, speeds), MODEL, 0.9)
        known = np.flatnonzero(np.isfinite(self._predicted))
        if known.size:
            at = self._plot.place(self._predicted[known[-1:]], speeds[known[-1:]])[0]
            drawing.text("model", (float(at[0]) + 2.0, float(at[1])), _LETTERS, MODEL)
        if frame is not None:
            speed = frame.speed * _TO_RPM
            drawing.line(self._plot.place([0.0, HIGHEST_ORDER], [speed, speed]), dimmed(TEXT, 0.6), 0.35)
        return drawing

    def _row(self, speed: float) -> int | None:
        if not math.isfinite(speed):
            return None
        row = int(speed * _TO_RPM / self._plot.y.high * _ROWS)
        return row if 0 <= row < _ROWS else None
