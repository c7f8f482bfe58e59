"""Arguments of `rig model`: number ranges and values, model parameters of a file, errors of the model."""

import argparse
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from daq.config.loader import load_rig
from daq.config.rig import model_parameters, parameters_from_tables, read_rotor
from daq.errors import ConfigError, RigError, UsageError
from model.errors import ModelError, ParameterError
from model.rotor.gj90c import gj90c
from model.rotor.parameters import ModelParameters
from model.rotor.tables import TableError

FloatArray = NDArray[np.float64]

MAX_VALUES = 1_000_000  # values in a range


def parameters_of(config: str | None) -> ModelParameters:
    """Return the model parameters of a rig file or rotor file; without a file the GJ90C of the thesis.

    Raises
    ------
    ConfigError
        If the file cannot be read or is invalid.
    """
    if config is None:
        return gj90c()
    file = Path(config)
    tables = read_rotor(file)
    if "station" not in tables:  # only a rotor file has stations
        return model_parameters(load_rig(file).config)
    try:
        return parameters_from_tables(tables)
    except TableError as error:
        raise ConfigError(config, list(error.faults)) from error


@contextmanager
def model_errors() -> Iterator[None]:
    """Convert errors of the model to errors of the command line."""
    try:
        yield
    except ParameterError as error:
        raise UsageError(str(error)) from error
    except ModelError as error:
        raise RigError(str(error)) from error


def number_range(text: str) -> FloatArray:
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
    """Return the values of a range; empty if it is invalid."""
    start, stop, number = float(first), float(last), int(count)
    if not (math.isfinite(start) and math.isfinite(stop)):
        return np.empty(0)
    if not 2 <= number <= MAX_VALUES or scale not in {"", "log"} or (scale == "log" and not (start > 0 and stop > 0)):
        return np.empty(0)
    return np.geomspace(start, stop, number) if scale == "log" else np.linspace(start, stop, number)


def rising_range(text: str) -> FloatArray:
    """Return two or more rising values above 0."""
    found = number_range(text)
    if found.size < 2 or not found[0] > 0 or np.any(np.diff(found) <= 0):
        raise argparse.ArgumentTypeError(f"{text!r}: expected two or more rising values above 0, such as 100:2000:40")
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


def non_negative(text: str) -> float:
    """Return a number, 0 or more."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not (math.isfinite(value) and value >= 0):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number, 0 or more")
    return value


def positive_integer(text: str) -> int:
    """Return a whole number above 0."""
    if not text.isdigit() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number above 0")
    return int(text)
