"""Lines and lettering collected for one entity of the viewer, in a plane with x to the right and y DOWN.

Letters made of strokes, so that writing in a drawing scales with it and is read from across the room.
"""

from collections.abc import Iterator, Sequence
from enum import Enum
from functools import lru_cache
from unicodedata import normalize

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike, NDArray

from daq.view.palette import TEXT, Color

FloatArray = NDArray[np.float64]

BASELINE, CAPITAL = 2.0, 6.0  # on the grid: where letters stand, and how tall a capital is
_GAP = 1.7
_DIGIT_WIDTH = 4.0  # all digits are as wide, so that a changing number does not shiver

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
_UNKNOWN = "02 08 48 42 02"  # a box: that there was a letter is seen


@lru_cache(maxsize=512)
def _glyph(letter: str) -> tuple[tuple[FloatArray, ...], float]:
    """Return the strokes of a letter on its grid and how far the next one stands off."""
    if letter == " ":
        return (), 2.6
    shape = _GLYPHS.get(letter) or _GLYPHS.get(normalize("NFKD", letter)[0], _UNKNOWN)  # é is read as e
    strokes = tuple(
        np.array([(float(point[0]), float(point[1])) for point in stroke.split()]) for stroke in shape.split(",")
    )
    width = _DIGIT_WIDTH if letter.isdigit() else max(float(stroke[:, 0].max()) for stroke in strokes)
    return strokes, width + _GAP


@lru_cache(maxsize=512)
def text_width(text: str) -> float:
    """Return the width of a line of text over the height of its capitals."""
    return (sum(_glyph(letter)[1] for letter in text) - _GAP) / CAPITAL if text else 0.0


@lru_cache(maxsize=512)
def text_strokes(text: str) -> tuple[FloatArray, ...]:
    """Return the strokes of a line of text, each (n, 2), y UP, capitals 1 high, from x = 0, standing on y = 0."""
    strokes: list[FloatArray] = []
    pen = 0.0
    for letter in text:
        shapes, advance = _glyph(letter)
        strokes += [(shape + np.array([pen, -BASELINE])) / CAPITAL for shape in shapes]
        pen += advance
    return tuple(strokes)


class Anchor(Enum):
    """Which end of a line of text stands at the point given; the value is the share of its width to the left."""

    LEFT = 0.0
    CENTRE = 0.5
    RIGHT = 1.0


def _runs(points: FloatArray) -> list[FloatArray]:
    """Return the stretches of finite points of (n, 2): a line is broken where a value is missing."""
    finite = np.isfinite(points).all(axis=1)
    if finite.all():
        return [points] if len(points) > 1 else []
    edges = np.flatnonzero(np.diff(np.concatenate(([0], finite.astype(np.int8), [0]))))
    return [points[a:b] for a, b in edges.reshape(-1, 2) if b - a > 1]


def _dashes(run: FloatArray, length: float) -> Iterator[FloatArray]:
    """Yield the dashes of a line through finite points of (n, 2), gaps as long as they are between them."""
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(run, axis=0).T))))
    for start in np.arange(0.0, along[-1], 2.0 * length):
        inside = along[(along > start) & (along < start + length)]
        at = np.concatenate(([start], inside, [min(start + length, along[-1])]))
        yield np.stack([np.interp(at, along, run[:, k]) for k in range(2)], axis=1)


class Drawing:
    """What is drawn as one entity; later strokes lie over earlier ones.

    Lengths, widths and heights are in the units of the plane.
    """

    def __init__(self) -> None:
        self._strips: list[FloatArray] = []
        self._colors: list[Color] = []
        self._radii: list[float] = []

    def line(self, points: ArrayLike, color: Color, width: float, dash: float = 0.0) -> None:
        """Draw a line through points of shape (n, 2), broken where one is not finite; in dashes where they are long."""
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
        self,
        text: str,
        at: tuple[float, float],
        height: float,
        color: Color = TEXT,
        anchor: Anchor = Anchor.LEFT,
        *,
        upright: bool = True,
        weight: float = 0.13,
    ) -> float:
        """Write a line of text standing on ``at``; upwards along the left where not ``upright``.

        ``height`` is that of a capital, ``weight`` the stroke's width over it. Returns the width of the text.
        """
        width = text_width(text) * height
        for stroke in text_strokes(text):
            along = stroke[:, 0] * height - anchor.value * width
            up = stroke[:, 1] * height
            x, y = (at[0] + along, at[1] - up) if upright else (at[0] - up, at[1] - along)
            self._add(np.stack([x, y], axis=1), color, weight * height)
        return width

    def log(self, stream: rr.RecordingStream, path: str, *, draw_order: float = 20.0) -> None:
        """Show it as entity ``path`` in place of what was there."""
        stream.log(path, self.archetype(draw_order=draw_order))

    def archetype(self, *, draw_order: float = 20.0) -> rr.LineStrips2D:
        """Return it as the viewer's archetype."""
        strips: Sequence[NDArray[np.float32]] = [strip.astype(np.float32) for strip in self._strips]
        return rr.LineStrips2D(strips, colors=self._colors, radii=self._radii, draw_order=draw_order)

    def _add(self, strip: FloatArray, color: Color, width: float) -> None:
        self._strips.append(strip)
        self._colors.append(color)
        self._radii.append(0.5 * width)
