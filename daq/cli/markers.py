"""Naming moments and acknowledging alarms at the terminal: a word and Enter while the run is recorded.

Asking the service of a run that goes on in another terminal.
`rig acknowledge`: take note of the alarms of the run that goes on, from another terminal or a script.
`rig mark`: name the present moment of the run that is being recorded, from another terminal or a script.
"""

import argparse
import json
import os
import signal
import sys
import threading
import urllib.error
import urllib.request
from collections.abc import Mapping
from contextlib import suppress
from http import HTTPStatus
from typing import Any

from daq.cli.output.progress import Console
from daq.cli.output.terminal import print_json
from daq.errors import UsageError
from daq.session.alarms import alarm_text
from daq.session.run import SupportsMarkers

DEADLINE = 5.0  # s for the answer


def order(args: argparse.Namespace, path: str, content: Mapping[str, str]) -> dict[str, Any]:
    """Send an order and return the service's answer.

    Parameters
    ----------
    chosen : argparse.Namespace
        The command's options: host, port, token.
    path : str
        Under /api/v1/live.
    content : mapping of str to str
        What is sent.

    Raises
    ------
    UsageError
        There is no service there, or it says no.
    """
    where = f"http://{args.host}:{args.port}"
    headers = {"Content-Type": "application/json"}
    if args.token:
        headers["Authorization"] = f"Bearer {args.token}"
    address, body = f"{where}/api/v1/live/{path}", json.dumps(content).encode()
    request = urllib.request.Request(address, body, headers, method="POST")  # noqa: S310 - http
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))  # the bench is no matter for a proxy
    try:
        with opener.open(request, timeout=DEADLINE) as answer:
            made: dict[str, Any] = json.load(answer)
            return made
    except urllib.error.HTTPError as error:
        raise UsageError(f"{where}: {_problem(error)}") from error
    except (OSError, ValueError) as error:
        why = error.reason if isinstance(error, urllib.error.URLError) else error
        raise UsageError(f"{where} does not answer ({why}): is rig record running there, with its page?") from error


def _problem(error: urllib.error.HTTPError) -> str:
    """Return what a service says is wrong."""
    try:
        return str(json.load(error)["detail"])
    except (OSError, ValueError, KeyError, TypeError):
        return f"HTTP {error.code} {HTTPStatus(error.code).phrase}"


def run_acknowledge(args: argparse.Namespace) -> int:
    """Ask the run's service to note its alarms as seen; return the exit code."""
    made = order(args, "acknowledge", {})
    if args.json:
        print_json(made)
        return 0
    for alarm in made["alarms"]:
        print(f"acknowledged {alarm['name']}: {alarm['told']}")
    if not made["alarms"]:
        print("no new alarm")
    return 0


def run_mark(args: argparse.Namespace) -> int:
    """Ask the recording's service to keep a word; return the exit code."""
    made = order(args, "markers", {"text": " ".join(args.word) or "mark"})
    if args.json:
        print_json(made)
        return 0
    print(f"marked “{made['text']}” at {made['time_s']:.1f} s of segment {made['segment']}")
    return 0


ACKNOWLEDGE = "ack"
"""Typed alone, this names no moment but takes note of the alarms."""


def take_markers(run: SupportsMarkers, console: Console) -> bool:
    """Let every line that is typed name a moment, or acknowledge; return whether there is a terminal to type at.

    The lines are read until the run has ended or the terminal is closed, past Python's own buffer: a thread that waits
    in it would hold up the end of the program.
    """
    if sys.stdin is None or not sys.stdin.isatty():
        return False
    if hasattr(signal, "SIGTTIN"):  # POSIX: a command in the background is told no, not put to sleep
        signal.signal(signal.SIGTTIN, signal.SIG_IGN)
    threading.Thread(target=_take, args=(sys.stdin.fileno(), run, console), name="markers", daemon=True).start()
    return True


def _take(terminal: int, run: SupportsMarkers, console: Console) -> None:
    encoding = (os.device_encoding(terminal) if sys.platform == "win32" else None) or "utf-8"  # Windows: a code page
    with suppress(OSError):  # the terminal is gone, or somebody else's
        while typed := os.read(terminal, 1024):
            text = typed.decode(encoding, errors="replace").strip()
            if text == ACKNOWLEDGE:
                noted = run.acknowledge()
                console.line("\n".join(f"acknowledged {alarm_text(alarm)}" for alarm in noted) or "no new alarm")
                continue
            marker = run.add_marker(text)
            if marker is None:
                return
            console.line(f"marked “{marker.text}”")
