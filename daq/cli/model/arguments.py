"""What the commands of `rig model` share: number ranges, the model of a file, output as table, JSON and plot."""

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from daq.cli.terminal import NumberTable, print_json, print_output
from daq.config.loader import load_rig
from daq.config.rig import model_parameters, parameters_from_tables, read_rotor
from daq.errors import ConfigError, UsageError
from daq.schemas.study import study_schema
from model.rotor.gj90c import gj90c
from model.rotor.parameters import ModelParameters
from model.rotor.tables import TableError
from model.studies.study import Plot, Study, Surface
from recordings.file_operations import atomic_write

FloatArray = NDArray[np.float64]

MAX_VALUES = 1_000_000  # values in a range
FORMATS = (".svg", ".png", ".pdf")


def add_model_file(command: argparse.ArgumentParser) -> None:
    """Add the argument RIG.TOML, a rig file or rotor file, of which the default is the GJ90C of the thesis."""
    command.add_argument(
        "config",
        type=Path,
        metavar="RIG.TOML",
        nargs="?",
        help="rig file with [model], or rotor file (default: the GJ90C of the thesis)",
    )


def parameters_of(file: Path | None) -> ModelParameters:
    """Return the model parameters of a rig file or rotor file; without a file the GJ90C of the thesis.

    Raises
    ------
    ConfigError
        If the file cannot be read or is invalid.
    """
    if file is None:
        return gj90c()
    tables = read_rotor(file)
    if "station" not in tables:  # only a rotor file has stations
        return model_parameters(load_rig(file).config)
    try:
        return parameters_from_tables(tables)
    except TableError as error:
        raise ConfigError(str(file), list(error.faults)) from error


def number_range(text: str) -> FloatArray:
    """Return the values of FIRST:LAST:COUNT, of FIRST:LAST:COUNT:log, or of A,B,C."""
    try:
        found = _range(text.split(":")) if ":" in text else np.array([float(part) for part in text.split(",")])
    except ValueError:
        found = np.empty(0)
    if not (found.size and np.isfinite(found).all()):
        raise argparse.ArgumentTypeError(
            f"{text!r}: expected FIRST:LAST:COUNT (count 2 or more), FIRST:LAST:COUNT:log, or values with commas"
        )
    return found


def _range(parts: list[str]) -> FloatArray:
    """Return the values of a range; empty if it is invalid."""
    if len(parts) not in {3, 4} or parts[3:] not in ([], ["log"]):
        return np.empty(0)
    first, last, count, is_log = float(parts[0]), float(parts[1]), int(parts[2]), len(parts) == 4
    if not 2 <= count <= MAX_VALUES or not (math.isfinite(first) and math.isfinite(last)):
        return np.empty(0)
    if is_log and not (first > 0 and last > 0):
        return np.empty(0)
    return np.geomspace(first, last, count) if is_log else np.linspace(first, last, count)


def rising_range(text: str) -> FloatArray:
    """Return two or more rising values above 0."""
    found = number_range(text)
    if found.size < 2 or not found[0] > 0 or np.any(np.diff(found) <= 0):
        raise argparse.ArgumentTypeError(f"{text!r}: expected two or more rising values above 0, such as 100:2000:40")
    return found


def plot_file(text: str) -> Path:
    """Return the file of a plot."""
    file = Path(text)
    if file.suffix.lower() not in FORMATS:
        raise argparse.ArgumentTypeError(f"{text}: expected a name that ends with {', '.join(FORMATS)}")
    return file


def show_study(study: Study, *, as_json: bool) -> None:
    """Print a study as a table with remarks, or as JSON."""
    if as_json:
        print_json(study_schema(study))
    else:
        columns = list(zip(*(row.values() for row in study.rows()), strict=True))
        print_output(study.title, NumberTable(list(study.columns), columns), *study.remarks)


def save(plots: Sequence[Plot | Surface], file: Path) -> None:
    """Draw plots, one below the other, into an SVG, PNG or PDF file."""
    from daq.reports.plots.layouts import study_panels
    from daq.reports.plots.render import render

    try:
        with atomic_write(file) as temporary:
            temporary.write_bytes(render(study_panels(plots), file.suffix.lower().removeprefix(".")))
    except OSError as error:
        raise UsageError(f"{file}: {error.strerror or error}, expected a writable file") from error
