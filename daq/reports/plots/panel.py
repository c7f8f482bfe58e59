"""Description of a plot: panels with curves, labels, ranges and ticks; theme, size and resolution."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, StrEnum

from daq.colours import ON_WHITE, Color, hex_code

Values = Sequence[float | None]
FULL_TURN = 360.0  # degrees
MARGIN = 1.1  # end of a square panel's axes over the largest value
POLAR_MARGIN = 1.25  # the same with labels around it


class Style(Enum):
    """Style of a curve."""

    LINE = "line"
    GUIDE = "guide"  # dashed grey reference line with its name at the end
    DOTS = "dots"  # unconnected points
    KEYPHASOR = "keyphasor"  # bright dots on top, at the keyphasor mark


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
    x_is_angle : bool
        Whether the abscissas are an angle, degrees.
    y_is_lag : bool
        Whether the ordinates are a phase lag, degrees: growing downwards, modulo a full turn.
    is_stacked : bool
        Whether the curves are stacked, the first in front.
    polar_zero : float or None
        Direction of zero lag in a polar plot, rad. None: rectangular axes.
    notes : tuple
        Labels as text, abscissa and ordinate.
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
    y_is_lag: bool = False
    is_stacked: bool = False
    polar_zero: float | None = None
    notes: tuple[tuple[str, float, float], ...] = ()

    def ranges(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the ends of the x and y axes."""
        points = [point for curve in self.curves for segment in curve.segments() for point in segment] or [(0.0, 0.0)]
        xs, ys = [x for x, _ in points], [y for _, y in points]
        if self.is_square:
            margin = MARGIN if self.polar_zero is None else POLAR_MARGIN
            reach = margin * max(*map(abs, xs), *map(abs, ys)) or 1.0
            return (-reach, reach), (-reach, reach)
        y_low, y_high = (0.0 if self.y_from_zero else min(ys)), max(ys)
        margin = 0.05 * (y_high - y_low) or 1.0
        below = 0.0 if self.y_from_zero or self.is_stacked else margin
        x_low, x_high = min(xs), max(xs)
        across = (x_low, x_high if x_high > x_low else x_low + 1.0)
        return self.x_range or across, self.y_range or (y_low - below, y_high + margin)

    def tick_labels(self) -> tuple[list[tuple[float, str]], list[tuple[float, str]]]:
        """Return value and label of the ticks of the x and y axes."""
        (x_low, x_high), (y_low, y_high) = self.ranges()
        xs = _quarters(x_low, x_high) if self.x_is_angle else ticks(x_low, x_high)
        across = [(x, label(x)) for x in xs]
        if self.y_is_lag:
            return across, [(lag, label(lag % FULL_TURN)) for lag in _quarters(y_low, y_high)]
        return across, [(y, label(y)) for y in ticks(y_low, y_high, 6 if self.is_square else 5)]


def ticks(low: float, high: float, count: int = 6) -> list[float]:
    """Return about ``count`` round numbers from ``low`` to ``high``."""
    step = (high - low) / count
    power = 10.0 ** math.floor(math.log10(step))
    step = next((factor * power for factor in (1, 2, 5) if factor * power >= step), 10 * power)
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


def _quarters(low: float, high: float) -> list[float]:
    """Return the multiples of 90 degrees between two angles, degrees."""
    return [90.0 * k for k in range(math.ceil(low / 90.0), math.floor(high / 90.0) + 1)]


def label(tick: float) -> str:
    """Return the text of a tick, thousands separated by commas, with a true minus sign."""
    return (f"{tick:,.6g}" if abs(tick) < 1e6 else f"{tick:g}").replace("-", "−")


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
