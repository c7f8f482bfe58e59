"""The cascade: order spectra against speed as colours, the predicted whirl drawn over them."""

import math

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from analysis.signals.header import RunHeader
from analysis.signals.snapshot import OrderFrame, Snapshot
from analysis.spectra.waterfall import Cascade
from daq.view.axes import Axis
from daq.view.colour_map import HIGHEST_ORDER, LETTERS, ROWS, map_axes, map_picture, map_plot
from daq.view.drawing import Drawing
from daq.view.palette import MODEL, TEXT, dimmed
from model.prediction.prediction import Prediction

FloatArray = NDArray[np.float64]

_TO_RPM = 30.0 / math.pi


class CascadePlot:
    """Collects spectra by speed and draws them.

    The highest amplitude seen at a speed stays, so that a coast-down does not wipe out the run-up.

    Parameters
    ----------
    header : RunHeader
        Gives the highest speed and the spectra's orders.
    """

    def __init__(self, header: RunHeader) -> None:
        top = header.limits.speed
        self._plot = map_plot(Axis(0.0, top * _TO_RPM, "speed, r/min"))
        self._cascade = Cascade(header.settings, top, ROWS)
        self._predicted: FloatArray = np.full(ROWS, np.nan)
        self._row_width = top / ROWS

    def add(self, snapshot: Snapshot, prediction: Prediction | None) -> None:
        """Take what a moment has to say of its speed."""
        self._cascade.snapshot(snapshot)
        if prediction is not None and 0.0 <= prediction.speed < ROWS * self._row_width:
            whirls = prediction.whirl_amplitude > 0.0
            self._predicted[int(prediction.speed / self._row_width)] = prediction.whirl_order if whirls else np.nan

    def axes(self) -> Drawing:
        """Return frame, numbers, and the scale of the colours."""
        return map_axes(self._plot)

    def picture(self) -> rr.Image:
        """Return the colours."""
        return map_picture(self._cascade.orders, self._cascade.amplitudes[_nearest(self._cascade.filled)])

    def lines(self, frame: OrderFrame | None) -> Drawing:
        """Return the predicted whirl against speed and a line at the speed of now."""
        drawing = Drawing()
        speeds = self._cascade.speeds * _TO_RPM
        drawing.line(self._plot.place(self._predicted[_nearest(self._cascade.filled)], speeds), MODEL, 0.9)
        known = np.flatnonzero(np.isfinite(self._predicted))
        if known.size:
            at = self._plot.place(self._predicted[known[-1:]], speeds[known[-1:]])[0]
            drawing.text("model", (float(at[0]) + 2.0, float(at[1])), LETTERS, MODEL)
        if frame is not None:
            speed = frame.speed * _TO_RPM
            drawing.line(self._plot.place([0.0, HIGHEST_ORDER], [speed, speed]), dimmed(TEXT, 0.6), 0.35)
        return drawing


def _nearest(filled: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return which row is shown in each: its own, or the nearest where the shaft just ran past it."""
    rows = np.arange(filled.size)
    known = np.flatnonzero(filled)
    if not known.size:
        return rows
    after = np.clip(np.searchsorted(known, rows), 0, known.size - 1)
    before = np.clip(after - 1, 0, known.size - 1)
    nearest = np.where(rows - known[before] <= known[after] - rows, known[before], known[after])
    between = (known[before] < rows) & (rows < known[after]) & (known[after] - known[before] <= 4)
    return np.asarray(np.where(between, nearest, rows), dtype=np.intp)
