"""Colours of the live view, the web page and the plots: one for each meaning, on dark and on white.

The custom properties of ``daq/console/page.css`` carry the same values; a test compares them.
"""

from typing import TypeAlias

Color: TypeAlias = tuple[int, int, int, int]
"""Red, green, blue and opacity, 0 to 255."""

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
DANGER: Color = (255, 92, 92, 255)
BACKGROUND: Color = (13, 16, 21, 255)
DARK_TEXT: Color = (12, 12, 12, 255)  # text on a bright block

ON_WHITE: dict[Color, Color] = {
    MEASURED_X: (21, 101, 192, 255),
    MEASURED_Y: (46, 125, 50, 255),
    MODEL: (138, 75, 0, 255),
    TACHO: (106, 27, 154, 255),
    TEXT: (0, 0, 0, 255),
    LABEL: (68, 68, 68, 255),
    GRID: (221, 224, 228, 255),
    FRAME: (110, 120, 134, 255),
    GOOD: (27, 94, 32, 255),
    ALARM: (109, 90, 0, 255),
    DANGER: (176, 0, 32, 255),
    BACKGROUND: (255, 255, 255, 255),
}
"""Colours of the same meaning on white paper, dark enough for text."""


def mixed(color: Color, share: float, other: Color) -> Color:
    """Return a mixture of two colours; ``share`` of the first, 0 to 1."""
    red, green, blue = (round(share * c + (1.0 - share) * o) for c, o in zip(color[:3], other[:3], strict=True))
    return (red, green, blue, 255)


def hex_code(color: Color) -> str:
    """Return a colour as in CSS, such as #4fc3f7."""
    return "#" + "".join(f"{part:02x}" for part in color[:3])
