"""Conversion of imported samples to 16-bit codes, with the scaling that restores the values of the file."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import Calibration, Channel
from analysis.signals.units import MICROMETRE, MILLIMETRE, MILLIVOLT
from recordings.errors import ForeignFormatError
from recordings.exchange.table import Column

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
