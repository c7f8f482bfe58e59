"""The kinds of value that the commands take as arguments, each with what is said of a wrong one."""

import argparse
import textwrap
from collections.abc import Callable
from pathlib import Path

_WIDTH = 78  # of a description: a help page is read on the smallest terminal


AddCommand = Callable[[str, Callable[[argparse.Namespace], int], str], argparse.ArgumentParser]


def show_examples(command: argparse.ArgumentParser, *examples: str) -> None:
    """Have a command's help end with examples of its use, line by line."""
    command.formatter_class = argparse.RawDescriptionHelpFormatter
    command.description = textwrap.fill(command.description or "", _WIDTH)
    label = "example:  " if len(examples) == 1 else "examples: "
    command.epilog = label + ("\n" + " " * len(label)).join(examples)


def add_folder(command: argparse.ArgumentParser) -> None:
    """Let a command be told where runs are kept."""
    command.add_argument("--folder", default="", help="where runs are kept (default: $RIG_DATA, else ./data)")


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
    """Return a factor such as 1 or 10; None for max."""
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


def port(text: str) -> int:
    """Return the number of a port."""
    if not text.isdigit() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a port from 0 (any free one) to 65535")
    return int(text)


def address(text: str) -> str:
    """Return the address of a device server."""
    host, _, number = text.rpartition(":")
    if not host or not number.isdigit():
        raise argparse.ArgumentTypeError(f"{text!r}: expected an address as host:port")
    return text


def calibration(text: str) -> tuple[str, Path]:
    """Return a probe's name and the file of its calibration."""
    name, _, file = text.partition("=")
    if not name or not file:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a probe and a file, such as x=probe-x.toml")
    return name, Path(file)
