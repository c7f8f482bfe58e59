"""Drawings of lines, text and axes for the viewer's 2D views, which have no axes and no scalable text of their own."""

from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from unicodedata import normalize

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike, NDArray

from daq.colours import BACKGROUND, FRAME, GRID, LABEL, Color, mixed
from daq.session.live_update import LiveUpdate

FloatArray = NDArray[np.float64]

BASELINE, CAPITAL = 2.0, 6.0  # on the glyph grid: position of the baseline, height of capitals
_GAP = 1.7
_DIGIT_WIDTH = 4.0  # the same for all digits, so that changing numbers do not jitter

_GLYPHS = {
    "0": "12 03 07 18 38 47 43 32 12",
    "1": "17 28 22,12 32",
    "2": "07 18 38 47 46 02 42",
    "3": "07 18 38 47 46 35 15,35 44 43 32 12 03",
    "4": "32 38 04 44",
    "5": "48 08 05 35 44 43 32 12 03",
    "6": "47 38 18 07 03 12 32 43 44 35 15 04",
    "7": "08 48 12",
    "8": "15 06 07 18 38 47 46 35 15 04 03 12 32 43 44 35",
    "9": "03 12 32 43 47 38 18 07 06 15 35 46",
    "A": "02 28 42,15 35",
    "B": "02 08 38 47 46 35 05,35 44 43 32 02",
    "C": "47 38 18 07 03 12 32 43",
    "D": "02 08 28 46 44 22 02",
    "E": "48 08 02 42,05 35",
    "F": "48 08 02,05 35",
    "G": "47 38 18 07 03 12 32 43 45 25",
    "H": "02 08,42 48,05 45",
    "I": "12 32,22 28,18 38",
    "J": "48 43 32 12 03",
    "K": "02 08,48 04,15 42",
    "L": "08 02 42",
    "M": "02 08 25 48 42",
    "N": "02 08 42 48",
    "O": "12 03 07 18 38 47 43 32 12",
    "P": "02 08 38 47 46 35 05",
    "Q": "12 03 07 18 38 47 43 32 12,24 42",
    "R": "02 08 38 47 46 35 05,25 42",
    "S": "47 38 18 07 06 15 35 44 43 32 12 03",
    "T": "08 48,28 22",
    "U": "08 03 12 32 43 48",
    "V": "08 22 48",
    "W": "08 12 26 32 48",
    "X": "02 48,08 42",
    "Y": "08 25 48,25 22",
    "Z": "08 48 02 42",
    "a": "06 36 45 42,44 14 03 12 32 43",
    "b": "08 02,05 16 36 45 43 32 12 03",
    "c": "45 36 16 05 03 12 32 43",
    "d": "48 42,45 36 16 05 03 12 32 43",
    "e": "04 44 45 36 16 05 03 12 32 43",
    "f": "38 28 17 12,06 36",
    "g": "46 41 30 10 01,45 36 16 05 03 12 32 43",
    "h": "08 02,05 16 36 45 42",
    "i": "06 02,08 07",
    "j": "16 11 00,18 17",
    "k": "08 02,36 04 32",
    "l": "08 03 12",
    "m": "02 06,05 16 25 22,25 36 45 42",
    "n": "02 06,05 16 36 45 42",
    "o": "16 05 03 12 32 43 45 36 16",
    "p": "00 06,05 16 36 45 43 32 12 03",
    "q": "40 46,45 36 16 05 03 12 32 43",
    "r": "02 06,05 16 36",
    "s": "45 36 16 05 14 34 43 32 12 03",
    "t": "18 13 22 32,06 36",
    "u": "06 03 12 32 43,46 42",
    "v": "06 22 46",
    "w": "06 12 25 32 46",
    "x": "02 46,06 42",
    "y": "06 22,46 10",
    "z": "06 46 02 42",
    "µ": "06 00,03 12 32 43,46 42",
    "°": "07 18 27 16 07",
    ".": "02 03",
    ",": "12 01",
    ":": "02 03,05 06",
    ";": "12 01,15 16",
    "…": "02 03,22 23,42 43",
    "·": "04 05",
    "-": "05 35",
    "−": "05 45",
    "–": "05 45",
    "+": "05 45,23 27",
    "±": "06 46,24 28,02 42",
    "=": "04 44,06 46",
    "×": "03 47,07 43",
    "/": "02 48",
    "%": "02 48,08 18 17 07 08,33 43 42 32 33",
    "(": "18 06 04 12",
    ")": "08 16 14 02",
    "[": "18 08 02 12",
    "]": "08 18 12 02",
    "<": "46 04 42",
    ">": "06 44 02",
    "≤": "47 05 43,02 42",
    "≥": "07 45 03,02 42",
    "→": "04 44,36 44 32",
    "∠": "38 02 42",
    "▲": "02 28 42 02,13 33,14 34,15 35,22 27,12 26 32",
    "▼": "08 22 48 08,17 37,16 36,15 35,28 23,18 24 38",
    "'": "08 07",
    '"': "08 07,28 27",
    "“": "07 08,27 28",
    "”": "08 07,28 27",
    "#": "12 18,32 38,04 44,06 46",
    "&": "42 17 18 28 27 04 03 12 22 44",
    "*": "14 36,16 34",
    "?": "07 18 38 47 46 25 24,23 22",
    "!": "08 04,03 02",
    "_": "01 41",
}
_UNKNOWN = "02 08 48 42 02"  # a box in place of a missing glyph


