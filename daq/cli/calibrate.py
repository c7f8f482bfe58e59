"""`rig calibrate`: a probe's curve from micrometer steps, and the tacho's switching levels from its signal.

The dialog of `rig calibrate gap`: the gap of each micrometer step is asked for, and its voltage measured.
"""

import argparse
import csv
import datetime as dt
import math
import sys
from collections.abc import Iterator, Sequence
from itertools import count
from pathlib import Path

import numpy as np

from analysis.preflight.calibration_fit import CalibrationFit, fit_calibration, usual_order
from daq.cli.arguments import NOT_READY, AddCommand
from daq.cli.output.terminal import print_json
from daq.config.calibration import (
    CalibrationMetadata,
    CalibrationRecord,
    fitted_record,
    load_calibration,
    load_record,
    write_record,
)
from daq.config.loader import load_rig
from daq.config.rig import MICRO, Rig
from daq.errors import DeviceError, UsageError
from daq.schemas.preflight import gap_calibration_schema, tacho_calibration_schema
from daq.session.preflight.calibration import (
    CalibrationPoint,
    measure_point,
    measure_tacho_levels,
    probe_row,
    read_points,
)

_STEPS_END = """\
examples:   rig calibrate gap rigs/usb6251.toml x --operator "M. Curie"
            rig calibrate gap rigs/usb6251.toml x --points sheet.csv --order 4
"""


def stepped(rig: Rig, name: str, path: Path) -> list[CalibrationPoint]:
    """Ask for the gap of each micrometer step, and measure it.

    Parameters
    ----------
    rig : Rig
        The rig.
    name : str
        Of the probe's channel.
    path : Path
        The record to be written; beside it the points are kept where the dialog breaks off.

    Raises
    ------
    DeviceError
        The first step cannot be measured; what fails later can be tried again.
    """
    physical = rig.config.channel[probe_row(rig, name)].physical
    _say(
        f"probe {name} on {physical}: set the micrometer, wait until it is still, and enter the gap in µm (0 where the "
        "tip touches).\nAn empty line ends; a - takes the last step back."
    )
    points: list[CalibrationPoint] = []
    try:
        while answer := _asked(len(points) + 1):
            _take(answer, points, rig, name)
    except KeyboardInterrupt:
        if points:
            _say(f"\nthe {len(points)} points are kept in {keep(path, points)}: give them with --points")
        raise
    _say("")
    return points


def keep(path: Path, points: Sequence[CalibrationPoint]) -> Path:
    """Write points as CSV beside a record of theirs, over nothing that is there; return the file."""
    stems = (path.stem if number == 1 else f"{path.stem}-{number}" for number in count(1))
    saved = next(file for file in (path.with_name(f"{stem}.csv") for stem in stems) if not file.exists())
    saved.parent.mkdir(parents=True, exist_ok=True)
    with saved.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["gap_um", "volts"])
        writer.writerows((f"{point.gap / MICRO:g}", f"{point.volts:.6f}") for point in points)
    return saved


