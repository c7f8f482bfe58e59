"""Tables: the content of files of other formats; conversion of their columns to the codes of a run's channels."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import Calibration, Channel
from analysis.signals.units import MICROMETRE, MILLIMETRE, MILLIVOLT
from recordings.errors import ForeignFormatError


@contextmanager
def library_errors(path: Path) -> Iterator[None]:
    """Raise ForeignFormatError where a library fails at a damaged file; encloses calls of the library only.

    nptdms, scipy and pyuff check little of what they read: a damaged file makes them raise KeyError, struct.error,
    UnboundLocalError, ZeroDivisionError, TypeError, NotImplementedError, MemoryError or, in pyuff, plain Exception.
    """
    try:
        yield
    except (ForeignFormatError, OSError, ImportError):
        raise
    except Exception as error:
        kind = path.suffix.lower().removeprefix(".")
        raise ForeignFormatError(f"is not a {kind} file that can be read: {error}") from error


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

    @classmethod
    def from_properties(cls, columns: Sequence[Column], properties: Mapping[str, str], rate: float | None) -> Self:
        """Return the table of a file; its properties ``rate_hz``, before `rate`, and ``started_ns`` are used."""
        for name, kind in (("rate_hz", float), ("started_ns", int)):
            if name in properties and not _is_number(properties[name], kind):
                raise ForeignFormatError(f"property {name}: {properties[name]!r}, expected a number")
        rate = float(properties["rate_hz"]) if "rate_hz" in properties else rate
        started_ns = int(properties["started_ns"]) if "started_ns" in properties else None
        return cls(tuple(columns), rate, started_ns, properties)

    def all_properties(self) -> dict[str, str]:
        """Return the properties with rate and start, from which `from_properties` restores them."""
        values = {"rate_hz": self.rate, "started_ns": self.started_ns}
        return dict(self.properties) | {name: repr(value) for name, value in values.items() if value is not None}

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


def _is_number(text: str, kind: type[float] | type[int]) -> bool:
    try:
        kind(text)
    except ValueError:
        return False
    return True


STEPS = 65_532
"""Codes from -32766 to 32766: no imported value is at the converter's rails, where it would count as clipped."""
BLOCK_DURATION = 0.1  # s
VOLT_UNITS = {"V": 1.0, "mV": MILLIVOLT}
LENGTH_UNITS = {"um": MICROMETRE, "mm": MILLIMETRE, "m": 1.0}
UNITS = (*VOLT_UNITS, *LENGTH_UNITS)


@dataclass(frozen=True, slots=True, eq=False)
class ImportedChannel:
    """A channel with its codes."""

    channel: Channel
    codes: NDArray[np.int16]


def imported_channel(column: Column, channel: Channel, unit: str, factor: float) -> ImportedChannel:
    """Return a column's values as a channel's codes.

    16-bit integers become codes unchanged. Other values are quantised in 65,532 steps from the smallest to the largest,
    with an error of half a step at most. For displacements, one volt in the recording represents one micrometre.

    Parameters
    ----------
    column : Column
        Values; times `factor` they are in `unit`: volts at the input, or displacement towards the probe.
    channel : Channel
        Channel of the rig; its scaling is replaced, and for displacements its calibration.
    unit : str
        One of UNITS.
    factor : float
        See `column`.

    Raises
    ------
    ForeignFormatError
        If a value is not finite, or the factor not positive.
    """
    scale = factor * (VOLT_UNITS[unit] if unit in VOLT_UNITS else LENGTH_UNITS[unit] / LENGTH_UNITS["um"])
    if column.values.dtype == np.int16:
        codes, scaling = column.values.astype(np.int16), (0.0, scale)
    else:
        values = column.values.astype(np.float64) * scale
        if not np.isfinite(values).all():
            raise ForeignFormatError(f"column {column.name!r}: has values that are not finite")
        low, high = float(values.min()), float(values.max())
        step = (high - low) / STEPS or max(abs(low), 1.0) * 1e-9
        middle = (low + high) / 2
        codes, scaling = np.round((values - middle) / step).astype(np.int16), (middle, step)
    if not scaling[1] > 0:
        raise ForeignFormatError(f"column {column.name!r}: factor {factor:g}, expected a positive one")
    ends = [scaling[0] + scaling[1] * code for code in (-32768, 32767)]
    channel = replace(channel, scaling=scaling, range_low=ends[0], range_high=ends[1])
    if unit in LENGTH_UNITS:
        calibration = Calibration((0.0, -LENGTH_UNITS["um"]), ends[0], ends[1], date="")
        channel = replace(channel, calibration=calibration, gap_low=-math.inf, gap_high=math.inf)
    return ImportedChannel(channel, codes)


def imported_items(channels: list[ImportedChannel], rate: float, host_time_ns: int) -> Iterator[SourceItem]:
    """Yield the samples as blocks of one segment, and the segment end."""
    codes = np.stack([channel.codes for channel in channels])
    n_samples, size = codes.shape[1], max(1, round(BLOCK_DURATION * rate))
    for first in range(0, n_samples, size):
        block = np.ascontiguousarray(codes[:, first : first + size])
        yield SampleBlock(block, 0, first, host_time_ns)
    yield SegmentEnd(0, n_samples, EndReason.FINISHED)
