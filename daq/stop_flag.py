"""Stop requests: a flag that threads and signal handlers may set at any time, and the signals that set it."""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

POLL_INTERVAL = 0.05
"""Longest delay, s, before a waiting thread notices the flag."""

EXIT_INTERRUPTED = 130
"""Exit code of a command that the operator stopped."""

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")  # SIGHUP: POSIX only; SIGBREAK: Windows only


class StopFlag:
    """A request to stop.

    Notes
    -----
    This is a plain flag, polled by waiting threads, not a `threading.Event`: an event takes a lock in `set` and in
    `wait`. A signal handler runs in the thread that it interrupts. If that thread waits for the event and the handler
    sets it, the lock may already be taken, and the thread hangs for ever.
    """

    def __init__(self) -> None:
        self._is_set = False

    def set(self) -> None:
        """Request the stop."""
        self._is_set = True

    def is_set(self) -> bool:
        """Return whether the stop has been requested."""
        return self._is_set

    def wait(self, timeout: float) -> bool:
        """Wait up to `timeout` s for a stop request; return whether there is one."""
        due = time.monotonic() + timeout
        while not self.is_set() and (left := due - time.monotonic()) > 0:
            time.sleep(min(left, POLL_INTERVAL))
        return self.is_set()


def stop_signals() -> list[signal.Signals]:
    """Return the signals that request a stop; without SIGHUP if the command was started with nohup."""
    known = [getattr(signal, name) for name in _NAMES if hasattr(signal, name)]
    return [number for number in known if number.name != "SIGHUP" or signal.getsignal(number) != signal.SIG_IGN]


@contextmanager
def stop_on_signals() -> Iterator[StopFlag]:
    """Yield a flag that the stop signals set; restore the previous handlers at the end."""
    flag = StopFlag()

    def set_flag(_number: int, _frame: FrameType | None) -> None:
        flag.set()

    before = {number: signal.signal(number, set_flag) for number in stop_signals()}
    try:
        yield flag
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
