"""The last revolutions as a scope shows them: both probes and the tacho against time."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.signals.snapshot import Snapshot
from daq.session.live_update import PlacedMark
from daq.view.axes import Axis, Plot, Reach
from daq.view.drawing import Anchor, Drawing
from daq.view.flags import draw_upright
from daq.view.palette import MEASURED_X, MEASURED_Y, TACHO

FloatArray = NDArray[np.float64]

BOUNDS = ((-34.0, 316.0), (-15.0, 192.0))
_LETTERS = 7.0
_MICRO = 1e6
_POINTS = 600  # a line of more is not seen
_REVOLUTIONS = 6
_SPANS = (0.01, 0.015, 0.02, 0.03, 0.04, 0.06, 0.08, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0, 2.0)  # s


def thinned(values: FloatArray, points: int) -> tuple[NDArray[np.intp], FloatArray]:
    """Return indices and values of at most ``points`` samples of (n,): lowest and highest of each stretch, in order."""
    if values.size <= points:
        return np.arange(values.size), values
    stretch = math.ceil(2.0 * values.size / points)
    whole = values[: values.size // stretch * stretch].reshape(-1, stretch)
    pair = np.sort(np.stack([whole.argmin(axis=1), whole.argmax(axis=1)], axis=1), axis=1)
    index = (pair + np.arange(len(whole))[:, None] * stretch).ravel()
    return index, values[index]


class TracePlot:
    """Draws traces of one run."""

    def __init__(self) -> None:
        self._reach = Reach(smallest=5.0)
        self._span = _SPANS[0]
        self._volts = 5.0

    def follow(self, snapshot: Snapshot | None) -> tuple[float, float, float]:
        """Choose the scales for what is drawn next; returns their ends, by which a changed frame is known."""
        if snapshot is not None and snapshot.trace.time.size > 1:
            trace = snapshot.trace
            turn = 2.0 * math.pi / snapshot.speed if snapshot.speed > 0.0 else math.inf
            wanted = min(_REVOLUTIONS * turn, float(trace.time[-1] - trace.time[0]))
            self._span = max((span for span in _SPANS if span <= 1.01 * wanted), default=_SPANS[0])
            self._reach.follow(float(np.abs(trace.displacement).max()) * _MICRO)
            self._volts = max(self._volts, math.ceil(float(np.abs(trace.tacho).max())))
        return self._span, self._reach.end, self._volts

    def axes(self) -> Drawing:
        """Return both frames, numbers and legend."""
        drawing = Drawing()
        upper, lower = self._plots()
        upper.draw_frame(drawing, numbers=False)
        lower.draw_frame(drawing)
        right = 296.0
        for name, color in (("y", MEASURED_Y), ("x", MEASURED_X)):
            right -= drawing.text(name, (right, -0.8 * _LETTERS), _LETTERS, color, Anchor.RIGHT) + 8.0
        return drawing

    def lines(self, snapshot: Snapshot | None, marks: Sequence[PlacedMark] = ()) -> Drawing:
        """Return the three lines, and the marks that lie in what they show."""
        drawing = Drawing()
        if snapshot is None or snapshot.trace.time.size < 2:
            return drawing
        trace = snapshot.trace
        upper, lower = self._plots()
        since = trace.time - trace.time[-1]
        shown = since >= -self._span
        milliseconds = since[shown] * 1e3
        for row, color in ((1, MEASURED_Y), (0, MEASURED_X)):
            index, values = thinned(trace.displacement[row, shown] * _MICRO, _POINTS)
            drawing.line(upper.place(milliseconds[index], values), color, 1.5)
        index, values = thinned(trace.tacho[shown], _POINTS)
        drawing.line(lower.place(milliseconds[index], values), TACHO, 1.3)
        for mark in marks:
            at = mark.time - float(trace.time[-1])
            if mark.mark.segment == snapshot.segment and -self._span <= at <= 0.0:
                draw_upright(drawing, (upper, lower), at * 1e3, mark)
        return drawing

    def _plots(self) -> tuple[Plot, Plot]:
        time = Axis(-self._span * 1e3, 0.0, "time before now, ms", ticks=6)
        end = self._reach.end
        upper = Plot(0.0, 0.0, 300.0, 104.0, time, Axis(-end, end, "displacement, µm", ticks=4), letters=_LETTERS)
        volts = Axis(min(0.0, -0.1 * self._volts), 1.1 * self._volts, "tacho, V", ticks=2)
        return upper, Plot(0.0, 124.0, 300.0, 38.0, time, volts, letters=_LETTERS)
