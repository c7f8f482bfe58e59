"""`rig calibrate`: a probe's calibration from micrometer steps, and the tacho's switching levels from its signal."""

import argparse
import csv
import datetime as dt
import math
import sys
from collections.abc import Iterator, Sequence
from itertools import count
from pathlib import Path

import numpy as np

from analysis.preflight.calibration import CalibrationFit, default_order, fit_calibration
from analysis.signals.errors import CalibrationFitError
from analysis.signals.units import MICROMETRE, MILLIVOLT
from daq.cli.arguments import NOT_READY, AddCommand
from daq.cli.terminal import print_json
from daq.config.calibration import (
    CalibrationMetadata,
    CalibrationRecord,
    fitted_record,
    load_calibration,
    load_record,
    write_record,
)
from daq.config.loader import load_rig
from daq.config.rig import Rig
from daq.errors import DeviceError, UsageError
from daq.schemas.checks import gap_calibration_schema, tacho_calibration_schema
from daq.session.calibration import (
    CalibrationPoint,
    measure_point,
    measure_tacho_levels,
    probe_row,
    read_points,
)

_EXAMPLES = """\
examples:   rig calibrate gap rigs/usb6251.toml x --operator "M. Curie"
            rig calibrate gap rigs/usb6251.toml x --points sheet.csv --order 4
"""


def measure_steps(rig: Rig, name: str, path: Path) -> list[CalibrationPoint]:
    """Prompt for the gap of each micrometer step, measure its voltage, and return the points.

    Parameters
    ----------
    rig : Rig
        The rig.
    name : str
        The probe's channel.
    path : Path
        The calibration record to be written; Ctrl-C saves the points beside it.

    Raises
    ------
    DeviceError
        The first step cannot be measured; a later one can be repeated.
    """
    physical = rig.config.channel[probe_row(rig, name)].physical
    _print_message(
        f"probe {name} on {physical}: set the micrometer, wait until it is still, and enter the gap in µm (0 where the "
        "tip touches).\nAn empty line ends; a - removes the last step."
    )
    points: list[CalibrationPoint] = []
    try:
        while typed := _prompt(len(points) + 1):
            _measure_step(typed, points, rig, name)
    except KeyboardInterrupt:
        if points:
            _print_message(f"\n{len(points)} points saved to {save_points(path, points)}: use them with --points")
        raise
    _print_message("")
    return points


def save_points(path: Path, points: Sequence[CalibrationPoint]) -> Path:
    """Write points to a new CSV file beside their calibration record; return the file."""
    stems = (path.stem if number == 1 else f"{path.stem}-{number}" for number in count(1))
    saved = next(file for file in (path.with_name(f"{stem}.csv") for stem in stems) if not file.exists())
    saved.parent.mkdir(parents=True, exist_ok=True)
    with saved.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["gap_um", "volts"])
        writer.writerows((f"{point.gap / MICROMETRE:g}", f"{point.volts:.6f}") for point in points)
    return saved


