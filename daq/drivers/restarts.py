"""How often a run may begin anew after a fault."""

import time
from collections import deque
from dataclasses import replace

from analysis.signals.blocks import SegmentEnd

WINDOW = 60.0  # s


class Restarts:
    """Counts the new segments that a run begins after faults; one thread uses it.

    Parameters
    ----------
    per_minute : int
        New segments within any minute; 0 for none at all.
    """

    def __init__(self, per_minute: int) -> None:
        self._per_minute = per_minute
        self._begun: deque[float] = deque(maxlen=max(per_minute, 1))

    def take(self) -> bool:
        """Count a new segment and return True, or return False where there have been too many."""
        now = time.monotonic()
        full = len(self._begun) == self._per_minute
        if self._per_minute == 0 or (full and now - self._begun[0] < WINDOW):
            return False
        self._begun.append(now)
        return True

    def last(self, end: SegmentEnd) -> SegmentEnd:
        """Return the end of a segment after which none begins, with that said."""
        why = "every fault ends the run" if self._per_minute == 0 else f"{self._per_minute} new segments in a minute"
        return replace(end, detail=f"{end.detail}; the run ends here: {why} (session.restarts_per_minute)")
