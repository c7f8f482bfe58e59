"""The request for the end, which may come at any instant: from a thread, and from the handler of a signal."""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

POLL_INTERVAL = 0.05
"""So long, s, a request may go unnoticed by one who waits."""

EXIT_INTERRUPTED = 130
"""Exit code of what was stopped by hand."""

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")  # SIGHUP: POSIX only; SIGBREAK: Windows only


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
            time.sleep(min(left, POLL_INTERVAL))
        return self.is_set()


def stop_signals() -> list[signal.Signals]:
    """Return the signals that ask for the end; not SIGHUP where the command was begun with nohup."""
    known = [getattr(signal, name) for name in _NAMES if hasattr(signal, name)]
    return [number for number in known if number.name != "SIGHUP" or signal.getsignal(number) != signal.SIG_IGN]


@contextmanager
def stop_on_signals() -> Iterator[StopFlag]:
    """Give a flag that is set when the operator or the system asks for the end."""
    flag = StopFlag()

    def ask(_number: int, _frame: FrameType | None) -> None:
        flag.set()

    before = {number: signal.signal(number, ask) for number in stop_signals()}
    try:
        yield flag
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
