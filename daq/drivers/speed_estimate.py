"""A quick estimate of speed, for triggers; the analysis has the good one."""

from collections import deque

from analysis.edges import EdgeDetector
from analysis.run import Acquisition, Role
from analysis.samples import SampleBlock

RPM = 60.0  # revolutions a second to r/min
STANDSTILL = 1.0  # s without an edge after which the shaft is taken to stand
EDGES = 9  # that a speed is taken from, at most


class SpeedEstimate:
    """Follows the speed by the tacho's last edges.

    Parameters
    ----------
    acquisition : Acquisition
        What the codes mean.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        row = acquisition.row(Role.TACHO)
        self._row, self._channel = row, acquisition.channels[row]
        self._rate = acquisition.rate
        self._pulses = acquisition.tacho.pulses_per_revolution
        self._detector = EdgeDetector(acquisition.tacho)
        self._edges: deque[float] = deque(maxlen=EDGES)

    def block(self, block: SampleBlock) -> float:
        """Take a block of a segment and return the speed at its end, r/min; 0 where the shaft stands."""
        if block.first_sample == 0:
            self._edges.clear()
        volts = self._channel.volts(block.codes[self._row])
        self._edges.extend(self._detector.edges(volts, block.first_sample))
        while self._edges and block.end - self._edges[0] > 2 * STANDSTILL * self._rate:
            self._edges.popleft()
        if len(self._edges) < 2 or block.end - self._edges[-1] > STANDSTILL * self._rate:
            return 0.0
        turns = (len(self._edges) - 1) / self._pulses
        return float(turns * self._rate / (self._edges[-1] - self._edges[0]) * RPM)
