"""Ranges as the commands take them: FIRST:LAST:COUNT, and values of the studies' options."""

import argparse
import math

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

MOST = 1_000_000  # values in a range


def values(text: str) -> FloatArray:
    """Return the values of FIRST:LAST:COUNT, of FIRST:LAST:COUNT:log, or of A,B,C."""
    try:
        found = _range(*text.split(":")) if ":" in text else np.array([float(part) for part in text.split(",")])
    except (TypeError, ValueError):
        found = np.empty(0)
    if not (found.size and np.isfinite(found).all()):
        raise argparse.ArgumentTypeError(
            f"{text!r}: expected FIRST:LAST:COUNT (count 2 or more), FIRST:LAST:COUNT:log, or values with commas"
        )
    return found


def _range(first: str, last: str, count: str, scale: str = "") -> FloatArray:
    """Return a range; none where it makes no sense."""
    start, stop, number = float(first), float(last), int(count)
    if not (math.isfinite(start) and math.isfinite(stop)):
        return np.empty(0)
    if not 2 <= number <= MOST or scale not in {"", "log"} or (scale == "log" and not (start > 0 and stop > 0)):
        return np.empty(0)
    return np.geomspace(start, stop, number) if scale == "log" else np.linspace(start, stop, number)


def rising(text: str) -> FloatArray:
    """Return rising values above 0, two or more."""
    found = values(text)
    if found.size < 2 or not found[0] > 0 or np.any(np.diff(found) <= 0):
        raise argparse.ArgumentTypeError(f"{text!r}: expected two or more rising values above 0, as 100:2000:40")
    return found


def positive(text: str) -> float:
    """Return a number above 0."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not (math.isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number above 0")
    return value


def not_negative(text: str) -> float:
    """Return a number, 0 or more."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not (math.isfinite(value) and value >= 0):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number, 0 or more")
    return value


def counting(text: str) -> int:
    """Return a whole number above 0."""
    if not text.isdigit() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number above 0")
    return int(text)
