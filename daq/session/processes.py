"""Processes beside the main one: begun out of reach of the terminal, and ended for good whatever they do.

Work that nobody waits for gives way to work that somebody does.
"""

import ctypes
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.process import BaseProcess
from types import FrameType

BELOW_NORMAL = 0x4000  # Windows' BELOW_NORMAL_PRIORITY_CLASS


def lower_priority(steps: int = 5) -> None:
    """Lower the priority of this process.

    Parameters
    ----------
    steps : int
        How far, 1 to 19, where the system knows steps; Windows knows one.
    """
    if sys.platform == "win32":
        kernel = ctypes.windll.kernel32
        kernel.SetPriorityClass(kernel.GetCurrentProcess(), BELOW_NORMAL)
    else:
        os.nice(steps)


JOIN_TIMEOUT = 2.0  # s that a process has to end by itself
_OF_THE_TERMINAL = ("SIGINT", "SIGHUP", "SIGBREAK")  # go to all its processes; SIGHUP: POSIX only, SIGBREAK: Windows


@contextmanager
def terminal_signals_blocked() -> Iterator[None]:
    """Keep from processes that are started here what the terminal sends, until they can ignore it themselves.

    Ctrl-C would end a process that still imports what it needs with a traceback. On Windows it does.
    """
    if sys.platform == "win32":
        yield
        return
    from multiprocessing.resource_tracker import ensure_running  # noqa: PLC0415 - POSIX only

    blocked = {getattr(signal, name) for name in _OF_THE_TERMINAL if hasattr(signal, name)}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, blocked)
    try:
        ensure_running()  # the first start of a process would start it, and it lifts the mask behind itself
        signal.pthread_sigmask(signal.SIG_BLOCK, blocked)
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def start_process(process: BaseProcess) -> None:
    """Start a process whose work begins with `leave_signals_to_parent` or `ignore_terminal_signals`."""
    with terminal_signals_blocked():
        process.start()


def leave_signals_to_parent() -> None:
    """Let the parent decide what Ctrl-C and a closed terminal mean, and end tidily when it ends this process."""
    ignore_terminal_signals()
    signal.signal(signal.SIGTERM, _exit)


def ignore_terminal_signals() -> None:
    """Let the parent decide what Ctrl-C and a closed terminal mean."""
    for name in _OF_THE_TERMINAL:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)


def end_process(process: BaseProcess) -> None:
    """End a process that was started and wait until it has, by force where it does not or stands still."""
    process.terminate()
    process.join(JOIN_TIMEOUT)
    if process.is_alive():
        process.kill()
        process.join(JOIN_TIMEOUT)


def _exit(_number: int, _frame: FrameType | None) -> None:
    sys.exit(1)
