"""The colours of the live view, in one place: a thing has the same colour wherever it is drawn."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Color: TypeAlias = tuple[int, int, int, int]

MEASURED_X: Color = (79, 195, 247, 255)  # probe x, and the measured orbit
MEASURED_Y: Color = (124, 227, 139, 255)  # probe y
MODEL: Color = (255, 163, 26, 255)  # whatever the model says, everywhere
TACHO: Color = (190, 150, 255, 255)  # the mark on the shaft and the tacho's signal
TEXT: Color = (236, 240, 245, 255)
QUIET: Color = (158, 170, 184, 255)  # labels and units
GRID: Color = (50, 57, 67, 255)
FRAME: Color = (110, 120, 134, 255)
CLEARANCE: Color = (214, 218, 224, 255)
MARKER: Color = (255, 122, 190, 255)  # notes of the operator
GOOD: Color = (46, 160, 67, 255)
ALARM: Color = (255, 235, 59, 255)
DANGER: Color = (229, 28, 35, 255)
PAPER: Color = (13, 16, 21, 255)  # what all of it is drawn on
INK: Color = (12, 12, 12, 255)  # writing on a bright block

MODEL_DASH = 4.0
"""Length of the dashes in which the model's lines are drawn, in the units of a plane some 300 wide: told from what is
measured without their colour, too."""

_SHADES = np.array(
    [(13, 16, 21), (16, 34, 62), (24, 74, 120), (44, 132, 178), (110, 200, 226), (214, 244, 248), (255, 255, 255)],
    dtype=np.float64,
)


def dimmed(color: Color, share: float) -> Color:
    """Return the colour mixed with the paper: ``share`` of it, 0 to 1."""
    red, green, blue = (round(share * c + (1.0 - share) * p) for c, p in zip(color[:3], PAPER[:3], strict=True))
    return (red, green, blue, 255)


def shades(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return RGB of shape ``values.shape + (3,)`` for values from 0 (paper) to 1 (white); outside is clipped."""
    stops = np.linspace(0.0, 1.0, len(_SHADES))
    clipped = np.clip(np.nan_to_num(values, nan=0.0), 0.0, 1.0)
    return np.stack([np.interp(clipped, stops, _SHADES[:, k]) for k in range(3)], axis=-1).astype(np.uint8)
