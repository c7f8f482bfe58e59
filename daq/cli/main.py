"""Entry point of `rig`: installs the signal handlers, then imports and runs the command.

The commands are imported only when `main` runs, because every process that a command starts imports this module again.
"""

import signal
import sys
import time
from collections.abc import Sequence
from types import FrameType

from daq.stop_flag import EXIT_INTERRUPTED, stop_signals

GRACE_PERIOD = 10.0  # s after an interrupt, in which further signals are ignored so that the command can clean up


class _StopSignalHandler:
    """Signal handler that records a stop signal and, once enabled, raises KeyboardInterrupt as Ctrl-C does.

    Attributes
    ----------
    is_stop_received : bool
        Whether a signal has arrived.
    is_interrupting : bool
        Whether a signal raises KeyboardInterrupt; off while the command is imported and while it exits.
    """

    def __init__(self) -> None:
        self.is_stop_received = False
        self.is_interrupting = False
        self._interrupted_at = -GRACE_PERIOD

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        self.is_stop_received = True
        now = time.monotonic()
        if self.is_interrupting and now - self._interrupted_at >= GRACE_PERIOD:
            self._interrupted_at = now
            raise KeyboardInterrupt


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line; by default that of the process, whose child processes then end with the command.
    """
    handler = _StopSignalHandler()
    before = {number: signal.signal(number, handler) for number in stop_signals()}
    try:
        from daq.cli.commands import run

        handler.is_interrupting = True
        return EXIT_INTERRUPTED if handler.is_stop_received else run(arguments)
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    finally:
        handler.is_interrupting = False
        if arguments is None:
            _kill_children()
        for number, previous in before.items():  # at process exit Python would restore the system's default handlers
            signal.signal(number, signal.SIG_IGN if arguments is None else previous)


def _kill_children() -> None:
    """Kill child processes that a command left when it was interrupted during clean-up; Python would wait for them."""
    if "multiprocessing" not in sys.modules:  # no child was started
        return
    from multiprocessing import active_children

    for child in active_children():
        if child.daemon:  # a recorder is no daemon: it finishes its file
            child.kill()


if __name__ == "__main__":
    sys.exit(main())
