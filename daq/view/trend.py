"""Overall vibration and speed over the last minutes, with what was marked."""

import math
from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.signals.snapshot import Snapshot
from daq.session.live_update import PlacedMark
from daq.view.axes import Axis, Plot, Reach
from daq.view.drawing import Anchor, Drawing
from daq.view.flags import draw_upright
from daq.view.palette import MEASURED_X, MEASURED_Y, MODEL, MODEL_DASH, TEXT
from daq.view.traces import thinned
from model.prediction.prediction import Prediction

FloatArray = NDArray[np.float64]

BOUNDS = ((-46.0, 316.0), (-15.0, 192.0))
_LETTERS = 7.0
_MICRO = 1e6
_TO_RPM = 30.0 / math.pi
_POINTS = 600  # a line of more is not seen
_INTERVAL = 0.5  # s between two points; overall vibration is the largest between them
_SPANS = (60.0, 300.0, 1800.0)  # s: the shortest that holds the run, or the longest


class TrendPlot:
    """Collects what a run's results come to and draws the last minutes, half an hour at most."""

    def __init__(self) -> None:
        self._points: deque[tuple[float, ...]] = deque(maxlen=round(_SPANS[-1] / _INTERVAL))
        self._reach = Reach(smallest=10.0)
        self._speed_reach = Reach(smallest=1000.0)

    def add(self, snapshot: Snapshot, prediction: Prediction | None, elapsed: float) -> None:
        """Take what there is to say at a time ``elapsed``, s, of the run."""
        x, y = (float(value) * _MICRO for value in snapshot.peak_to_peak)
        model = math.nan if prediction is None else float(prediction.peak_to_peak.max()) * _MICRO
        speed = snapshot.speed * _TO_RPM
        last = self._points[-1] if self._points else None
        if last is not None and elapsed < last[0] + _INTERVAL:
            self._points[-1] = (last[0], max(last[1], x), max(last[2], y), model, speed)
        else:
            self._points.append((elapsed, x, y, model, speed))

    def follow(self, elapsed: float) -> tuple[float, float, float]:
        """Choose the scales for a time of the run, s; returns their ends, by which a changed frame is known."""
        points = self._shown(elapsed)
        if len(points):
            self._reach.follow(float(np.nanmax(points[:, 1:4])))
            self._speed_reach.follow(float(np.fmax.reduce(points[:, 4])))
        return self._span(elapsed), self._reach.end, self._speed_reach.end

    def axes(self, elapsed: float) -> Drawing:
        """Return both frames, numbers and legend."""
        drawing = Drawing()
        upper, lower = self._plots(elapsed)
        upper.draw_frame(drawing, numbers=False)
        lower.draw_frame(drawing)
        right = 296.0
        for name, color in (("model, larger of both", MODEL), ("y", MEASURED_Y), ("x", MEASURED_X)):
            right -= drawing.text(name, (right, -0.8 * _LETTERS), _LETTERS, color, Anchor.RIGHT) + 8.0
        return drawing

    def lines(self, elapsed: float, marks: Sequence[PlacedMark]) -> Drawing:
        """Return the lines up to a time of the run, s, and its marks."""
        drawing = Drawing()
        upper, lower = self._plots(elapsed)
        span = self._span(elapsed)
        unit = 60.0 if span > _SPANS[0] else 1.0
        points = self._shown(elapsed)
        since = (points[:, 0] - elapsed) / unit
        for plot, column, color, dash in (
            (upper, 3, MODEL, MODEL_DASH),
            (upper, 2, MEASURED_Y, 0.0),
            (upper, 1, MEASURED_X, 0.0),
            (lower, 4, TEXT, 0.0),
        ):
            index, values = thinned(points[:, column], _POINTS)
            drawing.line(plot.place(since[index], values), color, 1.5, dash)
        for mark in marks:
            if elapsed - span <= mark.elapsed <= elapsed:
                draw_upright(drawing, (upper, lower), (mark.elapsed - elapsed) / unit, mark)
        return drawing

    def _shown(self, elapsed: float) -> FloatArray:
        """Return the points in sight, shape (n, 5)."""
        least = elapsed - self._span(elapsed)
        return np.array([point for point in self._points if point[0] >= least]).reshape(-1, 5)

    @staticmethod
    def _span(elapsed: float) -> float:
        return next((span for span in _SPANS if elapsed <= span), _SPANS[-1])

    def _plots(self, elapsed: float) -> tuple[Plot, Plot]:
        span = self._span(elapsed)
        in_minutes = span > _SPANS[0]
        length = span / 60.0 if in_minutes else span
        time = Axis(-length, 0.0, f"time before now, {'min' if in_minutes else 's'}", ticks=6)
        overall = Axis(0.0, self._reach.end, "overall, µm peak-to-peak", ticks=4)
        speed = Axis(0.0, self._speed_reach.end, "speed, r/min", ticks=3)
        upper = Plot(0.0, 0.0, 300.0, 90.0, time, overall, letters=_LETTERS)
        return upper, Plot(0.0, 110.0, 300.0, 52.0, time, speed, letters=_LETTERS)