@lru_cache(maxsize=512)
def _glyph(letter: str) -> tuple[tuple[FloatArray, ...], float]:
    """Return the strokes of a character on the glyph grid and its advance width."""
    if letter == " ":
        return (), 2.6
    shape = _GLYPHS.get(letter) or _GLYPHS.get(normalize("NFKD", letter)[0], _UNKNOWN)  # é falls back to e
    strokes = tuple(
        np.array([(float(point[0]), float(point[1])) for point in stroke.split()]) for stroke in shape.split(",")
    )
    width = _DIGIT_WIDTH if letter.isdigit() else max(float(stroke[:, 0].max()) for stroke in strokes)
    return strokes, width + _GAP


@lru_cache(maxsize=512)
def text_width(text: str) -> float:
    """Return the width of a line of text over the height of capitals."""
    return (sum(_glyph(letter)[1] for letter in text) - _GAP) / CAPITAL if text else 0.0


@lru_cache(maxsize=512)
def text_strokes(text: str) -> tuple[FloatArray, ...]:
    """Return the strokes of a line of text, each (n, 2), y UP, from x = 0, baseline y = 0, capitals of height 1."""
    strokes: list[FloatArray] = []
    pen = 0.0
    for letter in text:
        shapes, advance = _glyph(letter)
        strokes += [(shape + np.array([pen, -BASELINE])) / CAPITAL for shape in shapes]
        pen += advance
    return tuple(strokes)


STROKE_WIDTH = 0.13  # of text, over the height of its capitals
MODEL_DASH = 4.0
"""Dash length of predicted curves in the units of a plane about 300 wide; distinguishes them without colour."""


def dimmed(color: Color, share: float) -> Color:
    """Return the colour mixed with the background; ``share`` of the colour, 0 to 1."""
    return mixed(color, share, BACKGROUND)


class Anchor(Enum):
    """Alignment of text; the value is the fraction of its width left of the anchor point."""

    LEFT = 0.0
    CENTRE = 0.5
    RIGHT = 1.0


def _runs(points: FloatArray) -> list[FloatArray]:
    """Return the runs of finite points of an array (n, 2)."""
    finite = np.isfinite(points).all(axis=1)
    if finite.all():
        return [points] if len(points) > 1 else []
    edges = np.flatnonzero(np.diff(np.concatenate(([0], finite.astype(np.int8), [0]))))
    return [points[a:b] for a, b in edges.reshape(-1, 2) if b - a > 1]


def _dashes(run: FloatArray, length: float) -> Iterator[FloatArray]:
    """Yield the dashes of a line through finite points (n, 2); gaps have the length of the dashes."""
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(run, axis=0).T))))
    for start in np.arange(0.0, along[-1], 2.0 * length):
        inside = along[(along > start) & (along < start + length)]
        at = np.concatenate(([start], inside, [min(start + length, along[-1])]))
        yield np.stack([np.interp(at, along, run[:, k]) for k in range(2)], axis=1)


