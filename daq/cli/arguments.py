"""Argument types that the commands share, the exit codes, and how a command's help is laid out."""

import argparse
import os
import textwrap
from collections.abc import Callable
from pathlib import Path

NOT_READY = 4  # exit code: preflight has a failed check, or the tacho signal does not switch
INCOMPLETE = 5  # exit code: samples are lost, or the recording is incomplete

_DEFAULT_PORT = 8501
_WIDTH = 78  # columns of a description, for the smallest terminal

AddCommand = Callable[[str, Callable[[argparse.Namespace], int]], argparse.ArgumentParser]
"""Gives the parser of a command, to which its arguments are added; takes its name and its function."""


def show_examples(command: argparse.ArgumentParser, *examples: str) -> None:
    """Add examples, one a line, to the end of a command's help."""
    command.formatter_class = argparse.RawDescriptionHelpFormatter
    command.description = textwrap.fill(command.description or "", _WIDTH)
    label = "example:  " if len(examples) == 1 else "examples: "
    command.epilog = label + ("\n" + " " * len(label)).join(examples)


def add_folder(command: argparse.ArgumentParser) -> None:
    """Add the option `--folder`, the data folder."""
    command.add_argument("--folder", default="", help="data folder (default: $RIG_DATA, else ./data)")


def add_service_address(parser: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    """Add the options `--host`, `--port` and `--token` of the page and REST that a command serves."""
    parser.add_argument("--host", default="127.0.0.1", help="address of page and REST (default: this machine only)")
    parser.add_argument(
        "--port", type=port, default=_DEFAULT_PORT, help=f"port of page and REST (default {_DEFAULT_PORT}; 0: any free)"
    )
    _add_token(parser)


def add_client_address(parser: argparse.ArgumentParser) -> None:
    """Add the options `--host`, `--port` and `--token` of the service that a command sends a request to."""
    parser.add_argument("--host", default="127.0.0.1", help="address of the service (default: this machine)")
    parser.add_argument(
        "--port", type=client_port, default=_DEFAULT_PORT, help=f"port of the service (default {_DEFAULT_PORT})"
    )
    _add_token(parser)


def _add_token(parser: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    parser.add_argument(
        "--token",
        default=os.environ.get("RIG_TOKEN", ""),
        help="bearer token of requests, required with another --host; preferably set $RIG_TOKEN",
    )


def duration(text: str) -> float:
    """Return a time such as 60s, 5min or 1h in s."""
    units = {"s": 1.0, "min": 60.0, "h": 3600.0}
    for unit in ("min", "s", "h"):
        if text.endswith(unit):
            number, factor = text.removesuffix(unit), units[unit]
            break
    else:
        number, factor = text, 1.0
    try:
        seconds = float(number) * factor
    except ValueError:
        seconds = 0.0
    if not 0 < seconds < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a time such as 60s, 5min or 1h")
    return seconds


def pace(text: str) -> float | None:
    """Return a replay speed factor such as 1 or 10; None for max."""
    if text == "max":
        return None
    try:
        factor = float(text)
    except ValueError:
        factor = 0.0
    if not 0 < factor < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a factor such as 1 or 10, or max")
    return factor


def speed(text: str) -> float:
    """Return a speed, r/min."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a speed in r/min, such as 15000")
    return value


def client_port(text: str) -> int:
    """Return the TCP port number of a service to connect to."""
    if not text.isdigit() or not 0 < int(text) <= 65535:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a port from 1 to 65535")
    return int(text)


def port(text: str) -> int:
    """Return a TCP port number to listen on."""
    if not text.isdigit() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a port from 0 (any free port) to 65535")
    return int(text)


def address(text: str) -> str:
    """Return the host:port of a device server."""
    host, _, number = text.rpartition(":")
    if not host or not number.isdigit():
        raise argparse.ArgumentTypeError(f"{text!r}: expected an address as host:port")
    return text


def calibration(text: str) -> tuple[str, Path]:
    """Return a probe's name and its calibration file."""
    name, _, file = text.partition("=")
    if not name or not file:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a probe and a file, such as x=probe-x.toml")
    return name, Path(file)
