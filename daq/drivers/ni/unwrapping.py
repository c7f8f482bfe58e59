"""Counts of 32 bits that go on for ever: how often the counter has begun again."""

import numpy as np
from numpy.typing import NDArray

WRAP = 1 << 32


class Unwrapping:
    """Makes the counts that edges latched, in their order, rise through every wrap.

    From one count to the next the counter has begun again at most once where less than a wrap has passed. After a
    longer silence only the samples know: no edge had come when the counter was last found empty, and so the next lies
    behind that, by less than a wrap.
    """

    def __init__(self) -> None:
        self._least = 0  # that the next count can be, in ticks since the beginning

    def ticks(self, counts: NDArray[np.uint32]) -> NDArray[np.int64]:
        """Return the ticks since the counter began for the counts read next."""
        if counts.size == 0:
            return np.empty(0, np.int64)
        steps = np.diff(counts).astype(np.int64)  # modulo 2³²
        first = self._least + (int(counts[0]) - self._least) % WRAP
        ticks = first + np.concatenate([[0], np.cumsum(steps)])
        self._least = int(ticks[-1]) + 1
        return ticks

    def none_before(self, tick: int) -> None:
        """Take note that no count which has not been read was latched before a tick."""
        self._least = max(self._least, tick)
