"""Child processes: started with terminal signals blocked, run at low priority, and terminated reliably."""

import ctypes
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.process import BaseProcess
from types import FrameType

JOIN_TIMEOUT = 2.0  # s that a process has to end by itself
_BELOW_NORMAL_PRIORITY_CLASS = 0x4000  # of the Windows API
# The terminal sends these to all its processes. SIGHUP: POSIX only; SIGBREAK: Windows only.
_TERMINAL_SIGNALS = ("SIGINT", "SIGHUP", "SIGBREAK")


def lower_priority(steps: int = 5) -> None:
    """Lower the priority of this process.

    Parameters
    ----------
    steps : int
        Increase of the niceness, 1 to 19. Windows has a single step.
    """
    if sys.platform == "win32":
        kernel = ctypes.windll.kernel32
        kernel.SetPriorityClass(kernel.GetCurrentProcess(), _BELOW_NORMAL_PRIORITY_CLASS)
    else:
        os.nice(steps)


@contextmanager
def terminal_signals_blocked() -> Iterator[None]:
    """Block terminal signals in processes started here until they ignore them themselves.

    Without this, Ctrl-C ends a process that is still importing with a traceback. On Windows it does.
    """
    if sys.platform == "win32":
        yield
        return
    from multiprocessing.resource_tracker import ensure_running  # noqa: PLC0415 - POSIX only

    blocked = {getattr(signal, name) for name in _TERMINAL_SIGNALS if hasattr(signal, name)}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, blocked)
    try:
        ensure_running()  # otherwise the first process start runs it, and it unblocks the signals
        signal.pthread_sigmask(signal.SIG_BLOCK, blocked)
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def start_process(process: BaseProcess) -> None:
    """Start a process whose target first calls `leave_signals_to_parent` or `ignore_terminal_signals`."""
    with terminal_signals_blocked():
        process.start()


def leave_signals_to_parent() -> None:
    """Ignore terminal signals, which the parent handles, and exit cleanly when the parent sends SIGTERM."""
    ignore_terminal_signals()
    signal.signal(signal.SIGTERM, _exit)


def ignore_terminal_signals() -> None:
    """Ignore Ctrl-C and a closed terminal: the parent decides what they mean."""
    for name in _TERMINAL_SIGNALS:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)


def end_process(process: BaseProcess) -> None:
    """Terminate a started process and join it; kill it where it does not end, for example because it is suspended."""
    process.terminate()
    process.join(JOIN_TIMEOUT)
    if process.is_alive():
        process.kill()
        process.join(JOIN_TIMEOUT)


def _exit(_number: int, _frame: FrameType | None) -> None:
    sys.exit(1)
