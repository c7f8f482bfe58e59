"""Theme, size and resolution of plots."""

from dataclasses import dataclass
from enum import StrEnum

from daq.colours import ON_WHITE, Color, hex_code

DEFAULT_WIDTH = 170.0  # mm
DEFAULT_DPI = 200.0


class Theme(StrEnum):
    """Background of a plot."""

    LIGHT = "light"  # white paper
    DARK = "dark"  # as the page

    def colour(self, color: Color) -> str:
        """Return a colour of `daq.colours` as it appears on this background."""
        return hex_code(ON_WHITE[color] if self is Theme.LIGHT else color)


@dataclass(frozen=True, slots=True)
class PlotStyle:
    """Appearance of a figure.

    Parameters
    ----------
    theme : Theme
        Light or dark background.
    width : float
        Width, mm; by default that of two columns of a journal.
    dpi : float
        Resolution of a PNG, pixels per inch.
    """

    theme: Theme = Theme.LIGHT
    width: float = DEFAULT_WIDTH
    dpi: float = DEFAULT_DPI
