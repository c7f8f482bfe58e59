"""A short look at what a source gives."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import SampleBlock, SegmentEnd
from daq.drivers.source import Source


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """A stretch of samples from a source.

    Parameters
    ----------
    blocks : tuple of SampleBlock
        Of the first segment, as they came.
    end : SegmentEnd or None
        Of that segment; None where the source ended without one.
    """

    blocks: tuple[SampleBlock, ...]
    end: SegmentEnd | None

    @property
    def codes(self) -> NDArray[np.int16]:
        """All samples, shape (n_channels, n); n = 0 where none came."""
        if not self.blocks:
            return np.empty((0, 0), dtype=np.int16)
        return np.concatenate([block.codes for block in self.blocks], axis=1)

    @property
    def ticks(self) -> NDArray[np.int64] | None:
        """What a counter stamped of the tacho's edges; None where none did throughout."""
        stamped = [block.ticks for block in self.blocks if block.ticks is not None]
        return np.concatenate(stamped) if stamped and len(stamped) == len(self.blocks) else None


def look(source: Source, samples: int) -> Look:
    """Take at least so many samples per channel from a source, and stop it; it is left to be closed."""
    blocks: list[SampleBlock] = []
    for item in source.blocks():
        if isinstance(item, SegmentEnd):
            return Look(tuple(blocks), item)
        blocks.append(item)
        if item.end >= samples:
            source.stop()
    return Look(tuple(blocks), None)
