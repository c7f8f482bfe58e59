"""Naming moments and acknowledging alarms at the terminal: a word and Enter while the run is recorded."""

import os
import signal
import sys
import threading
from contextlib import suppress

from daq.cli.progress import Console
from daq.session.alarms import alarm_text
from daq.session.run import Marked

ACKNOWLEDGE = "ack"
"""Typed alone, this names no moment but takes note of the alarms."""


def take_marks(run: Marked, console: Console) -> bool:
    """Let every line that is typed name a moment, or acknowledge; return whether there is a terminal to type at.

    The lines are read until the run has ended or the terminal is closed, past Python's own buffer: a thread that waits
    in it would hold up the end of the program.
    """
    if sys.stdin is None or not sys.stdin.isatty():
        return False
    if hasattr(signal, "SIGTTIN"):  # POSIX: a command in the background is told no, not put to sleep
        signal.signal(signal.SIGTTIN, signal.SIG_IGN)
    threading.Thread(target=_take, args=(sys.stdin.fileno(), run, console), name="marks", daemon=True).start()
    return True


def _take(terminal: int, run: Marked, console: Console) -> None:
    encoding = (os.device_encoding(terminal) if sys.platform == "win32" else None) or "utf-8"  # Windows: a code page
    with suppress(OSError):  # the terminal is gone, or somebody else's
        while typed := os.read(terminal, 1024):
            text = typed.decode(encoding, errors="replace").strip()
            if text == ACKNOWLEDGE:
                noted = run.acknowledge()
                console.line("\n".join(f"acknowledged {alarm_text(alarm)}" for alarm in noted) or "no new alarm")
                continue
            mark = run.mark(text)
            if mark is None:
                return
            console.line(f"marked “{mark.text}”")
