"""Result of a study: a table and plots, with the units in column names and axis labels."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from analysis.signals import FloatArray

Cell = float | str


class Style(Enum):
    """Line or marker style of a series."""

    LINE = "line"
    DASHED = "dashed"
    DOTTED = "dotted"
    POINTS = "points"
    MARKERS = "marks"
    REFERENCE = "reference"


@dataclass(frozen=True, slots=True)
class Series:
    """A line or a set of points of a plot.

    Parameters
    ----------
    label : str
        Legend entry; if empty, the series has the colour of the previous one.
    x, y : ndarray of float64, shape (n,)
        Values in the units of the axes; NaN interrupts a line.
    style : Style
        Line or marker style.
    """

    label: str
    x: FloatArray
    y: FloatArray
    style: Style = Style.LINE


@dataclass(frozen=True, slots=True)
class Plot:
    """A plot with one pair of axes.

    Parameters
    ----------
    title : str
        Title of the plot.
    x_label, y_label : str
        Axis labels with units.
    series : tuple of Series
        Lines and points.
    x_log, y_log : bool
        Logarithmic axes.
    x_limits, y_limits : tuple of float, length 2, optional
        Limits of the axes.
    is_square : bool
        Whether both axes have the same scale.
    empty_text : str
        Text shown if there is nothing to draw.
    """

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    x_log: bool = False
    y_log: bool = False
    x_limits: tuple[float, float] | None = None
    y_limits: tuple[float, float] | None = None
    is_square: bool = False
    empty_text: str = "nothing to draw"


@dataclass(frozen=True, slots=True)
class Surface:
    """A colour map of a quantity over two others, on a logarithmic scale.

    Parameters
    ----------
    title : str
        Title of the plot.
    x_label, y_label, z_label : str
        Axis labels with units.
    x : ndarray of float64, shape (n_x,)
        Rising.
    y : ndarray of float64, shape (n_y,)
        Rising.
    z : ndarray of float64, shape (n_y, n_x)
        Above 0, or NaN.
    z_limits : tuple of float, length 2
        Limits of the colour scale.
    guides : tuple of Series
        Lines drawn over it.
    """

    title: str
    x_label: str
    y_label: str
    z_label: str
    x: FloatArray
    y: FloatArray
    z: FloatArray
    z_limits: tuple[float, float]
    guides: tuple[Series, ...] = ()


@dataclass(frozen=True, slots=True)
class Study:
    """The result of a study.

    Parameters
    ----------
    title : str
        Subject of the study.
    columns : mapping of str to sequences of one length
        Table by column; names end with the unit (``speed_rad_s``), NaN marks missing values.
    plots : tuple of Plot or Surface
        Plots, one below the other.
    remarks : tuple of str
        Notes for reading the table.
    """

    title: str
    columns: Mapping[str, "FloatArray | tuple[str, ...]"]
    plots: tuple[Plot | Surface, ...]
    remarks: tuple[str, ...] = ()

    def rows(self) -> list[dict[str, Cell]]:
        """Return the table as rows."""
        names = list(self.columns)
        cells = zip(*self.columns.values(), strict=True)
        return [
            {name: cell if isinstance(cell, str) else float(cell) for name, cell in zip(names, row, strict=True)}
            for row in cells
        ]