class Drawing:
    """Strokes drawn as one entity; later strokes cover earlier ones.

    Lengths, widths and heights are in the units of the plane.
    """

    def __init__(self) -> None:
        self._strips: list[FloatArray] = []
        self._colors: list[Color] = []
        self._radii: list[float] = []

    def line(self, points: ArrayLike, color: Color, width: float, dash: float = 0.0) -> None:
        """Draw a line through points (n, 2), broken at non-finite points; ``dash`` > 0 is the length of dashes."""
        for run in _runs(np.asarray(points, dtype=np.float64).reshape(-1, 2)):
            for stroke in _dashes(run, dash) if dash else [run]:
                self._add(stroke, color, width)

    def circle(self, centre: tuple[float, float], radius: float, color: Color, width: float) -> None:
        """Draw a circle."""
        angle = np.linspace(0.0, 2.0 * np.pi, 97)
        self.line(
            np.stack([centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)], axis=1), color, width
        )

    def dot(self, centre: tuple[float, float], radius: float, color: Color) -> None:
        """Draw a filled disc."""
        self.circle(centre, 0.5 * radius, color, radius)

    def block(self, left: float, top: float, width: float, height: float, color: Color) -> None:
        """Fill a rectangle with rounded ends."""
        middle, end = top + 0.5 * height, 0.5 * height
        self.line([(left + end, middle), (left + width - end, middle)], color, height)

    def text(
        self, text: str, at: tuple[float, float], height: float, color: Color, anchor: Anchor = Anchor.LEFT
    ) -> float:
        """Draw a line of text with the baseline at ``at`` and capitals of a height; return its width."""
        width = text_width(text) * height
        start = np.array([at[0] - anchor.value * width, at[1]])
        for stroke in text_strokes(text):
            self._add(start + stroke * (height, -height), color, STROKE_WIDTH * height)
        return width

    def archetype(self, *, draw_order: float = 20.0) -> rr.LineStrips2D:
        """Return the drawing as a rerun archetype."""
        strips: Sequence[NDArray[np.float32]] = [strip.astype(np.float32) for strip in self._strips]
        return rr.LineStrips2D(strips, colors=self._colors, radii=self._radii, draw_order=draw_order)

    def _add(self, strip: FloatArray, color: Color, width: float) -> None:
        self._strips.append(strip)
        self._colors.append(color)
        self._radii.append(0.5 * width)


def round_up(value: float, steps: tuple[float, ...] = (1.0, 2.0, 5.0, 10.0)) -> float:
    """Return the smallest of the steps times a power of ten that is at least a positive value."""
    power = float(10.0 ** np.floor(np.log10(value)))
    return next(step * power for step in steps if step * power >= value * (1.0 - 1e-9))


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
        step = self.step or round_up((self.high - self.low) / self.ticks)
        first, last = np.ceil(self.low / step - 1e-9), np.floor(self.high / step + 1e-9)
        return np.asarray(np.arange(first, last + 1) * step, dtype=np.float64)

    def label(self, value: float) -> str:
        """Return the label of a tick."""
        step = self.step or round_up((self.high - self.low) / self.ticks)
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
    font_size : float
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

    def draw_legend(self, drawing: Drawing, *entries: tuple[str, Color]) -> None:
        """Draw names in their colours above the right end of the frame, the first one rightmost."""
        size, right = self.font_size, self.right - 4.0
        for name, color in entries:
            right -= drawing.text(name, (right, self.top - 0.8 * size), size, color, Anchor.RIGHT) + 8.0


def stacked_axes(upper: Plot, lower: Plot, *legend: tuple[str, Color]) -> Drawing:
    """Return the axes of two plots over a common x axis, and the legend of the upper one."""
    drawing = Drawing()
    upper.draw_frame(drawing, numbers=False)
    lower.draw_frame(drawing)
    upper.draw_legend(drawing, *legend)
    return drawing


class AutoScale:
    """Automatic end of a scale: expands at once, shrinks only after a number of smaller values.

    Parameters
    ----------
    minimum : float
        Smallest end.
    patience : int
        Number of successive values that must fit a shorter scale before it shrinks.
    """

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
        return round_up(max(value / 0.9, self._minimum), (1.0, 2.0, 3.0, 5.0, 10.0))


class LivePlot(ABC):
    """A plot of one run in the live view; an instance lasts as long as the run."""

    def add(self, update: LiveUpdate) -> None:  # noqa: B027 - plots of the latest update add nothing
        """Add the values of an update; called for each, also for those that are not drawn."""

    def follow(self, update: LiveUpdate) -> Hashable:  # noqa: ARG002 - here for plots with fixed axes
        """Update the scales; return what the axes depend on."""
        return None

    @abstractmethod
    def axes(self) -> Drawing:
        """Return axes and legend."""

    @abstractmethod
    def layers(self, update: LiveUpdate) -> dict[str, Drawing | rr.Image]:
        """Return the curves by name, the lowest first."""
