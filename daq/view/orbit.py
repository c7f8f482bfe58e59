"""Orbit plot: measured and predicted, with keyphasor mark and clearance circle."""

import math

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from analysis.signals.header import RunHeader
from analysis.signals.snapshot import OrderFrame
from analysis.signals.units import MICROMETRE
from daq.colours import BACKGROUND, CLEARANCE, LABEL, MEASURED_X, MODEL, TACHO, Color
from daq.session.live_update import LiveUpdate
from daq.view.drawing import Anchor, AutoScale, Axis, Drawing, LivePlot, Plot, dimmed
from model.prediction.prediction_map import Prediction

FloatArray = NDArray[np.float64]

BOUNDS = ((-126.0, 106.0), (-113.0, 128.0))  # of the plane: x, y
_FONT_SIZE = 6.5


class OrbitPlot(LivePlot):
    """Orbit plot of one run.

    Parameters
    ----------
    header : RunHeader
        Header with the clearance and the points per revolution.
    """

    def __init__(self, header: RunHeader) -> None:
        self._clearance = header.limits.clearance / MICROMETRE
        self._points = header.settings.points_per_revolution
        self._scale = AutoScale(minimum=5.0)

    def follow(self, update: LiveUpdate) -> float:
        """Update the scale; return its end, µm."""
        orbits = [one.orbit for one in (update.order_frame, update.prediction) if one is not None and one.orbit.size]
        return self._scale.follow(
            max((float(np.hypot(*orbit).max()) for orbit in orbits), default=math.nan) / MICROMETRE
        )

    def axes(self) -> Drawing:
        """Return axes, legend, and the clearance circle, in a small inset where it exceeds the scale."""
        drawing = Drawing()
        plot = self._plot()
        plot.draw_frame(drawing)
        drawing.line(plot.place([plot.x.low, plot.x.high], [0.0, 0.0]), dimmed(CLEARANCE, 0.4), 0.6)
        drawing.line(plot.place([0.0, 0.0], [plot.y.low, plot.y.high]), dimmed(CLEARANCE, 0.4), 0.6)
        if self._shows_clearance():
            radius = 100.0 * self._clearance / self._scale.end
            drawing.circle((0.0, 0.0), radius, CLEARANCE, 1.4)
            drawing.text("clearance", (97.0, -90.0), 0.9 * _FONT_SIZE, CLEARANCE, Anchor.RIGHT)
            drawing.text(f"{self._clearance:.0f} µm", (97.0, -80.0), 0.9 * _FONT_SIZE, CLEARANCE, Anchor.RIGHT)
        else:
            centre, radius = _INSET
            drawing.dot(centre, radius, BACKGROUND)
            drawing.circle(centre, radius, CLEARANCE, 1.2)
            label = f"clearance {self._clearance:.0f} µm"
            drawing.text(
                label, (centre[0] + radius, centre[1] + radius + 9.0), 0.8 * _FONT_SIZE, CLEARANCE, Anchor.RIGHT
            )
        for row, (name, color) in enumerate((("measured", MEASURED_X), ("mark", TACHO))):
            drawing.text(name, (-97.0, -90.0 + 10.0 * row), 0.9 * _FONT_SIZE, color)
        drawing.text("model", (-97.0, 88.0), 0.9 * _FONT_SIZE, MODEL)
        return drawing

    def layers(self, update: LiveUpdate) -> dict[str, Drawing | rr.Image]:
        """Return the predicted and the measured orbit."""
        return {"model": self._model(update.prediction), "measured": self._measured(update.order_frame)}

    def _measured(self, frame: OrderFrame | None) -> Drawing:
        """Return the measured orbit: last revolution bright, previous ones dimmed, dots at the keyphasor mark.

        With compensation, the compensated orbit is drawn over a dimmed last revolution as measured.
        """
        drawing = Drawing()
        if frame is not None and frame.orbit.size:
            orbit = frame.orbit / MICROMETRE
            if frame.compensated_orbit is not None:
                self._turns(drawing, orbit[:, -self._points - 1 :], dimmed(LABEL, 0.6), 1.3)
                drawing.text("compensated", (97.0, 97.0), 0.9 * _FONT_SIZE, MEASURED_X, Anchor.RIGHT)
                drawing.text("measured", (97.0, 87.0), 0.9 * _FONT_SIZE, dimmed(LABEL, 0.6), Anchor.RIGHT)
                orbit = frame.compensated_orbit / MICROMETRE
            last = orbit.shape[1] - self._points
            self._turns(drawing, orbit[:, : last + 1], dimmed(MEASURED_X, 0.5), 1.3)
            self._turns(drawing, orbit[:, last:], MEASURED_X, 2.4)
            self._marks(drawing, orbit, 3.6)
        return drawing

    def _model(self, prediction: Prediction | None) -> Drawing:
        """Return the predicted orbit."""
        drawing, points = Drawing(), self._points
        if prediction is not None and prediction.orbit.size:
            orbit = prediction.orbit / MICROMETRE
            part = np.arange(orbit.shape[1]) % points * 2 * _DASHES // points
            for dash in np.split(np.arange(orbit.shape[1]), np.flatnonzero(np.diff(part)) + 1):
                if part[dash[0]] % 2 == 0:
                    self._turns(drawing, orbit[:, dash[0] : dash[-1] + 2], MODEL, 1.8)
            basis = "exact" if prediction.is_exact else "interpolated"
            drawing.text(basis, (-97.0, 97.0), 0.75 * _FONT_SIZE, MODEL)
            starts = self._plot().place(orbit[0, ::points], orbit[1, ::points])
            for at in starts:
                drawing.circle((float(at[0]), float(at[1])), 3.4, MODEL, 1.2)
        return drawing

    def _plot(self) -> Plot:
        end = self._scale.end
        axes = Axis(-end, end, "X, µm", ticks=4), Axis(-end, end, "Y, µm (up)", ticks=4)
        return Plot(-100.0, -100.0, 200.0, 200.0, *axes, font_size=_FONT_SIZE)

    def _shows_clearance(self) -> bool:
        return self._clearance <= self._scale.end

    def _turns(self, drawing: Drawing, orbit: FloatArray, color: Color, width: float) -> None:
        drawing.line(self._plot().place(orbit[0], orbit[1]), color, width)
        if not self._shows_clearance():
            (across, down), radius = _INSET
            small = orbit * radius / self._clearance
            drawing.line(np.stack([across + small[0], down - small[1]], axis=1), color, 0.6 * width)

    def _marks(self, drawing: Drawing, orbit: FloatArray, radius: float) -> None:
        for at in self._plot().place(orbit[0, :: self._points], orbit[1, :: self._points]):
            drawing.dot((float(at[0]), float(at[1])), radius, TACHO)


_DASHES = 16  # of the prediction per revolution, at fixed angles, so that dashes of a closed orbit coincide
_INSET = ((72.0, -72.0), 25.0)  # centre and radius in the plane
