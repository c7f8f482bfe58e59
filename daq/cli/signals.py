"""Ctrl-C, SIGTERM and a closed terminal all mean the same: stop, and finish the file."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from daq.stopping import StopFlag


def _signals() -> list[signal.Signals]:
    names = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")  # SIGHUP: POSIX only; SIGBREAK: Windows only
    return [getattr(signal, name) for name in names if hasattr(signal, name)]


@contextmanager
def stop_requested() -> Iterator[StopFlag]:
    """Give a flag that is set when the operator or the system asks for the end."""
    flag = StopFlag()

    def ask(_number: int, _frame: FrameType | None) -> None:
        flag.set()

    before = {number: signal.signal(number, ask) for number in _signals()}
    try:
        yield flag
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
