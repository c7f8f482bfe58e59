"""A command that is asked for its end at some moment, and what it leaves behind."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil

PATIENCE = 60.0  # s for what takes a moment on a machine that has time
_CAUGHT = "SigCgt:"


@dataclass(frozen=True, slots=True)
class Asked:
    """When and how the end of a command is asked for.

    Parameters
    ----------
    number : signal.Signals
        By what, sent to all its processes as a terminal does, or to the command alone.
    moment : float
        After the command has begun to heed it, s.
    again : float or None
        After the first time, s, where it is asked for twice.
    alone : bool
        Whether only the command is asked, as a program does that stops it.
    """

    number: signal.Signals
    moment: float
    again: float | None = None
    alone: bool = False


@dataclass(frozen=True, slots=True)
class Left:
    """What became of a command.

    Parameters
    ----------
    code : int
        Its exit code.
    out, err : str
        What it printed.
    took : float
        From the first time that its end was asked for to its end, s.
    processes : tuple of str
        What of it still runs: names of processes.
    """

    code: int
    out: str
    err: str
    took: float
    processes: tuple[str, ...]


def ended(arguments: Sequence[str], environment: Mapping[str, str], folder: Path, asked: Asked) -> Left:
    """Begin a command, ask for its end and wait for it."""
    out, err = folder / "out", folder / "err"
    with out.open("w") as printed, err.open("w") as told:
        process = subprocess.Popen(
            [sys.executable, "-m", "daq.cli.main", *arguments],
            env=dict(environment),
            stdin=subprocess.DEVNULL,
            stdout=printed,
            stderr=told,
            start_new_session=True,
        )
    try:
        _await_heeding(process)
        begun = time.monotonic()
        for wait in (asked.moment, asked.again):
            if wait is not None and _still_runs_after(process, wait):
                begun = begun if wait is asked.again else time.monotonic()
                (os.kill if asked.alone else os.killpg)(process.pid, asked.number)
        code = process.wait(PATIENCE)
        took = time.monotonic() - begun
    finally:
        process.kill()
        process.wait()
    return Left(code, out.read_text(), err.read_text(), took, remaining(process.pid))


def _await_heeding(process: subprocess.Popen[bytes]) -> None:
    """Wait until Python has begun the command: what comes before is Python's own, or of who measures coverage."""
    nohup = signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    bit = 1 << ((signal.SIGTERM if nohup else signal.SIGHUP) - 1)
    deadline = time.monotonic() + PATIENCE
    status = Path(f"/proc/{process.pid}/status")
    while process.poll() is None:
        line = next(line for line in status.read_text().splitlines() if line.startswith(_CAUGHT))
        if int(line.removeprefix(_CAUGHT), 16) & bit:
            return
        assert time.monotonic() < deadline
        time.sleep(0.001)


def _still_runs_after(process: subprocess.Popen[bytes], wait: float) -> bool:
    try:
        process.wait(wait)
    except subprocess.TimeoutExpired:
        return True
    return False


def remaining(session: int) -> tuple[str, ...]:
    """Return the processes of a session that are still there after a while, and end them."""
    deadline = time.monotonic() + 10.0
    while (remaining := [one for one in psutil.process_iter() if _is_of(one, session)]) and time.monotonic() < deadline:
        time.sleep(0.02)
    names = tuple(" ".join(one.cmdline()[-3:]) for one in remaining)
    for one in remaining:
        one.kill()
    return names


def _is_of(process: psutil.Process, session: int) -> bool:
    try:
        return os.getsid(process.pid) == session and process.status() != psutil.STATUS_ZOMBIE
    except (ProcessLookupError, psutil.NoSuchProcess):
        return False
