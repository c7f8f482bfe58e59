"""Amplitude and phase lag of 1X and 2X against speed, with the prediction beside them."""

import math

import numpy as np
from numpy.typing import NDArray

from analysis.run import RunHeader
from analysis.snapshot import OrderFrame
from daq.view.axes import Axis, Plot, Reach
from daq.view.drawing import Anchor, Drawing
from daq.view.palette import MEASURED_X, MEASURED_Y, MODEL, TEXT, Color, dimmed
from model.prediction import Prediction

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

BOUNDS = ((-34.0, 316.0), (-15.0, 192.0))
_BINS = 250
_LETTERS = 7.0
_MICRO = 1e6
_TO_RPM = 30.0 / math.pi


def phase_lag(vector: ComplexArray) -> FloatArray:
    """Return the phase lag, degrees from 0 to 360, of vectors of any shape."""
    return np.asarray(np.mod(-np.degrees(np.angle(vector)), 360.0), dtype=np.float64)


class BodePlot:
    """Collects the 1X and 2X vectors by speed, the last at a speed staying, and draws them.

    Parameters
    ----------
    header : RunHeader
        Gives the highest speed.
    """

    def __init__(self, header: RunHeader) -> None:
        self._top = header.limits.speed * _TO_RPM
        self._speeds = (np.arange(_BINS) + 0.5) * self._top / _BINS
        self._measured: ComplexArray = np.full((_BINS, 2, 2), np.nan, dtype=np.complex128)
        self._predicted: ComplexArray = np.full((_BINS, 2, 2), np.nan, dtype=np.complex128)
        self._reach = Reach(smallest=2.0)
        self._compensated = False  # whether run-out is taken off, from some speed on

    def add(self, frame: OrderFrame | None, prediction: Prediction | None) -> None:
        """Take what a moment has to say of its speed."""
        for one, into in ((frame, self._measured), (prediction, self._predicted)):
            if one is not None and math.isfinite(one.speed) and 0.0 <= one.speed * _TO_RPM < self._top:
                vectors = (one.motion if isinstance(one, OrderFrame) else one.vectors) * _MICRO
                into[int(one.speed * _TO_RPM / self._top * _BINS)] = vectors
                self._reach.follow(float(np.abs(vectors).max()))
        self._compensated = self._compensated or (frame is not None and frame.runout is not None)

    def follow(self) -> tuple[float, bool]:
        """Return the end of the amplitude's scale, µm, and what the legend says, by which a changed frame is known."""
        return self._reach.end, self._compensated

    def axes(self) -> Drawing:
        """Return both frames, numbers and legend."""
        drawing = Drawing()
        amplitude, lag = self._plots()
        amplitude.draw_frame(drawing, numbers=False)
        lag.draw_frame(drawing)
        right = 296.0
        which = "compensated, 2X dim" if self._compensated else "1X bright, 2X dim"
        for name, color in (("model", MODEL), ("y", MEASURED_Y), ("x", MEASURED_X), (which, TEXT)):
            right -= drawing.text(name, (right, -0.8 * _LETTERS), _LETTERS, color, Anchor.RIGHT) + 8.0
        return drawing

    def model(self) -> Drawing:
        """Return the predicted lines."""
        return self._lines(self._predicted, (MODEL, dimmed(MODEL, 0.75)), 2.4)

    def measured(self) -> Drawing:
        """Return the measured lines."""
        return self._lines(self._measured, (MEASURED_X, MEASURED_Y), 1.7)

    def _lines(self, vectors: ComplexArray, colors: tuple[Color, Color], width: float) -> Drawing:
        drawing = Drawing()
        amplitude, lag = self._plots()
        known = np.flatnonzero(np.isfinite(vectors[:, 0, 0].real))
        gaps = np.flatnonzero(np.diff(known) > 8) + 1  # within a run-up the bins between are simply joined
        for stretch in np.split(known, gaps):
            for order, share in ((1, 0.5), (0, 1.0)):
                for probe, color in enumerate(colors):
                    vector = vectors[stretch, order, probe]
                    speeds = self._speeds[stretch]
                    shade = dimmed(color, share)
                    drawing.line(amplitude.place(speeds, np.abs(vector)), shade, width)
                    if order == 0:
                        drawing.line(lag.place(*_unfolded(speeds, phase_lag(vector))), shade, width)
        return drawing

    def _plots(self) -> tuple[Plot, Plot]:
        speed = Axis(0.0, self._top, "speed, r/min", ticks=8)
        upper = Plot(
            0.0, 0.0, 300.0, 76.0, speed, Axis(0.0, self._reach.end, "amplitude, µm peak", ticks=3), letters=_LETTERS
        )
        lower = Plot(0.0, 98.0, 300.0, 64.0, speed, Axis(0.0, 360.0, "1X phase lag, °", step=90.0), letters=_LETTERS)
        return upper, lower


def _unfolded(speeds: FloatArray, lag: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Break a line where the lag passes from 360° to 0°, so that no upright is drawn there."""
    jumps = np.flatnonzero(np.abs(np.diff(lag)) > 180.0) + 1
    return np.insert(speeds, jumps, np.nan), np.insert(lag, jumps, np.nan)
