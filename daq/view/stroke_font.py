"""Stroke font: text as line strokes, so that it scales with the drawing."""

from functools import lru_cache
from unicodedata import normalize

import numpy as np
from numpy.typing import NDArray

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
