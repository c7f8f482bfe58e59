"""Plots with axes, ticks and labels, drawn as lines because the viewer's 2D views have none."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from daq.colours import FRAME, GRID, LABEL
from daq.view.drawing import Anchor, Drawing

FloatArray = NDArray[np.float64]


def tick_step(span: float, count: int) -> float:
    """Return the step of 1, 2 or 5 times a power of ten that divides ``span`` into at most ``count`` intervals."""
    raw = span / count
    power = float(10.0 ** np.floor(np.log10(raw)))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= raw * (1.0 - 1e-9))


@dataclass(frozen=True, slots=True)
class Axis:
    """Axis of a plot.

    Parameters
    ----------
    low, high : float
        Ends, in the unit of the title.
    title : str
        Quantity and unit, as "speed, r/min".
    ticks : int
        Maximum number of intervals between ticks.
    step : float
        Distance between ticks; 0: a round value.
    """

    low: float
    high: float
    title: str
    ticks: int = 5
    step: float = 0.0

    def values(self) -> FloatArray:
        """Return the values of the ticks."""
        step = self.step or tick_step(self.high - self.low, self.ticks)
        first, last = np.ceil(self.low / step - 1e-9), np.floor(self.high / step + 1e-9)
        return np.asarray(np.arange(first, last + 1) * step, dtype=np.float64)

    def label(self, value: float) -> str:
        """Return the label of a tick."""
        step = self.step or tick_step(self.high - self.low, self.ticks)
        return f"{value + 0.0:,.{max(0, -int(np.floor(np.log10(step) + 1e-9)))}f}"

    def fraction(self, values: ArrayLike) -> FloatArray:
        """Return the positions of values along the axis, 0 to 1."""
        return (np.asarray(values, dtype=np.float64) - self.low) / (self.high - self.low)


@dataclass(frozen=True, slots=True)
class Plot:
    """Rectangular plot with two axes.

    Parameters
    ----------
    left, top, width, height : float
        Position and size in the plane of the drawing.
    x, y : Axis
        Axes; y grows upwards.
    letters : float
        Height of capitals in the units of the plane.
    """

    left: float
    top: float
    width: float
    height: float
    x: Axis
    y: Axis
    font_size: float

    @property
    def bottom(self) -> float:
        """Position of the lower edge."""
        return self.top + self.height

    @property
    def right(self) -> float:
        """Position of the right edge."""
        return self.left + self.width

    def place(self, x: ArrayLike, y: ArrayLike) -> FloatArray:
        """Return the positions of values, shape (n,), in the plane, (n, 2); y is clipped to the axis."""
        across, up = np.broadcast_arrays(self.x.fraction(x), np.clip(self.y.fraction(y), 0.0, 1.0))
        return np.stack([self.left + across * self.width, self.bottom - up * self.height], axis=-1)

    def draw_frame(self, drawing: Drawing, *, grid: bool = True, numbers: bool = True) -> None:
        """Draw grid, frame, ticks, tick labels and titles; ``numbers`` False omits labels and title of the x axis."""
        size = self.font_size
        thin = 0.09 * size
        for value in self.x.values():
            at = float(self.left + self.x.fraction(value) * self.width)
            if grid:
                drawing.line([(at, self.top), (at, self.bottom)], GRID, thin)
            drawing.line([(at, self.bottom), (at, self.bottom + 0.4 * size)], FRAME, thin)
            if numbers:
                drawing.text(self.x.label(value), (at, self.bottom + 1.8 * size), size, LABEL, Anchor.CENTRE)
        for value in self.y.values():
            at = float(self.bottom - self.y.fraction(value) * self.height)
            if grid:
                drawing.line([(self.left, at), (self.right, at)], GRID, thin)
            drawing.line([(self.left - 0.4 * size, at), (self.left, at)], FRAME, thin)
            drawing.text(self.y.label(value), (self.left - 0.8 * size, at + 0.5 * size), size, LABEL, Anchor.RIGHT)
        corners = [(self.left, self.top), (self.right, self.top), (self.right, self.bottom), (self.left, self.bottom)]
        drawing.line([*corners, corners[0]], FRAME, thin)
        if numbers:
            middle = self.left + 0.5 * self.width
            drawing.text(self.x.title, (middle, self.bottom + 3.9 * size), size, LABEL, Anchor.CENTRE)
        drawing.text(self.y.title, (self.left, self.top - 0.8 * size), size, LABEL)


class AutoScale:
    """Automatic end of a scale: expands at once, shrinks only after a number of smaller values.

    Parameters
    ----------
    minimum : float
        Smallest end.
    patience : int
        Number of successive values that must fit a shorter scale before it shrinks.
    """

    _STEPS = np.array([1.0, 2.0, 3.0, 5.0, 10.0])

    def __init__(self, minimum: float, patience: int = 30) -> None:
        self._minimum = minimum
        self._patience = patience
        self._n_smaller = 0
        self.end = self._fitting(0.0)

    def follow(self, value: float) -> float:
        """Update the scale with a value and return its end."""
        if not np.isfinite(value):
            return self.end
        if value > 0.97 * self.end:
            self.end, self._n_smaller = self._fitting(value), 0
        elif self._fitting(1.3 * value) < self.end:
            self._n_smaller += 1
            if self._n_smaller >= self._patience:
                self.end, self._n_smaller = self._fitting(1.3 * value), 0
        else:
            self._n_smaller = 0
        return self.end

    def _fitting(self, value: float) -> float:
        wanted = max(value / 0.9, self._minimum)
        power = float(10.0 ** np.floor(np.log10(wanted)))
        return float(next(step * power for step in self._STEPS if step * power >= wanted * (1.0 - 1e-9)))
