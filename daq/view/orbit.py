"""The orbit: measured and predicted on the same axes, with the mark, inside the circle in which the shaft can move."""

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import RunHeader
from analysis.signals.snapshot import OrderFrame
from daq.view.axes import Axis, Plot, Reach
from daq.view.drawing import Anchor, Drawing
from daq.view.palette import CLEARANCE, MEASURED_X, MODEL, PAPER, QUIET, TACHO, Color, dimmed
from model.prediction.prediction_map import Prediction

FloatArray = NDArray[np.float64]

BOUNDS = ((-126.0, 106.0), (-113.0, 128.0))  # of the plane: x, y
_LETTERS = 6.5
_MICRO = 1e6


class OrbitPlot:
    """Draws orbits of one run.

    Parameters
    ----------
    header : RunHeader
        Gives the clearance and the points in a revolution.
    """

    def __init__(self, header: RunHeader) -> None:
        self._clearance = header.limits.clearance * _MICRO
        self._points = header.settings.points_per_revolution
        self._reach = Reach(smallest=5.0)

    def follow(self, frame: OrderFrame | None, prediction: Prediction | None) -> float:
        """Choose the scale for what is drawn next; returns its end, µm, by which a changed frame is known."""
        orbits = [one.orbit for one in (frame, prediction) if one is not None and one.orbit.size]
        if not orbits:
            return self._reach.end
        return self._reach.follow(max(float(np.hypot(*orbit).max()) * _MICRO for orbit in orbits))

    def axes(self) -> Drawing:
        """Return the frame: axes in µm, the clearance circle or, where that is off the scale, a small picture of it."""
        drawing = Drawing()
        plot = self._plot()
        plot.draw_frame(drawing)
        drawing.line(plot.place([plot.x.low, plot.x.high], [0.0, 0.0]), dimmed(CLEARANCE, 0.4), 0.6)
        drawing.line(plot.place([0.0, 0.0], [plot.y.low, plot.y.high]), dimmed(CLEARANCE, 0.4), 0.6)
        if self._shows_clearance():
            radius = 100.0 * self._clearance / self._reach.end
            drawing.circle((0.0, 0.0), radius, CLEARANCE, 1.4)
            drawing.text("clearance", (97.0, -90.0), 0.9 * _LETTERS, CLEARANCE, Anchor.RIGHT)
            drawing.text(f"{self._clearance:.0f} µm", (97.0, -80.0), 0.9 * _LETTERS, CLEARANCE, Anchor.RIGHT)
        else:
            centre, radius = _INSET
            drawing.dot(centre, radius, PAPER)
            drawing.circle(centre, radius, CLEARANCE, 1.2)
            label = f"clearance {self._clearance:.0f} µm"
            drawing.text(label, (centre[0] + radius, centre[1] + radius + 9.0), 0.8 * _LETTERS, CLEARANCE, Anchor.RIGHT)
        for row, (name, color) in enumerate((("measured", MEASURED_X), ("mark", TACHO))):
            drawing.text(name, (-97.0, -90.0 + 10.0 * row), 0.9 * _LETTERS, color)
        drawing.text("model", (-97.0, 88.0), 0.9 * _LETTERS, MODEL)
        return drawing

    def measured(self, frame: OrderFrame | None) -> Drawing:
        """Return the measured orbit: the last revolution bright, those before dimmed, a dot where the mark passes.

        Where run-out is taken off, that orbit is drawn so, and the last revolution as measured dimly beneath it.
        """
        drawing = Drawing()
        if frame is not None and frame.orbit.size:
            orbit = frame.orbit * _MICRO
            if frame.compensated_orbit is not None:
                self._turns(drawing, orbit[:, -self._points - 1 :], dimmed(QUIET, 0.6), 1.3)
                drawing.text("compensated", (97.0, 97.0), 0.9 * _LETTERS, MEASURED_X, Anchor.RIGHT)
                drawing.text("measured", (97.0, 87.0), 0.9 * _LETTERS, dimmed(QUIET, 0.6), Anchor.RIGHT)
                orbit = frame.compensated_orbit * _MICRO
            last = orbit.shape[1] - self._points
            self._turns(drawing, orbit[:, : last + 1], dimmed(MEASURED_X, 0.5), 1.3)
            self._turns(drawing, orbit[:, last:], MEASURED_X, 2.4)
            self._marks(drawing, orbit, 3.6)
        return drawing

    def model(self, prediction: Prediction | None, points: int) -> Drawing:
        """Return the predicted orbit; it has ``points`` points in a revolution."""
        drawing = Drawing()
        if prediction is not None and prediction.orbit.size:
            orbit = prediction.orbit * _MICRO
            part = np.arange(orbit.shape[1]) % points * 2 * _DASHES // points
            for dash in np.split(np.arange(orbit.shape[1]), np.flatnonzero(np.diff(part)) + 1):
                if part[dash[0]] % 2 == 0:
                    self._turns(drawing, orbit[:, dash[0] : dash[-1] + 2], MODEL, 1.8)
            basis = "exact" if prediction.is_exact else "interpolated"
            drawing.text(basis, (-97.0, 97.0), 0.75 * _LETTERS, MODEL)
            starts = self._plot().place(orbit[0, ::points], orbit[1, ::points])
            for at in starts:
                drawing.circle((float(at[0]), float(at[1])), 3.4, MODEL, 1.2)
        return drawing

    def _plot(self) -> Plot:
        end = self._reach.end
        axes = Axis(-end, end, "X, µm", ticks=4), Axis(-end, end, "Y, µm (up)", ticks=4)
        return Plot(-100.0, -100.0, 200.0, 200.0, *axes, letters=_LETTERS)

    def _shows_clearance(self) -> bool:
        return self._clearance <= self._reach.end

    def _turns(self, drawing: Drawing, orbit: FloatArray, color: Color, width: float) -> None:
        drawing.line(self._plot().place(orbit[0], orbit[1]), color, width)
        if not self._shows_clearance():
            (across, down), radius = _INSET
            small = orbit * radius / self._clearance
            drawing.line(np.stack([across + small[0], down - small[1]], axis=1), color, 0.6 * width)

    def _marks(self, drawing: Drawing, orbit: FloatArray, radius: float) -> None:
        for at in self._plot().place(orbit[0, :: self._points], orbit[1, :: self._points]):
            drawing.dot((float(at[0]), float(at[1])), radius, TACHO)


_DASHES = 16  # of the model in a turn, at the same angles in each, so that those of a closed orbit lie on one another
_INSET = ((72.0, -72.0), 25.0)  # centre and radius in the plane