def _asked(step: int) -> str:
    print(f"step {step}, gap in µm: ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip()


def _take(answer: str, points: list[CalibrationPoint], rig: Rig, name: str) -> None:
    """Do what an answer says: take the last step back, or measure one."""
    if answer == "-":
        del points[-1:]
        return
    gap_um = _gap(answer)
    if gap_um is None:
        _say(f"{answer!r}: expected a gap in µm, 0 or more, such as 250")
        return
    try:
        points.append(measure_point(rig, name, gap_um * MICRO))
    except DeviceError as error:
        if not points:
            raise
        _say(f"  not measured: {error}")
    else:
        _say(f"  {points[-1].volts:.4f} V, scatter {1e3 * points[-1].scatter:.1f} mV rms")


def _gap(answer: str) -> float | None:
    try:
        value = float(answer.replace(",", "."))
    except ValueError:
        return None
    return value if 0.0 <= value < math.inf else None


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


_HALF_PLOT = 15  # characters to either side of zero


def gap(args: argparse.Namespace) -> int:
    """Calibrate a probe; return the exit code."""
    rig = load_rig(Path(args.config))
    section = rig.config.channel[probe_row(rig, args.channel)]
    before = load_record(rig.path.parent / section.calibration)
    today = dt.datetime.now().astimezone().date().isoformat()
    path = _new_path(rig, args, today)
    if path.exists():
        raise UsageError(f"{path}: is there already, and a calibration is never overwritten")
    points = read_points(Path(args.points)) if args.points else stepped(rig, args.channel, path)
    record, fit = _record(points, args, _metadata(args, before, today), path)
    write_record(path, record)
    load_calibration(path)  # what was written is what a rig will read
    if args.json:
        print_json(gap_calibration_schema(args.channel, path, record, fit))
    else:
        print("\n".join(_told(points, fit)))
        print(f'{path}: written; in {rig.path} name it at the channel: calibration = "{_named(path, rig)}"')
    return 0


def tacho(args: argparse.Namespace) -> int:
    """Propose the tacho's switching levels; return the exit code."""
    rig = load_rig(Path(args.config))
    levels = measure_tacho_levels(rig)
    if args.json:
        print_json(tacho_calibration_schema(rig.tacho, levels))
        return NOT_READY if levels is None else 0
    if levels is None:
        print("the tacho does not switch between two levels: turn the shaft, by hand if need be, and look at its mark")
        return NOT_READY
    print(
        f"the tacho switches between {levels.low:.2f} and {levels.high:.2f} V, "
        f"noise {1e3 * levels.scatter:.0f} mV rms, light for {100 * levels.high_fraction:.0f} % of the time\n"
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
    """Return the file to write: as was asked, or a new one beside the present record."""
    if args.output:
        return Path(args.output)
    folder = (rig.path.parent / rig.config.channel[probe_row(rig, args.channel)].calibration).parent
    names = (f"probe-{args.channel}-{today}{'' if number == 1 else f'-{number}'}.toml" for number in count(1))
    return next(folder / name for name in names if not (folder / name).exists())


def _named(path: Path, rig: Rig) -> str:
    """Return a file as the rig file would name it."""
    try:
        return path.resolve().relative_to(rig.path.parent.resolve()).as_posix()
    except ValueError:
        return path.resolve().as_posix()


def _metadata(args: argparse.Namespace, before: CalibrationRecord, today: str) -> CalibrationMetadata:
    """Return the papers of the new record: what is not said is as it was."""
    old = before.calibration
    return CalibrationMetadata(
        date=today,
        sensor=args.sensor or old.sensor,
        conditioner=args.conditioner or old.conditioner,
        target=args.target or old.target,
        operator=args.operator,
        note=args.note,
    )


def _record(
    points: Sequence[CalibrationPoint], args: argparse.Namespace, metadata: CalibrationMetadata, path: Path
) -> tuple[CalibrationRecord, CalibrationFit]:
    """Return record and fit of points; where they make no calibration, measured ones are kept in a file."""
    gaps, volts = np.array([point.gap for point in points]), np.array([point.volts for point in points])
    order = args.order or usual_order(len(points))
    try:
        fit = fit_calibration(gaps, volts, order)
    except ValueError as error:
        kept = ""
        if points and not args.points:
            kept = f"; the points are kept in {keep(path, points)}, to be put right there and given with --points"
        raise UsageError(f"the points make no calibration: {error}{kept}") from error
    return fitted_record(fit, gaps, volts, metadata), fit


def _told(points: Sequence[CalibrationPoint], fit: CalibrationFit) -> Iterator[str]:
    """Yield the points with how far the polynomial lies off, drawn to scale."""
    scale = max(fit.residual, 1e-12)
    yield f"{'gap µm':>9} {'volts':>9} {'scatter mV':>11} {'off µm':>8}  {'0':>{_HALF_PLOT + 1}}"
    for point, off in sorted(zip(points, fit.residuals, strict=True), key=lambda pair: pair[0].gap):
        place = _HALF_PLOT + round(_HALF_PLOT * float(off) / scale)
        line = [" "] * (2 * _HALF_PLOT + 1)
        line[_HALF_PLOT], line[place] = "|", "o"
        scatter = "" if math.isnan(point.scatter) else f"{1e3 * point.scatter:.2f}"
        row = f"{point.gap / MICRO:9.1f} {point.volts:9.4f} {scatter:>11} {off / MICRO:+8.2f}  {''.join(line)}"
        yield row.rstrip()
    coefficients = ", ".join(f"{coefficient / MICRO:.6g}" for coefficient in fit.coefficients)
    yield (
        f"order {fit.order}: gap_um = [{coefficients}] · volts^k from {fit.volts_low:.3f} to {fit.volts_high:.3f} V, "
        f"rising, {fit.residual / MICRO:.2f} µm off at most"
    )


def add_calibrate_command(add: AddCommand) -> None:
    """Add the command with `add`, which takes name, function and description."""
    parser = add("calibrate", gap, "Calibrate a probe's gap, or find the tacho's switching levels.")
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="KIND")
    text = (
        "Calibrate a probe: step the gap with a micrometer, or give a file of points.\n"
        "Fits gap over voltage, shows how far the points lie off, and writes a new\n"
        "record; none is ever overwritten."
    )
    command = kinds.add_parser("gap", help="a probe's curve, from micrometer steps", description=text)
    command.epilog, command.formatter_class = _STEPS_END, argparse.RawDescriptionHelpFormatter
    command.set_defaults(run=gap)
    command.add_argument("config", metavar="RIG.TOML", help="the rig")
    command.add_argument("channel", metavar="CHANNEL", help="name of the probe's channel, as x")
    command.add_argument("--points", default="", metavar="FILE.CSV", help="points instead of steps: gap in µm, volts")
    command.add_argument(
        "--order", type=int, choices=range(1, 8), metavar="N", help="of the polynomial, 1 to 7 (default: 3)"
    )
    command.add_argument("-o", dest="output", default="", metavar="NEW.TOML", help="the record (default: a new file)")
    command.add_argument("--sensor", default="", help="serial number (default: as in the present record)")
    command.add_argument("--conditioner", default="", help="serial number (default: as in the present record)")
    command.add_argument("--target", default="", help="material and diameter (default: as in the present record)")
    command.add_argument("--operator", default="", help="who calibrates")
    command.add_argument("--note", default="", help="anything else")
    command.add_argument("--json", action="store_true", help="as JSON on standard output")
    text = "Propose the tacho's threshold and hysteresis from a second of its signal; the shaft must turn."
    command = kinds.add_parser("tacho", help="the tacho's switching levels", description=text)
    command.set_defaults(run=tacho)
    command.add_argument("config", metavar="RIG.TOML", help="the rig")
    command.add_argument("--json", action="store_true", help="as JSON on standard output")
