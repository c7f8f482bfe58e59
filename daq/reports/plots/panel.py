"""Description of a plot: panels with curves, labels, ranges and ticks; theme, size and resolution."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, StrEnum

from analysis.signals import FloatArray
from daq.colours import ON_WHITE, Color, hex_code
from model.studies.study import Surface

Values = Sequence[float | None] | FloatArray
FULL_TURN = 360.0  # degrees
MARGIN = 1.1  # end of a square panel's axes over the largest value
POLAR_MARGIN = 1.25  # the same with labels around it


class Style(Enum):
    """Style of a curve."""

    LINE = "line"
    DASHED = "dashed"
    DOTTED = "dotted"
    GUIDE = "guide"  # dashed grey reference line with its name at the end
    DOTS = "dots"  # unconnected points
    KEYPHASOR = "keyphasor"  # bright dots on top, at the keyphasor mark
    MARKERS = "markers"  # large dots in the colour of text, on top


@dataclass(frozen=True, slots=True)
class Curve:
    """A curve or a set of points.

    Parameters
    ----------
    name : str
        Name in the legend; empty: not in the legend.
    x, y : sequence
        Abscissas and ordinates; a None breaks the curve.
    style : Style
        Style of the curve.
    colour : int or None
        Index of the colour; None: index of the curve.
    """

    name: str
    x: Values
    y: Values
    style: Style = Style.LINE
    colour: int | None = None

    def segments(self) -> list[list[tuple[float, float]]]:
        """Return the unbroken segments of finite points."""
        found: list[list[tuple[float, float]]] = [[]]
        for x, y in zip(self.x, self.y, strict=True):
            if x is None or y is None or not (math.isfinite(x) and math.isfinite(y)):
                found.append([])
            else:
                found[-1].append((x, y))
        return [segment for segment in found if segment]


@dataclass(frozen=True, slots=True)
class Panel:
    """A plot of curves over two axes.

    Parameters
    ----------
    title, x_label, y_label : str
        Texts; labels carry the unit.
    curves : tuple of Curve
        Curves; of lines, the first is on top.
    caption : str
        Line below the title, with settings and uncertainty.
    is_square : bool
        Whether both axes have the same scale with zero in the centre.
    y_from_zero : bool
        Whether the ordinates begin at 0.
    x_range, y_range : tuple of float or None
        Ends of the axes; None: from the curves.
    x_is_angle, y_is_angle : bool
        Whether the abscissas, or the ordinates, are an angle, degrees.
    y_is_lag : bool
        Whether the ordinates are a phase lag, degrees: growing downwards, modulo a full turn.
    is_stacked : bool
        Whether the curves are stacked, the first in front.
    polar_zero : float or None
        Direction of zero lag in a polar plot, rad. None: rectangular axes.
    notes : tuple
        Labels as text, abscissa and ordinate.
    x_is_log, y_is_log : bool
        Whether the axes are logarithmic.
    surface : Surface or None
        Colour map under the curves.
    empty_text : str
        Text shown if no curve has a point; empty: axes without curves.
    """

    title: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    caption: str = ""
    is_square: bool = False
    y_from_zero: bool = True
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    x_is_angle: bool = False
    y_is_angle: bool = False
    y_is_lag: bool = False
    is_stacked: bool = False
    polar_zero: float | None = None
    notes: tuple[tuple[str, float, float], ...] = ()
    x_is_log: bool = False
    y_is_log: bool = False
    surface: Surface | None = None
    empty_text: str = ""

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to draw, and a text says so."""
        return bool(self.empty_text) and not any(curve.segments() for curve in self.curves)

    def ranges(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the ends of the x and y axes."""
        points = [point for curve in self.curves for segment in curve.segments() for point in segment] or [(0.0, 0.0)]
        xs, ys = [x for x, _ in points], [y for _, y in points]
        if self.is_square and self.x_range is None:
            margin = MARGIN if self.polar_zero is None else POLAR_MARGIN
            reach = margin * max(*map(abs, xs), *map(abs, ys)) or 1.0
            return (-reach, reach), (-reach, reach)
        y_low, y_high = (0.0 if self.y_from_zero else min(ys)), max(ys)
        margin = 0.05 * (y_high - y_low) or 1.0
        below = 0.0 if self.y_from_zero or self.is_stacked else margin
        x_low, x_high = min(xs), max(xs)
        across = (x_low, x_high if x_high > x_low else x_low + 1.0)
        return self.x_range or across, self.y_range or (y_low - below, y_high + margin)


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
