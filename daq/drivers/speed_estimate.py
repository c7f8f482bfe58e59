"""A quick estimate of speed, for triggers; the analysis has the good one."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import SampleBlock
from analysis.signals.header import Acquisition, Role
from analysis.tacho.edges import EdgeDetector

RPM = 60.0  # revolutions a second to r/min
STANDSTILL = 1.0  # s without an edge after which the shaft is taken to stand
TURNS = 8  # that a speed is taken from, at most
LEAST_TURNS = 2  # that must agree: two edges alone may be a glitch
ALIKE = 0.25  # of the median turn by which a turn may differ: one with a doubled or missing edge differs by more


class SpeedEstimate:
    """Follows the speed by the tacho's last edges, from the reference that the rig declares.

    Where that is the card's counter, its stamps are taken at once, without the waiting of the analysis for late ones;
    where it fails, the waveform is taken for the rest of the segment.

    Parameters
    ----------
    acquisition : Acquisition
        What the codes mean.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        self._acquisition = acquisition
        self._row = acquisition.row(Role.TACHO)
        self._pulses = acquisition.tacho.pulses_per_revolution
        self._edges: deque[float] = deque(maxlen=TURNS * self._pulses + 1)  # in samples
        self._begin()

    def _begin(self) -> None:
        self._by_counter = self._acquisition.tacho.reference == "counter"
        self._detector = EdgeDetector(self._acquisition.tacho)
        self._edges.clear()

    def block(self, block: SampleBlock) -> float:
        """Take a block of a segment and return the speed at its end, r/min; 0 where the shaft stands."""
        if block.first_sample == 0:
            self._begin()
        if self._by_counter and block.ticks is None:
            self._by_counter = False
            self._edges.clear()
        self._edges.extend(self._found(block))
        rate = self._acquisition.rate
        while self._edges and block.end - self._edges[0] > 2 * STANDSTILL * rate:
            self._edges.popleft()
        if not self._edges or block.end - self._edges[-1] > STANDSTILL * rate:
            return 0.0
        edges = np.array(self._edges)
        turns = edges[self._pulses :] - edges[: -self._pulses]
        alike = turns[np.abs(turns - np.median(turns)) <= ALIKE * np.median(turns)] if turns.size else turns
        return RPM * rate / float(alike.mean()) if alike.size >= LEAST_TURNS else 0.0

    def _found(self, block: SampleBlock) -> NDArray[np.float64]:
        """Return the block's edges by the reference, in samples of the segment."""
        if self._by_counter and block.ticks is not None:
            return block.ticks / self._acquisition.ticks_per_sample
        volts = self._acquisition.channels[self._row].volts(block.codes[self._row])
        return self._detector.edges(volts, block.first_sample)
