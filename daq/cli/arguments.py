"""Arguments that the commands share, the types of their values, exit codes, and the layout of help."""

import argparse
import math
import os
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path

from daq.cli.terminal import TerminalOutput

NOT_READY = 4  # exit code: preflight has a failed check, or the tacho signal does not switch
INCOMPLETE = 5  # exit code: samples are lost, or the recording is incomplete

HELP_WIDTH = 78  # columns of a description, for the smallest terminal
MAX_PORT = 65535
_DEFAULT_PORT = 8501
_TIME_UNITS = {"min": 60.0, "h": 3600.0, "s": 1.0, "": 1.0}  # s

Run = Callable[[argparse.Namespace, TerminalOutput], int]
"""Runs a command and returns its exit code."""

AddCommand = Callable[..., argparse.ArgumentParser]
"""Returns the parser of a command; takes name, function, functions that add shared arguments, and ``examples``."""


def show_examples(command: argparse.ArgumentParser, *examples: str) -> None:
    """Add examples, one a line, to the end of a command's help."""
    command.formatter_class = argparse.RawDescriptionHelpFormatter
    command.description = textwrap.fill(command.description or "", HELP_WIDTH)
    label = "example:  " if len(examples) == 1 else "examples: "
    command.epilog = label + ("\n" + " " * len(label)).join(examples)


def add_run(command: argparse.ArgumentParser) -> None:
    """Add the argument RUN, a recording, and the option `--folder` of its data folder."""
    command.add_argument("recording", metavar="RUN", help="run id or file")
    add_folder(command)


def add_folder(command: argparse.ArgumentParser) -> None:
    """Add the option `--folder`, the data folder."""
    command.add_argument("--folder", default="", help="data folder (default: $RIG_DATA, else ./data)")


def add_rig_file(command: argparse.ArgumentParser) -> None:
    """Add the argument RIG.TOML, a rig file."""
    command.add_argument("config", type=Path, metavar="RIG.TOML", help="rig file")


def add_json(command: argparse.ArgumentParser) -> None:
    """Add the option `--json`."""
    command.add_argument("--json", action="store_true", help="print JSON")


def add_service_address(parser: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    """Add the options `--host`, `--port` and `--token` of the page and REST that a command serves."""
    parser.add_argument(
        "--port", type=port, default=_DEFAULT_PORT, help=f"port of page and REST (default {_DEFAULT_PORT}; 0: any free)"
    )
    _add_host(parser, "address of page and REST (default: this machine only)")


def add_client_address(parser: argparse.ArgumentParser) -> None:
    """Add the options `--host`, `--port` and `--token` of the service that a command sends a request to."""
    parser.add_argument(
        "--port", type=client_port, default=_DEFAULT_PORT, help=f"port of the service (default {_DEFAULT_PORT})"
    )
    _add_host(parser, "address of the service (default: this machine)")


def _add_host(parser: argparse.ArgumentParser | argparse._ArgumentGroup, text: str) -> None:
    parser.add_argument("--host", default="127.0.0.1", help=text)
    token = os.environ.get("RIG_TOKEN", "")
    parser.add_argument(
        "--token",
        default=token,
        help="bearer token of requests, required with another --host; preferably set $RIG_TOKEN",
    )


def _number(
    text: str,
    expected: str,
    convert: Callable[[str], float],
    *,
    zero: bool = False,
    highest: float = sys.float_info.max,
) -> float:
    """Return a number above 0, or 0 where that is allowed; ArgumentTypeError names what was expected."""
    try:
        value = convert(text)
    except ValueError:
        value = math.nan
    if not (0 <= value <= highest and (value or zero)):
        raise argparse.ArgumentTypeError(f"{text!r}: expected {expected}")
    return value


def _seconds(text: str) -> float:
    unit = next(unit for unit in _TIME_UNITS if text.endswith(unit))
    return float(text.removesuffix(unit)) * _TIME_UNITS[unit]


def duration(text: str) -> float:
    """Return a time such as 60s, 5min or 1h in s."""
    return _number(text, "a time such as 60s, 5min or 1h", _seconds)


def time_in_run(text: str) -> float:
    """Return a time such as 0, 10s or 1.5min in s."""
    return _number(text, "a time such as 10s or 1.5min", _seconds, zero=True)


def pace(text: str) -> float | None:
    """Return a replay speed factor such as 1 or 10; None for max."""
    return None if text == "max" else _number(text, "a factor such as 1 or 10, or max", float)


def speed(text: str) -> float:
    """Return a speed, r/min."""
    return _number(text, "a speed in r/min, such as 15000", float)


def positive(text: str) -> float:
    """Return a number above 0."""
    return _number(text, "a number above 0", float)


def non_negative(text: str) -> float:
    """Return a number, 0 or more."""
    return _number(text, "a number, 0 or more", float, zero=True)


def positive_integer(text: str) -> int:
    """Return a whole number above 0."""
    return int(_number(text, "a whole number above 0", _digits))


def _digits(text: str) -> int:
    if not text.isdecimal():
        raise ValueError(text)
    return int(text)


def client_port(text: str) -> int:
    """Return the TCP port number of a service to connect to."""
    return int(_number(text, "a port from 1 to 65535", _digits, highest=MAX_PORT))


def port(text: str) -> int:
    """Return a TCP port number to listen on."""
    return int(_number(text, "a port from 0 (any free port) to 65535", _digits, zero=True, highest=MAX_PORT))


def address(text: str) -> str:
    """Return the host:port of a device server."""
    host, _, number = text.rpartition(":")
    if not host or not number.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r}: expected an address as host:port")
    return text


def calibration(text: str) -> tuple[str, Path]:
    """Return a probe's name and its calibration file."""
    name, _, file = text.partition("=")
    if not name or not file:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a probe and a file, such as x=probe-x.toml")
    return name, Path(file)
