"""The request for the end, which may come at any instant: from a thread, and from the handler of a signal."""

import time

NAP = 0.05
"""So long, s, a request may go unnoticed by one who waits."""


class StopFlag:
    """Whether the end has been asked for.

    Notes
    -----
    A `threading.Event` takes a lock in `set` and in `wait`. A handler runs in the thread that it interrupts: one that
    sets the event for which its own thread waits may find the lock taken for ever. This is a plain flag instead, and
    who waits for it looks again and again.
    """

    def __init__(self) -> None:
        self._asked = False

    def set(self) -> None:
        """Ask for the end."""
        self._asked = True

    def is_set(self) -> bool:
        """Return whether the end has been asked for."""
        return self._asked

    def wait(self, timeout: float) -> bool:
        """Wait up to `timeout` s, shorter where the end is asked for; return whether it has been."""
        due = time.monotonic() + timeout
        while not self.is_set() and (left := due - time.monotonic()) > 0:
            time.sleep(min(left, NAP))
        return self.is_set()
