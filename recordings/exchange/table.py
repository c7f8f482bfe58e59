"""What foreign files hold: columns of equal length, taken at one rate or at times of their own.

Whether a text of numbers was written to its end: a number that is cut is still a number, but another one.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recordings.errors import ForeignFormatError


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """A column of a table.

    Parameters
    ----------
    name : str
        Its name; with unit where the table comes from or goes to people, as "x_um".
    unit : str
        As the file says it, "µm" or "V"; empty where it does not.
    values : ndarray, shape (n,)
        float64, or int16 where the file holds codes; words only where a table is written as CSV or Parquet.
    """

    name: str
    unit: str
    values: NDArray[np.float64] | NDArray[np.int16] | NDArray[np.str_]


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Columns of equal length.

    Parameters
    ----------
    columns : tuple of Column
        The columns.
    rate : float or None
        Rows a second, Hz; None where the file does not tell or the rows have times of their own.
    started_ns : int or None
        Wall clock at the first row, ns since 1970; None where the file does not tell.
    properties : mapping of str to str
        What else there is to say.
    """

    columns: tuple[Column, ...]
    rate: float | None = None
    started_ns: int | None = None
    properties: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        lengths = {column.values.shape for column in self.columns}
        if len(lengths) > 1 or any(len(shape) != 1 for shape in lengths):
            shapes = {column.name: column.values.shape for column in self.columns}
            raise ForeignFormatError(f"columns of different lengths: {shapes}")

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        return len(self.columns[0].values) if self.columns else 0

    def column(self, name: str) -> Column:
        """Return the column of this name; ForeignFormatError says which there are."""
        for column in self.columns:
            if column.name == name:
                return column
        raise ForeignFormatError(f"no column {name!r}; there are {', '.join(repr(c.name) for c in self.columns)}")


def rate_of(times: NDArray[np.float64], name: str) -> float:
    """Return the rate of rows at evenly spaced times, s, of a column of this name.

    Raises
    ------
    ForeignFormatError
        Where they are not evenly spaced: a tenth of a step at most may be rounding.
    """
    if len(times) < 2 or not np.isfinite(times).all() or not times[-1] > times[0]:
        raise ForeignFormatError(f"times in {name!r}: expected at least two, rising")
    step = (times[-1] - times[0]) / (len(times) - 1)
    if np.abs(times - (times[0] + step * np.arange(len(times)))).max() > 0.1 * step:
        raise ForeignFormatError(f"times in {name!r}: not evenly spaced; samples must have been taken at one rate")
    rate = 1 / float(step)
    return float(round(rate)) if abs(rate - round(rate)) < 1e-6 * rate else rate


def require_ended(path: Path, line: int) -> None:
    """Raise ForeignFormatError where the last line of a file, the one of this number, has no end."""
    with path.open("rb") as file:
        if file.seek(0, os.SEEK_END) == 0:
            return
        file.seek(-1, os.SEEK_END)
        if file.read() not in b"\r\n":
            raise ForeignFormatError(
                f"line {line}, the last, has no end: the file may be cut inside its last number; "
                "take that line off, or end it where it is whole"
            )
