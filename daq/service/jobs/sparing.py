"""Words on how a job goes, no more often than anybody looks."""

import math
import time
from collections.abc import Callable

from daq.service.jobs.queue import Progress, Tell

PAUSE = 0.1  # s between two words on how it goes


class Sparing:
    """Tells no more often than anybody looks.

    Parameters
    ----------
    tell : Tell
        Who is told.
    """

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._doing = ""
        self._told = -math.inf

    def words(self, doing: str, part: float | None) -> None:
        """Tell what is done, and what part of it, 0 to 1; None where that cannot be told."""
        now = time.monotonic()
        if doing != self._doing or now - self._told >= PAUSE:
            self._doing, self._told = doing, now
            self._tell(Progress(doing, part))


def parts_told(tell: Tell, doing: str) -> Callable[[float], None]:
    """Return what takes the part of something that is done, 0 to 1, and tells it."""
    words = Sparing(tell).words
    return lambda part: words(doing, part)
