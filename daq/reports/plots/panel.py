"""What a drawing is made of: curves over two axes, with what is written at them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

Values = Sequence[float | None]
FULL_TURN = 360.0  # degrees
ROOM = 1.1  # of the largest value, to the end of axes of one scale
ROOM_POLAR = 1.25  # the same with words round it


class Style(Enum):
    """How a curve is drawn."""

    LINE = "line"
    GUIDE = "guide"  # dashed and grey, its name at its end: what the others are held against
    DOTS = "dots"  # points that are not joined
    MARKS = "marks"  # bright ones, on all else: where the tacho's mark passed


@dataclass(frozen=True, slots=True)
class Curve:
    """One curve, or one cloud of points.

    Parameters
    ----------
    name : str
        What it is called in the legend; empty: not at all.
    x, y : sequence
        Abscissas and ordinates; a None breaks the curve.
    style : Style
        How it is drawn.
    colour : int or None
        Which of the colours; None: by its place among the curves.
    """

    name: str
    x: Values
    y: Values
    style: Style = Style.LINE
    colour: int | None = None

    def stretches(self) -> list[list[tuple[float, float]]]:
        """Return the unbroken stretches."""
        found: list[list[tuple[float, float]]] = [[]]
        for x, y in zip(self.x, self.y, strict=True):
            if x is None or y is None or not (math.isfinite(x) and math.isfinite(y)):
                found.append([])
            else:
                found[-1].append((x, y))
        return [stretch for stretch in found if stretch]


@dataclass(frozen=True, slots=True)
class Panel:
    """Curves over two axes.

    Parameters
    ----------
    title, x_label, y_label : str
        What is written at it; labels carry the unit.
    curves : tuple of Curve
        What is drawn, the first on top where they are lines.
    caption : str
        A line below the title: how it was made, how sure it is.
    is_square : bool
        Whether both axes have one scale and their zero in the middle.
    y_from_zero : bool
        Whether the ordinates begin at 0.
    x_range, y_range : tuple of float or None
        Ends of the axes; None: as the curves need.
    x_is_angle : bool
        Whether the abscissas are an angle, degrees.
    y_is_lag : bool
        Whether the ordinates are a phase lag, degrees: they grow downwards, and a full turn is 0 again.
    is_stacked : bool
        Whether the curves stand one behind the other, the first in front.
    polar_zero : float or None
        Direction of a lag of 0 in the plane, rad; then the grid is circles and spokes. None: two axes.
    notes : tuple
        Words, and abscissa and ordinate where they stand.
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
        """Return from where to where abscissas and ordinates go."""
        points = [point for curve in self.curves for stretch in curve.stretches() for point in stretch] or [(0.0, 0.0)]
        xs, ys = [x for x, _ in points], [y for _, y in points]
        if self.is_square:
            room = ROOM if self.polar_zero is None else ROOM_POLAR
            most = room * max(*map(abs, xs), *map(abs, ys)) or 1.0
            return (-most, most), (-most, most)
        y_low, y_high = (0.0 if self.y_from_zero else min(ys)), max(ys)
        room = 0.05 * (y_high - y_low) or 1.0
        below = 0.0 if self.y_from_zero or self.is_stacked else room
        x_low, x_high = min(xs), max(xs)
        across = (x_low, x_high if x_high > x_low else x_low + 1.0)
        return self.x_range or across, self.y_range or (y_low - below, y_high + room)

    def steps(self) -> tuple[list[tuple[float, str]], list[tuple[float, str]]]:
        """Return where numbers stand at the axes, and which."""
        (x_low, x_high), (y_low, y_high) = self.ranges()
        xs = _quarters(x_low, x_high) if self.x_is_angle else ticks(x_low, x_high)
        across = [(x, label(x)) for x in xs]
        if self.y_is_lag:
            return across, [(lag, label(lag % FULL_TURN)) for lag in _quarters(y_low, y_high)]
        return across, [(y, label(y)) for y in ticks(y_low, y_high, 6 if self.is_square else 5)]


def ticks(low: float, high: float, wanted: int = 6) -> list[float]:
    """Return round numbers from ``low`` to ``high``, about so many."""
    step = (high - low) / wanted
    power = 10.0 ** math.floor(math.log10(step))
    step = next((factor * power for factor in (1, 2, 5) if factor * power >= step), 10 * power)
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


def _quarters(low: float, high: float) -> list[float]:
    """Return the quarters of a turn between two angles, degrees."""
    return [90.0 * k for k in range(math.ceil(low / 90.0), math.floor(high / 90.0) + 1)]


def label(tick: float) -> str:
    """Return a tick as it is written: thousands with commas."""
    return f"{tick:,.6g}" if abs(tick) < 1e6 else f"{tick:g}"
