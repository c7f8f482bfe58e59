"""What every study gives: a table and what is to be drawn, in the units that stand in its names and labels."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Cell = float | str


class Style(Enum):
    """How a series is drawn."""

    LINE = "line"
    DASHED = "dashed"
    DOTTED = "dotted"
    POINTS = "points"
    MARKERS = "marks"
    REFERENCE = "reference"


@dataclass(frozen=True, slots=True)
class Series:
    """One line, or one cloud of points, of a plot.

    Parameters
    ----------
    label : str
        In the legend; where empty, it has the colour of the one before.
    x, y : ndarray of float64, shape (n,)
        In the units of the plot's axes; NaN breaks a line.
    style : Style
        How it is drawn.
    """

    label: str
    x: FloatArray
    y: FloatArray
    style: Style = Style.LINE


@dataclass(frozen=True, slots=True)
class Plot:
    """Lines over one pair of axes.

    Parameters
    ----------
    title : str
        What it shows.
    x_label, y_label : str
        With their units.
    series : tuple of Series
        What is drawn.
    x_log, y_log : bool
        Logarithmic axes.
    x_limits, y_limits : tuple of float, length 2, optional
        Ends of the axes.
    is_square : bool
        Whether both axes have the same scale.
    empty_text : str
        What is to be said where there is nothing to draw.
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
    """A quantity over two others, drawn as colours on a logarithmic scale.

    Parameters
    ----------
    title : str
        What it shows.
    x_label, y_label, z_label : str
        With their units.
    x : ndarray of float64, shape (n_x,)
        Rising.
    y : ndarray of float64, shape (n_y,)
        Rising.
    z : ndarray of float64, shape (n_y, n_x)
        Above 0, or NaN.
    z_limits : tuple of float, length 2
        Ends of the colours.
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
    """A study's outcome.

    Parameters
    ----------
    title : str
        What was studied.
    columns : mapping of str to sequences of one length
        The table: names carry the unit (``speed_rad_s``); NaN where there is nothing.
    plots : tuple of Plot or Surface
        Drawn below each other.
    remarks : tuple of str
        What must be known to read the table.
    """

    title: str
    columns: Mapping[str, "FloatArray | tuple[str, ...]"]
    plots: tuple[Plot | Surface, ...]
    remarks: tuple[str, ...] = ()

    def rows(self) -> list[dict[str, Cell]]:
        """Return the table by rows."""
        names = list(self.columns)
        cells = zip(*self.columns.values(), strict=True)
        return [
            {name: cell if isinstance(cell, str) else float(cell) for name, cell in zip(names, row, strict=True)}
            for row in cells
        ]
