"""Orbit, waveforms of the last revolutions, and the trend of the last minutes, with markers."""

import math
from collections import deque
from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from analysis.signals.header import RunHeader
from analysis.signals.snapshot import OrderFrame
from analysis.signals.units import MICROMETRE, MILLISECOND, RPM
from daq.colours import ALARM, BACKGROUND, CLEARANCE, LABEL, MARKER, MEASURED_X, MEASURED_Y, MODEL, TACHO, TEXT, Color
from daq.session.live_update import LiveUpdate, TimedMarker
from daq.view.drawing import (
    MODEL_DASH,
    Anchor,
    AutoScale,
    Axis,
    Drawing,
    LivePlot,
    Plot,
    dimmed,
    stacked_axes,
    text_width,
)
from model.prediction.prediction_map import Prediction
from recordings.mcap.results import MarkerKind

FloatArray = NDArray[np.float64]

ORBIT_BOUNDS = ((-126.0, 106.0), (-113.0, 128.0))  # of the plane: x, y
_ORBIT_FONT_SIZE = 6.5
_INSET = ((72.0, -72.0), 25.0)  # centre and radius in the plane
_DASHES = 16  # of the prediction per revolution, at fixed angles, so that dashes of a closed orbit coincide


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
            drawing.text("clearance", (97.0, -90.0), 0.9 * _ORBIT_FONT_SIZE, CLEARANCE, Anchor.RIGHT)
            drawing.text(f"{self._clearance:.0f} µm", (97.0, -80.0), 0.9 * _ORBIT_FONT_SIZE, CLEARANCE, Anchor.RIGHT)
        else:
            centre, radius = _INSET
            drawing.dot(centre, radius, BACKGROUND)
            drawing.circle(centre, radius, CLEARANCE, 1.2)
            label = f"clearance {self._clearance:.0f} µm"
            drawing.text(
                label, (centre[0] + radius, centre[1] + radius + 9.0), 0.8 * _ORBIT_FONT_SIZE, CLEARANCE, Anchor.RIGHT
            )
        for row, (name, color) in enumerate((("measured", MEASURED_X), ("mark", TACHO))):
            drawing.text(name, (-97.0, -90.0 + 10.0 * row), 0.9 * _ORBIT_FONT_SIZE, color)
        drawing.text("model", (-97.0, 88.0), 0.9 * _ORBIT_FONT_SIZE, MODEL)
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
                drawing.text("compensated", (97.0, 97.0), 0.9 * _ORBIT_FONT_SIZE, MEASURED_X, Anchor.RIGHT)
                drawing.text("measured", (97.0, 87.0), 0.9 * _ORBIT_FONT_SIZE, dimmed(LABEL, 0.6), Anchor.RIGHT)
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
            drawing.text(basis, (-97.0, 97.0), 0.75 * _ORBIT_FONT_SIZE, MODEL)
            starts = self._plot().place(orbit[0, ::points], orbit[1, ::points])
            for at in starts:
                drawing.circle((float(at[0]), float(at[1])), 3.4, MODEL, 1.2)
        return drawing

    def _plot(self) -> Plot:
        end = self._scale.end
        axes = Axis(-end, end, "X, µm", ticks=4), Axis(-end, end, "Y, µm (up)", ticks=4)
        return Plot(-100.0, -100.0, 200.0, 200.0, *axes, font_size=_ORBIT_FONT_SIZE)

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


_COLORS = {MarkerKind.NOTE: MARKER, MarkerKind.ALARM: ALARM, MarkerKind.ACKNOWLEDGED: LABEL}
_MAX_LABEL_LENGTH = 26  # characters


def draw_vertical_marker(drawing: Drawing, plots: Sequence[Plot], at: float, marker: TimedMarker) -> None:
    """Draw a vertical marker at ``at`` of the shared x axis of plots, with its label in the first."""
    color, label = _style(marker)
    for plot in plots:
        drawing.line(plot.place([at, at], [plot.y.low, plot.y.high]), color, 0.12 * plot.font_size)
    first = plots[0]
    x, size = float(first.place(at, first.y.high)[0]), 0.85 * first.font_size
    if x - size * text_width(label) > first.left:
        drawing.text(label, (x - 0.5 * size, first.top + 1.2 * size), size, color, Anchor.RIGHT)
    else:
        drawing.text(label, (x + 0.5 * size, first.top + 1.2 * size), size, color)


