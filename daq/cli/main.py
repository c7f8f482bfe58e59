"""Where `rig` begins: whatever asks for its end, at whatever moment, ends it tidily and without a word.

The commands are imported only when this runs: every process that one of them starts imports this module again.
"""

import signal
import sys
import time
from collections.abc import Sequence
from types import FrameType

from daq.stop_flag import EXIT_INTERRUPTED, stop_signals

GRACE = 10.0  # s in which a command that was interrupted tidies up, and is not interrupted again


class _Asked:
    """What a request for the end does: it is noted, or it interrupts what goes on as Ctrl-C does."""

    def __init__(self) -> None:
        self.is_noted = False
        self.interrupts = False
        self._interrupted = -GRACE

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        self.is_noted = True
        now = time.monotonic()
        if self.interrupts and now - self._interrupted >= GRACE:
            self._interrupted = now
            raise KeyboardInterrupt


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Those of the process where they are not given; then the process ends with the command.
    """
    asked = _Asked()
    before = {number: signal.signal(number, asked) for number in stop_signals()}
    try:
        from daq.cli.commands import run  # noqa: PLC0415 - takes a second, in which Ctrl-C already works

        asked.interrupts = True
        return EXIT_INTERRUPTED if asked.is_noted else run(arguments)
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    finally:
        asked.interrupts = False
        if arguments is None:
            _end_children()
        for number, handler in before.items():  # Python's own end would give them back to the system otherwise
            signal.signal(number, signal.SIG_IGN if arguments is None else handler)


def _end_children() -> None:
    """End what was left running by a command that was interrupted while it tidied up; Python's own end waits for it."""
    from multiprocessing import active_children  # noqa: PLC0415 - loaded by now if there are any

    for child in active_children():
        if child.daemon:  # a recorder is none: it finishes its file
            child.kill()


if __name__ == "__main__":
    sys.exit(main())
