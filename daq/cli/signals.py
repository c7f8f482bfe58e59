"""Ctrl-C, SIGTERM and a closed terminal all mean the same: stop, and finish the file."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from daq.stop_flag import StopFlag

STOPPED = 130
"""Exit code of what was stopped by hand."""

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")  # SIGHUP: POSIX only; SIGBREAK: Windows only


def heeded() -> list[signal.Signals]:
    """Return the signals that ask for the end; not SIGHUP where the command was begun with nohup."""
    known = [getattr(signal, name) for name in _NAMES if hasattr(signal, name)]
    return [number for number in known if number.name != "SIGHUP" or signal.getsignal(number) != signal.SIG_IGN]


@contextmanager
def stop_requested() -> Iterator[StopFlag]:
    """Give a flag that is set when the operator or the system asks for the end."""
    flag = StopFlag()

    def ask(_number: int, _frame: FrameType | None) -> None:
        flag.set()

    before = {number: signal.signal(number, ask) for number in heeded()}
    try:
        yield flag
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
