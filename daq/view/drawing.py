"""Line drawings logged as one entity of the viewer, in a plane with x to the right and y DOWN."""

from collections.abc import Iterator, Sequence
from enum import Enum

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike, NDArray

from daq.colours import BACKGROUND, TEXT, Color, mixed
from daq.view.stroke_font import text_strokes, text_width

FloatArray = NDArray[np.float64]

MODEL_DASH = 4.0
"""Dash length of predicted curves in the units of a plane about 300 wide; distinguishes them without colour."""

_SHADES = np.array(
    [(13, 16, 21), (16, 34, 62), (24, 74, 120), (44, 132, 178), (110, 200, 226), (214, 244, 248), (255, 255, 255)],
    dtype=np.float64,
)


def dimmed(color: Color, share: float) -> Color:
    """Return the colour mixed with the background; ``share`` of the colour, 0 to 1."""
    return mixed(color, share, BACKGROUND)


def shades(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return RGB of shape ``values.shape + (3,)`` for values from 0 (background) to 1 (white), clipped."""
    stops = np.linspace(0.0, 1.0, len(_SHADES))
    clipped = np.clip(np.nan_to_num(values, nan=0.0), 0.0, 1.0)
    return np.stack([np.interp(clipped, stops, _SHADES[:, k]) for k in range(3)], axis=-1).astype(np.uint8)


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
        """Draw a line of text with the baseline at ``at``; rotated by 90° if not ``upright``.

        ``height`` is that of capitals, ``weight`` the stroke width over the height. Returns the width of the text.
        """
        width = text_width(text) * height
        for stroke in text_strokes(text):
            along = stroke[:, 0] * height - anchor.value * width
            up = stroke[:, 1] * height
            x, y = (at[0] + along, at[1] - up) if upright else (at[0] - up, at[1] - along)
            self._add(np.stack([x, y], axis=1), color, weight * height)
        return width

    def log(self, stream: rr.RecordingStream, path: str, *, draw_order: float = 20.0) -> None:
        """Log the drawing as entity ``path``, replacing the previous one."""
        stream.log(path, self.archetype(draw_order=draw_order))

    def archetype(self, *, draw_order: float = 20.0) -> rr.LineStrips2D:
        """Return the drawing as a rerun archetype."""
        strips: Sequence[NDArray[np.float32]] = [strip.astype(np.float32) for strip in self._strips]
        return rr.LineStrips2D(strips, colors=self._colors, radii=self._radii, draw_order=draw_order)

    def _add(self, strip: FloatArray, color: Color, width: float) -> None:
        self._strips.append(strip)
        self._colors.append(color)
        self._radii.append(0.5 * width)