def _prompt(step: int) -> str:
    print(f"step {step}, gap in µm: ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip()


def _measure_step(typed: str, points: list[CalibrationPoint], rig: Rig, name: str) -> None:
    """Measure a point at the typed gap, or remove the last point for "-"."""
    if typed == "-":
        del points[-1:]
        return
    gap_um = _gap_um(typed)
    if gap_um is None:
        _print_message(f"{typed!r}: expected a gap in µm, 0 or more, such as 250")
        return
    try:
        points.append(measure_point(rig, name, gap_um * MICROMETRE))
    except DeviceError as error:
        if not points:
            raise
        _print_message(f"  not measured: {error}")
    else:
        _print_message(f"  {points[-1].volts:.4f} V, scatter {points[-1].scatter / MILLIVOLT:.1f} mV rms")


def _gap_um(typed: str) -> float | None:
    """Return a typed gap, µm, with decimal point or comma; None where it is no number from 0 on."""
    try:
        value = float(typed.replace(",", "."))
    except ValueError:
        return None
    return value if 0.0 <= value < math.inf else None


def _print_message(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


_HALF_PLOT_WIDTH = 15  # columns on either side of zero


def run_calibrate_gap(args: argparse.Namespace) -> int:
    """Calibrate a probe and write a new record; return the exit code."""
    rig = load_rig(Path(args.config))
    section = rig.config.channel[probe_row(rig, args.channel)]
    previous = load_record(rig.path.parent / section.calibration)
    today = dt.datetime.now().astimezone().date().isoformat()
    path = _new_path(rig, args, today)
    if path.exists():
        raise UsageError(f"{path}: exists already; calibration records are never overwritten")
    points = read_points(Path(args.points)) if args.points else measure_steps(rig, args.channel, path)
    record, fit = _fit_record(points, args, _metadata(args, previous, today), path)
    write_record(path, record)
    load_calibration(path)  # checks the written file as a rig will read it
    if args.json:
        print_json(gap_calibration_schema(args.channel, path, record, fit))
    else:
        print("\n".join(_fit_lines(points, fit)))
        print(f'{path}: written; to use it, set calibration = "{_relative_to_rig(path, rig)}" in {rig.path}')
    return 0


def run_calibrate_tacho(args: argparse.Namespace) -> int:
    """Propose the tacho's switching levels; return the exit code."""
    rig = load_rig(Path(args.config))
    levels = measure_tacho_levels(rig)
    if args.json:
        print_json(tacho_calibration_schema(rig.tacho, levels))
        return NOT_READY if levels is None else 0
    if levels is None:
        print(
            "the tacho does not switch between two levels: turn the shaft (by hand will do), check the keyphasor mark"
        )
        return NOT_READY
    print(
        f"the tacho switches between {levels.low:.2f} and {levels.high:.2f} V, "
        f"noise {levels.scatter / MILLIVOLT:.0f} mV rms, light for {100 * levels.high_fraction:.0f} % of the time\n"
        f"[tacho]\nthreshold_v = {levels.middle:.2f}\nhysteresis_v = {levels.hysteresis:.2f}"
    )
    low, high = rig.tacho.threshold - rig.tacho.hysteresis / 2, rig.tacho.threshold + rig.tacho.hysteresis / 2
    fits = levels.low < low and high < levels.high
    print(
        f"{rig.path} has threshold_v = {rig.tacho.threshold:g}, hysteresis_v = {rig.tacho.hysteresis:g}: its switching "
        f"levels {low:g} and {high:g} V {'lie' if fits else 'do NOT both lie'} between those of the signal"
    )
    return 0


def _new_path(rig: Rig, args: argparse.Namespace, today: str) -> Path:
    """Return the file to write: the one given by -o, or a new one beside the current record."""
    if args.output:
        return Path(args.output)
    folder = (rig.path.parent / rig.config.channel[probe_row(rig, args.channel)].calibration).parent
    names = (f"probe-{args.channel}-{today}{'' if number == 1 else f'-{number}'}.toml" for number in count(1))
    return next(folder / name for name in names if not (folder / name).exists())


def _relative_to_rig(path: Path, rig: Rig) -> str:
    """Return a path as the rig file refers to it: relative to its folder where it lies within."""
    try:
        return path.resolve().relative_to(rig.path.parent.resolve()).as_posix()
    except ValueError:
        return path.resolve().as_posix()


def _metadata(args: argparse.Namespace, previous: CalibrationRecord, today: str) -> CalibrationMetadata:
    """Return the metadata of the new record; options that are not given keep the previous record's values."""
    old = previous.calibration
    return CalibrationMetadata(
        date=today,
        sensor=args.sensor or old.sensor,
        conditioner=args.conditioner or old.conditioner,
        target=args.target or old.target,
        operator=args.operator,
        note=args.note,
    )


def _fit_record(
    points: Sequence[CalibrationPoint], args: argparse.Namespace, metadata: CalibrationMetadata, path: Path
) -> tuple[CalibrationRecord, CalibrationFit]:
    """Return record and fit of the points; if the fit fails, measured points are saved to a file."""
    gaps, volts = np.array([point.gap for point in points]), np.array([point.volts for point in points])
    order = args.order or default_order(len(points))
    try:
        fit = fit_calibration(gaps, volts, order)
    except CalibrationFitError as error:
        saved = ""
        if points and not args.points:
            saved = f"; the points are saved to {save_points(path, points)}: correct them there, then use --points"
        raise UsageError(f"no calibration fits the points: {error}{saved}") from error
    return fitted_record(fit, gaps, volts, metadata), fit


def _fit_lines(points: Sequence[CalibrationPoint], fit: CalibrationFit) -> Iterator[str]:
    """Yield the points with the residuals of the fit, as numbers and drawn to scale, line by line."""
    scale = max(fit.residual, 1e-12)
    yield f"{'gap µm':>9} {'volts':>9} {'scatter mV':>11} {'residual µm':>12}  {'0':>{_HALF_PLOT_WIDTH + 1}}"
    for point, residual in sorted(zip(points, fit.residuals, strict=True), key=lambda pair: pair[0].gap):
        column = _HALF_PLOT_WIDTH + round(_HALF_PLOT_WIDTH * float(residual) / scale)
        line = [" "] * (2 * _HALF_PLOT_WIDTH + 1)
        line[_HALF_PLOT_WIDTH], line[column] = "|", "o"
        scatter = "" if math.isnan(point.scatter) else f"{point.scatter / MILLIVOLT:.2f}"
        gap, off = point.gap / MICROMETRE, residual / MICROMETRE
        yield f"{gap:9.1f} {point.volts:9.4f} {scatter:>11} {off:+12.2f}  {''.join(line)}".rstrip()
    coefficients = ", ".join(f"{coefficient / MICROMETRE:.6g}" for coefficient in fit.coefficients)
    yield (
        f"order {fit.order}: gap_um = [{coefficients}] · volts^k from {fit.volts_low:.3f} to {fit.volts_high:.3f} V, "
        f"rising, largest residual {fit.residual / MICROMETRE:.2f} µm"
    )


def add_commands(add: AddCommand) -> None:
    """Add `rig calibrate` to the command line."""
    parser = add("calibrate", run_calibrate_gap)
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="KIND")
    text = (
        "Calibrate a probe from micrometer steps or from a file of points. Fits gap over\n"
        "voltage, prints the residuals and writes a new calibration record; records are\n"
        "never overwritten."
    )
    command = kinds.add_parser("gap", help="a probe's calibration curve", description=text)
    command.epilog, command.formatter_class = _EXAMPLES, argparse.RawDescriptionHelpFormatter
    command.set_defaults(run=run_calibrate_gap)
    command.add_argument("config", metavar="RIG.TOML", help="rig file")
    command.add_argument("channel", metavar="CHANNEL", help="the probe's channel, such as x")
    command.add_argument("--points", default="", metavar="FILE.CSV", help="points instead of steps: gap in µm, volts")
    command.add_argument(
        "--order", type=int, choices=range(1, 8), metavar="N", help="polynomial order, 1 to 7 (default: 3)"
    )
    command.add_argument("-o", dest="output", default="", metavar="NEW.TOML", help="new record (default: a new name)")
    command.add_argument("--sensor", default="", help="serial number (default: that of the current record)")
    command.add_argument("--conditioner", default="", help="serial number (default: that of the current record)")
    command.add_argument("--target", default="", help="material and diameter (default: those of the current record)")
    command.add_argument("--operator", default="", help="name of the operator")
    command.add_argument("--note", default="", help="note stored in the record")
    command.add_argument("--json", action="store_true", help="print JSON")
    text = "Propose the tacho's threshold and hysteresis from a second of its signal; the shaft must turn."
    command = kinds.add_parser("tacho", help="the tacho's switching levels", description=text)
    command.set_defaults(run=run_calibrate_tacho)
    command.add_argument("config", metavar="RIG.TOML", help="rig file")
    command.add_argument("--json", action="store_true", help="print JSON")