def draw_horizontal_marker(drawing: Drawing, plot: Plot, at: float, marker: TimedMarker) -> None:
    """Draw a horizontal marker at ``at`` of the y axis, with its label above."""
    color, label = _style(marker)
    line = plot.place([plot.x.low, plot.x.high], [at, at])
    drawing.line(line, color, 0.12 * plot.font_size)
    place = (float(line[1, 0]) - plot.font_size, float(line[1, 1]) - 0.4 * plot.font_size)
    drawing.text(label, place, 0.85 * plot.font_size, color, Anchor.RIGHT)


def _style(marker: TimedMarker) -> tuple[Color, str]:
    text = marker.marker.text
    label = text if len(text) <= _MAX_LABEL_LENGTH else f"{text[: _MAX_LABEL_LENGTH - 3]}..."
    return _COLORS[marker.marker.kind], label


TRACE_BOUNDS = ((-34.0, 316.0), (-15.0, 192.0))
_FONT_SIZE = 7.0
_POINTS = 600  # per curve; more are not visible
_REVOLUTIONS = 6
_SPANS = (0.01, 0.015, 0.02, 0.03, 0.04, 0.06, 0.08, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0, 2.0)  # s


def min_max_decimated(values: FloatArray, points: int) -> tuple[NDArray[np.intp], FloatArray]:
    """Return indices and values of at most ``points`` samples of (n,): minimum and maximum of each block."""
    if values.size <= points:
        return np.arange(values.size), values
    stretch = math.ceil(2.0 * values.size / points)
    whole = values[: values.size // stretch * stretch].reshape(-1, stretch)
    pair = np.sort(np.stack([whole.argmin(axis=1), whole.argmax(axis=1)], axis=1), axis=1)
    index = (pair + np.arange(len(whole))[:, None] * stretch).ravel()
    return index, values[index]


class TracePlot(LivePlot):
    """Waveform plot of one run: both probes and the tacho."""

    def __init__(self) -> None:
        self._scale = AutoScale(minimum=5.0)
        self._span = _SPANS[0]
        self._volts = 5.0

    def follow(self, update: LiveUpdate) -> tuple[float, float, float]:
        """Update the scales; return their ends."""
        snapshot = update.snapshot
        if snapshot is not None and snapshot.trace.time.size > 1:
            trace = snapshot.trace
            turn = 2.0 * math.pi / snapshot.speed if snapshot.speed > 0.0 else math.inf
            wanted = min(_REVOLUTIONS * turn, float(trace.time[-1] - trace.time[0]))
            self._span = max((span for span in _SPANS if span <= 1.01 * wanted), default=_SPANS[0])
            self._scale.follow(float(np.abs(trace.displacement).max()) / MICROMETRE)
            self._volts = max(self._volts, math.ceil(float(np.abs(trace.tacho).max())))
        return self._span, self._scale.end, self._volts

    def axes(self) -> Drawing:
        """Return axes and legend."""
        return stacked_axes(*self._plots(), ("y", MEASURED_Y), ("x", MEASURED_X))

    def layers(self, update: LiveUpdate) -> dict[str, Drawing | rr.Image]:
        """Return the waveforms and the markers in the time shown."""
        drawing, snapshot = Drawing(), update.snapshot
        if snapshot is None or snapshot.trace.time.size < 2:
            return {"lines": drawing}
        trace = snapshot.trace
        upper, lower = self._plots()
        since = trace.time - trace.time[-1]
        shown = since >= -self._span
        milliseconds = since[shown] / MILLISECOND
        for row, color in ((1, MEASURED_Y), (0, MEASURED_X)):
            index, values = min_max_decimated(trace.displacement[row, shown] / MICROMETRE, _POINTS)
            drawing.line(upper.place(milliseconds[index], values), color, 1.5)
        index, values = min_max_decimated(trace.tacho[shown], _POINTS)
        drawing.line(lower.place(milliseconds[index], values), TACHO, 1.3)
        for marker in update.status.markers:
            at = marker.time - float(trace.time[-1])
            if marker.marker.segment == snapshot.segment and -self._span <= at <= 0.0:
                draw_vertical_marker(drawing, (upper, lower), at / MILLISECOND, marker)
        return {"lines": drawing}

    def _plots(self) -> tuple[Plot, Plot]:
        time = Axis(-self._span / MILLISECOND, 0.0, "time before now, ms", ticks=6)
        end = self._scale.end
        upper = Plot(0.0, 0.0, 300.0, 104.0, time, Axis(-end, end, "displacement, µm", ticks=4), font_size=_FONT_SIZE)
        volts = Axis(min(0.0, -0.1 * self._volts), 1.1 * self._volts, "tacho, V", ticks=2)
        return upper, Plot(0.0, 124.0, 300.0, 38.0, time, volts, font_size=_FONT_SIZE)


TREND_BOUNDS = ((-46.0, 316.0), (-15.0, 192.0))
_INTERVAL = 0.5  # s between two points; overall vibration is the largest between them
_TREND_SPANS = (60.0, 300.0, 1800.0)  # s: the shortest that holds the run, or the longest


class TrendPlot(LivePlot):
    """Trend of overall vibration and speed over the last minutes, up to half an hour."""

    def __init__(self) -> None:
        self._points: deque[tuple[float, ...]] = deque(maxlen=round(_TREND_SPANS[-1] / _INTERVAL))
        self._scale = AutoScale(minimum=10.0)
        self._speed_scale = AutoScale(minimum=1000.0)
        self._span = _TREND_SPANS[0]

    def add(self, update: LiveUpdate) -> None:
        """Add the values of the snapshot and the prediction."""
        snapshot, prediction, elapsed = update.snapshot, update.prediction, update.status.elapsed
        if snapshot is None:
            return
        x, y = (float(value) / MICROMETRE for value in snapshot.peak_to_peak)
        model = math.nan if prediction is None else float(prediction.peak_to_peak.max()) / MICROMETRE
        speed = snapshot.speed / RPM
        last = self._points[-1] if self._points else None
        if last is not None and elapsed < last[0] + _INTERVAL:
            self._points[-1] = (last[0], max(last[1], x), max(last[2], y), model, speed)
        else:
            self._points.append((elapsed, x, y, model, speed))

    def follow(self, update: LiveUpdate) -> tuple[float, float, float]:
        """Update the span and the scales; return their ends."""
        elapsed = update.status.elapsed
        self._span = next((span for span in _TREND_SPANS if elapsed <= span), _TREND_SPANS[-1])
        points = self._shown(elapsed)
        if len(points):
            self._scale.follow(float(np.nanmax(points[:, 1:4])))
            self._speed_scale.follow(float(np.fmax.reduce(points[:, 4])))
        return self._span, self._scale.end, self._speed_scale.end

    def axes(self) -> Drawing:
        """Return axes and legend."""
        return stacked_axes(*self._plots(), ("model, larger of both", MODEL), ("y", MEASURED_Y), ("x", MEASURED_X))

    def layers(self, update: LiveUpdate) -> dict[str, Drawing | rr.Image]:
        """Return the curves and markers."""
        drawing, elapsed = Drawing(), update.status.elapsed
        upper, lower = self._plots()
        unit = 60.0 if self._span > _TREND_SPANS[0] else 1.0
        points = self._shown(elapsed)
        since = (points[:, 0] - elapsed) / unit
        for plot, column, color, dash in (
            (upper, 3, MODEL, MODEL_DASH),
            (upper, 2, MEASURED_Y, 0.0),
            (upper, 1, MEASURED_X, 0.0),
            (lower, 4, TEXT, 0.0),
        ):
            index, values = min_max_decimated(points[:, column], _POINTS)
            drawing.line(plot.place(since[index], values), color, 1.5, dash)
        for marker in update.status.markers:
            if elapsed - self._span <= marker.elapsed <= elapsed:
                draw_vertical_marker(drawing, (upper, lower), (marker.elapsed - elapsed) / unit, marker)
        return {"lines": drawing}

    def _shown(self, elapsed: float) -> FloatArray:
        """Return the points in the time shown, shape (n, 5)."""
        start = elapsed - self._span
        return np.array([point for point in self._points if point[0] >= start]).reshape(-1, 5)

    def _plots(self) -> tuple[Plot, Plot]:
        in_minutes = self._span > _TREND_SPANS[0]
        length = self._span / 60.0 if in_minutes else self._span
        time = Axis(-length, 0.0, f"time before now, {'min' if in_minutes else 's'}", ticks=6)
        overall = Axis(0.0, self._scale.end, "overall, µm peak-to-peak", ticks=4)
        speed = Axis(0.0, self._speed_scale.end, "speed, r/min", ticks=3)
        upper = Plot(0.0, 0.0, 300.0, 90.0, time, overall, font_size=_FONT_SIZE)
        return upper, Plot(0.0, 110.0, 300.0, 52.0, time, speed, font_size=_FONT_SIZE)
