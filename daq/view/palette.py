"""Colours of the live view; each quantity has the same colour in all plots."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Color: TypeAlias = tuple[int, int, int, int]

MEASURED_X: Color = (79, 195, 247, 255)  # probe x and measured orbit
MEASURED_Y: Color = (124, 227, 139, 255)  # probe y
MODEL: Color = (255, 163, 26, 255)  # all predictions
TACHO: Color = (190, 150, 255, 255)  # keyphasor mark and tacho signal
TEXT: Color = (236, 240, 245, 255)
LABEL: Color = (158, 170, 184, 255)  # labels and units
GRID: Color = (50, 57, 67, 255)
FRAME: Color = (110, 120, 134, 255)
CLEARANCE: Color = (214, 218, 224, 255)
MARKER: Color = (255, 122, 190, 255)  # a marker of an operator
GOOD: Color = (46, 160, 67, 255)
ALARM: Color = (255, 235, 59, 255)
DANGER: Color = (229, 28, 35, 255)
BACKGROUND: Color = (13, 16, 21, 255)  # of all views
DARK_TEXT: Color = (12, 12, 12, 255)  # text on a bright block

MODEL_DASH = 4.0
"""Dash length of predicted curves in the units of a plane about 300 wide; distinguishes them without colour."""

_SHADES = np.array(
    [(13, 16, 21), (16, 34, 62), (24, 74, 120), (44, 132, 178), (110, 200, 226), (214, 244, 248), (255, 255, 255)],
    dtype=np.float64,
)


def dimmed(color: Color, share: float) -> Color:
    """Return the colour mixed with the background; ``share`` of the colour, 0 to 1."""
    red, green, blue = (round(share * c + (1.0 - share) * p) for c, p in zip(color[:3], BACKGROUND[:3], strict=True))
    return (red, green, blue, 255)


def shades(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return RGB of shape ``values.shape + (3,)`` for values from 0 (background) to 1 (white), clipped."""
    stops = np.linspace(0.0, 1.0, len(_SHADES))
    clipped = np.clip(np.nan_to_num(values, nan=0.0), 0.0, 1.0)
    return np.stack([np.interp(clipped, stops, _SHADES[:, k]) for k in range(3)], axis=-1).astype(np.uint8)
