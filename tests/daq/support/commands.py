"""The command `rig` in a process of its own: how tests start it, stop it and check what it leaves behind."""

import json
import os
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil
import pytest

TIMEOUT = 60.0  # s, generous for a loaded machine
POSIX = pytest.mark.skipif(sys.platform == "win32", reason="signals and terminals of POSIX")
STEADY = [{"time_s": 0, "speed_rpm": 3000}, {"time_s": 60, "speed_rpm": 3000}]
REAL_TIME_MINUTE = {"profile": STEADY, "pace": "real time"}  # [simulation] of a run that tests stop
_CAUGHT = "SigCgt:"


def record_command(rig: Path) -> list[str]:
    """Return the command line that records a rig without the live picture, on any free port."""
    return [sys.executable, "-m", "daq.cli.main", "record", str(rig), "--no-view", "--port", "0"]


def recorded_samples(address: str) -> int:
    """Return the samples per channel that the live endpoint reports; 0 before the run has started."""
    with urllib.request.urlopen(f"{address}/api/v1/live", timeout=10) as response:  # noqa: S310 - loopback
        status = json.load(response)["status"]
    return int(status["samples"])


@dataclass(frozen=True, slots=True)
class StopRequest:
    """When and how a command is stopped.

    Parameters
    ----------
    number : signal.Signals
        The signal, sent to all processes of the command as a terminal does, or to the command alone.
    delay : float
        After the command has installed its signal handler, s.
    repeat_after : float or None
        Time to a second signal, s; None for one signal.
    main_process_only : bool
        Whether only the command gets the signal, as from a program that stops it.
    """

    number: signal.Signals
    delay: float
    repeat_after: float | None = None
    main_process_only: bool = False


@dataclass(frozen=True, slots=True)
class StoppedCommand:
    """What a stopped command left.

    Parameters
    ----------
    code : int
        Its exit code.
    out, err : str
        What it printed.
    stop_time : float
        From the first signal to the exit, s.
    processes : tuple of str
        Names of its processes that still run.
    """

    code: int
    out: str
    err: str
    stop_time: float
    processes: tuple[str, ...]


def run_and_stop(
    arguments: Sequence[str], environment: Mapping[str, str], folder: Path, request: StopRequest
) -> StoppedCommand:
    """Start a command, stop it as requested, wait for its exit and return what it left."""
    out, err = folder / "out", folder / "err"
    with out.open("w") as stdout, err.open("w") as stderr:
        process = subprocess.Popen(
            [sys.executable, "-m", "daq.cli.main", *arguments],
            env=dict(environment),
            stdin=subprocess.DEVNULL,
            stdout=stdout,
            stderr=stderr,
            start_new_session=True,
        )
    try:
        _wait_for_signal_handler(process)
        stopped_at = time.monotonic()
        for wait in (request.delay, request.repeat_after):
            if wait is not None and _still_runs_after(process, wait):
                stopped_at = stopped_at if wait is request.repeat_after else time.monotonic()
                (os.kill if request.main_process_only else os.killpg)(process.pid, request.number)
        code = process.wait(TIMEOUT)
        stop_time = time.monotonic() - stopped_at
    finally:
        process.kill()
        process.wait()
    return StoppedCommand(code, out.read_text(), err.read_text(), stop_time, remaining_processes(process.pid))


def _wait_for_signal_handler(process: subprocess.Popen[bytes]) -> None:
    """Wait until the command's own signal handler is installed; before that, signals meet Python's start-up."""
    nohup = signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    bit = 1 << ((signal.SIGTERM if nohup else signal.SIGHUP) - 1)
    deadline = time.monotonic() + TIMEOUT
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


def remaining_processes(session: int) -> tuple[str, ...]:
    """Return the processes of a session that still run after 10 s, and kill them."""
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
