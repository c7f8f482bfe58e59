"""Table of columns: the content of files of other formats, sampled at one rate or with its own times."""

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
        Name; with its unit in tables for people, as "x_um".
    unit : str
        As in the file, "µm" or "V"; empty if the file has none.
    values : ndarray, shape (n,)
        float64, or int16 if the file has codes; strings only in tables that are written as CSV or Parquet.
    """

    name: str
    unit: str
    values: NDArray[np.float64] | NDArray[np.int16] | NDArray[np.str_]


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Columns of equal length, with rate, start and properties.

    Parameters
    ----------
    columns : tuple of Column
        The columns.
    rate : float or None
        Rows per second, Hz; None if unknown, or if the rows have a column of times.
    started_ns : int or None
        Wall clock at the first row, ns since 1970; None if unknown.
    properties : mapping of str to str
        Further properties, as run, rig and calibrations.
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
        """Return the column of this name; ForeignFormatError lists the names that exist."""
        for column in self.columns:
            if column.name == name:
                return column
        raise ForeignFormatError(f"no column {name!r}; there are {', '.join(repr(c.name) for c in self.columns)}")


def rate_of(times: NDArray[np.float64], name: str) -> float:
    """Return the rate, Hz, of a column of evenly spaced times, s; `name` is for the message.

    Raises
    ------
    ForeignFormatError
        If a time deviates from even spacing by more than a tenth of a step.
    """
    if len(times) < 2 or not np.isfinite(times).all() or not times[-1] > times[0]:
        raise ForeignFormatError(f"times in {name!r}: expected at least two, rising")
    step = (times[-1] - times[0]) / (len(times) - 1)
    if np.abs(times - (times[0] + step * np.arange(len(times)))).max() > 0.1 * step:
        raise ForeignFormatError(f"times in {name!r}: not evenly spaced; samples must have been taken at one rate")
    rate = 1 / float(step)
    return float(round(rate)) if abs(rate - round(rate)) < 1e-6 * rate else rate


def require_ended(path: Path, line: int) -> None:
    """Raise ForeignFormatError if the last line, of this number, lacks its line end: its last number may be cut off."""
    with path.open("rb") as file:
        if file.seek(0, os.SEEK_END) == 0:
            return
        file.seek(-1, os.SEEK_END)
        if file.read() not in b"\r\n":
            raise ForeignFormatError(
                f"line {line}, the last one, has no line end: the file may be cut inside its last number; "
                "delete the line, or end it if it is complete"
            )
