"""The commands used before a run: `rig check`, `rig devices`, `rig preflight` and `rig calibrate`."""

import argparse
import csv
import datetime as dt
import math
import sys
from collections.abc import Iterator, Sequence
from itertools import count
from pathlib import Path

import numpy as np
from rich.constrain import Constrain
from rich.padding import Padding
from rich.table import Column, Table
from rich.text import Text

from analysis.preflight.calibration import CalibrationFit, default_order, fit_calibration
from analysis.preflight.check_result import Verdict
from analysis.signals.errors import CalibrationFitError
from analysis.signals.units import MICROMETRE, MICROSECOND, MILLIVOLT, RPM
from daq.cli.arguments import NOT_READY, AddCommand, add_json, add_rig_file, address, duration, non_negative, speed
from daq.cli.terminal import TerminalOutput, grid, print_json, print_output, text_table
from daq.config.calibration import (
    CalibrationMetadata,
    CalibrationRecord,
    fitted_record,
    load_calibration,
    load_record,
    write_record,
)
from daq.config.devices import device_spec
from daq.config.loader import load_rig
from daq.config.rig import Rig
from daq.config.schema import Backend, DeviceSection
from daq.drivers.ni import FoundDevice, connected_devices
from daq.errors import ConfigError, DeviceError, UsageError
from daq.schemas.checks import (
    FoundDeviceSchema,
    gap_calibration_schema,
    invalid_rig_schema,
    preflight_schema,
    tacho_calibration_schema,
    valid_rig_schema,
)
from daq.session.calibration import (
    CalibrationPoint,
    measure_point,
    measure_tacho_levels,
    probe_row,
    read_points,
)
from daq.session.preflight import PlannedRun, PreflightReport, disk_rate, run_preflight_checks
from recordings.catalogue.catalogue import data_folder

_STATES = {True: "busy: another program holds it", False: "free", None: "no analog input"}
_STYLES = {Verdict.GOOD: "green", Verdict.WARN: "yellow", Verdict.FAIL: "bold red"}
_MAX_WIDTH = 112  # columns of the checks


def run_check(args: argparse.Namespace, _console: TerminalOutput) -> int:
    """Check a rig file without hardware; return the exit code."""
    try:
        rig = load_rig(args.config)
    except ConfigError as error:
        if not args.json:
            raise
        print_json(invalid_rig_schema(error))
        return error.exit_code
    card = device_spec(rig.config.device.product)
    rate = card.coerced_rate(rig.config.timing.rate_hz)
    convert_rate = card.convert_rate(rate, len(rig.config.channel))
    if args.json:
        print_json(valid_rig_schema(rig, rate=rate, convert_rate=convert_rate, disk_rate=disk_rate(rig, rate)))
    else:
        _print_rig(rig, rate, convert_rate)
    return 0


def _print_rig(rig: Rig, rate: float, convert_rate: float) -> None:
    """Print the settings read from a rig file; rates in Hz."""
    device, counter = rig.config.device, rig.tacho.counter
    card = f"simulated {device.product}" if device.backend is Backend.SIMULATED else device.product
    if device.backend is Backend.NIDAQMX:
        card += f" serial number {device.serial}" if device.serial else f" as {device.name}"
    between = f"convert clock {convert_rate / 1e3:.4g} kHz ({1 / convert_rate / MICROSECOND:.2f} µs between channels)"
    rows = [
        ("  rig", f"{rig.config.rig} on {card}"),
        ("  inputs", ", ".join(f"{channel.name} on {channel.physical}" for channel in rig.config.channel)),
        ("  rate", f"{rate / 1e3:g} kS/s each, {between}"),
        ("  disk", f"at most {disk_rate(rig, rate) * 3600 / 1e9:.2g} GB an hour"),
    ]
    if counter is not None:
        stamped = f"edges timestamped by {counter.counter} on {counter.terminal} to {1e9 / counter.timebase:g} ns"
        rows.insert(3, ("  tacho", f"{stamped}; speed and phase from the {rig.tacho.reference}"))
    print_output(f"{rig.path}: good", grid(*rows, label_width=9))


def run_devices(args: argparse.Namespace, _console: TerminalOutput) -> int:
    """List the connected devices; return the exit code."""
    devices = connected_devices(DeviceSection(backend=Backend.NIDAQMX, target=args.target or ""))
    if args.json:
        print_json([FoundDeviceSchema.of(device) for device in devices])
    elif devices:
        print_output(devices[0].driver, grid(*map(_device_row, devices)))
    else:
        print("no device connected: check the USB cable and the card's power supply (an unpowered card is not listed)")
    return 0


def _device_row(device: FoundDevice) -> tuple[str, ...]:
    kind = "simulated" if device.simulated else "real"
    return device.name, device.product, f"serial number {device.serial}", kind, _STATES[device.busy]


def run_preflight(args: argparse.Namespace, console: TerminalOutput) -> int:
    """Run the preflight checks and print them; return the exit code."""
    rig = load_rig(args.config)
    plan = PlannedRun(
        folder=data_folder(rig.config.storage.folder),
        duration=args.duration,
        speed=None if args.speed_rpm is None else args.speed_rpm * RPM,
    )
    report = run_preflight_checks(rig, plan, dt.datetime.now().astimezone().date(), console.progress)
    console.done()
    if args.json:
        print_json(preflight_schema(rig.config.rig, report))
    else:
        print_output(*report_parts(report))
    if report.device_error is not None:
        return report.device_error.exit_code
    return NOT_READY if report.verdict is Verdict.FAIL else 0


def report_parts(report: PreflightReport) -> Iterator[Constrain | Text]:
    """Yield the checks with advice below those that are not good, and the verdict last."""
    names = max(len(check.name) for check in report.checks)
    for check in report.checks:
        texts = (Column(width=4, style=_STYLES[check.verdict]), Column(width=names), Column(ratio=1), Column(ratio=1))
        row = Table.grid(*texts, padding=(0, 2), expand=True)
        row.add_row(check.verdict.value, check.name, check.value, check.limit)
        yield Constrain(row, _MAX_WIDTH)
        if check.advice:
            yield Constrain(Padding(grid(("→", check.advice)), (0, 0, 0, 6)), _MAX_WIDTH)
    failed = sum(check.verdict is Verdict.FAIL for check in report.checks)
    warned = sum(check.verdict is Verdict.WARN for check in report.checks)
    warnings = f"{warned} warning{'' if warned == 1 else 's'}"
    if failed:
        yield Text(f"NOT READY: {failed} of {len(report.checks)} checks failed, {warnings}", _STYLES[Verdict.FAIL])
    else:
        yield Text(f"ready: {len(report.checks)} checks, {warnings if warned else 'all good'}")


_PREFLIGHT = """\
Check the rig before a run. Each failed check is printed with what to do.

  card         connected, real, serial number as in the rig file, self-test
               passed
  samples      one second of them, complete, at the requested rate, no backlog
  each probe   gap voltage within its window (else: unplugged, gap closed or too
               wide, wires swapped), clipping, calibrated range, mains hum
               separated from the shaft's own orders
  both probes  two independent signals (else: bridged), 1X in the direction of
               rotation (else: swapped)
  tacho        levels against threshold and hysteresis, noise, jitter, width of
               the keyphasor mark, speed limit of the sensor
  records      age, fit and serial numbers of the calibrations; free disk space
               for the planned run

The shaft may stand still or turn. At standstill the tacho and the direction of
the orbit are reported as not checked.
"""
_PREFLIGHT_END = """\
exit codes: 0 ready, possibly with warnings; 2 rig file wrong;
            3 device missing, busy or failed; 4 not ready
example:    rig preflight rigs/usb6251.toml --for 5min --speed 15000
"""


def add_commands(add: AddCommand) -> None:
    """Add `rig check`, `rig devices`, `rig preflight` and `rig calibrate` to the command line."""
    _add_calibrate(add)
    add("check", run_check, add_rig_file, add_json)
    command = add("devices", run_devices, add_json)
    command.add_argument(
        "--target",
        type=address,
        metavar="HOST:PORT",
        help="NI gRPC device server (default: the driver on this machine)",
    )

    command = add("preflight", run_preflight, add_rig_file, add_json)
    command.description, command.epilog = _PREFLIGHT, _PREFLIGHT_END
    command.formatter_class = argparse.RawDescriptionHelpFormatter
    command.add_argument(
        "--for", dest="duration", type=duration, metavar="TIME", help="planned duration: 60s, 5min, 1h …"
    )
    command.add_argument(
        "--speed", dest="speed_rpm", type=speed, metavar="RPM", help="planned maximum speed (default: limits.speed_rpm)"
    )


_EXAMPLES = """\
examples:   rig calibrate gap rigs/usb6251.toml x --operator "M. Curie"
            rig calibrate gap rigs/usb6251.toml x --points sheet.csv --order 4
"""

_HALF_PLOT_WIDTH = 15  # columns on either side of zero


def measure_steps(rig: Rig, name: str, path: Path, console: TerminalOutput) -> list[CalibrationPoint]:
    """Prompt for the gap of each micrometer step, measure its voltage, and return the points.

    Parameters
    ----------
    rig : Rig
        The rig.
    name : str
        The probe's channel.
    path : Path
        The calibration record to be written; Ctrl-C saves the points beside it.
    console : TerminalOutput
        Prints instructions and measured values.

    Raises
    ------
    DeviceError
        The first step cannot be measured; a later one can be repeated.
    """
    physical = rig.config.channel[probe_row(rig, name)].physical
    console.line(
        f"probe {name} on {physical}: set the micrometer, wait until it is still, and enter the gap in µm (0 where the "
        "tip touches).\nAn empty line ends; a - removes the last step."
    )
    points: list[CalibrationPoint] = []
    try:
        while typed := _prompt(len(points) + 1):
            _measure_step(typed, points, rig, name, console)
    except KeyboardInterrupt:
        if points:
            console.line(f"\n{len(points)} points saved to {save_points(path, points)}: use them with --points")
        raise
    console.line("")
    return points


def save_points(path: Path, points: Sequence[CalibrationPoint]) -> Path:
    """Write points to a new CSV file beside their calibration record; return the file."""
    saved = _unused(path.with_suffix(".csv"))
    saved.parent.mkdir(parents=True, exist_ok=True)
    with saved.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["gap_um", "volts"])
        writer.writerows((f"{point.gap / MICROMETRE:g}", f"{point.volts:.6f}") for point in points)
    return saved


def _unused(path: Path) -> Path:
    """Return a path, with a number where the file exists."""
    paths = (path if number == 1 else path.with_stem(f"{path.stem}-{number}") for number in count(1))
    return next(each for each in paths if not each.exists())


def _prompt(step: int) -> str:
    print(f"step {step}, gap in µm: ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip()


def _measure_step(typed: str, points: list[CalibrationPoint], rig: Rig, name: str, console: TerminalOutput) -> None:
    """Measure a point at the typed gap, or remove the last point for "-"."""
    if typed == "-":
        del points[-1:]
        return
    try:
        gap_um = non_negative(typed.replace(",", "."))
    except argparse.ArgumentTypeError:
        console.line(f"{typed!r}: expected a gap in µm, 0 or more, such as 250")
        return
    try:
        points.append(measure_point(rig, name, gap_um * MICROMETRE))
    except DeviceError as error:
        if not points:
            raise
        console.line(f"  not measured: {error}")
    else:
        console.line(f"  {points[-1].volts:.4f} V, scatter {points[-1].scatter / MILLIVOLT:.1f} mV rms")


def run_calibrate_gap(args: argparse.Namespace, console: TerminalOutput) -> int:
    """Calibrate a probe and write a new record; return the exit code."""
    rig = load_rig(args.config)
    section = rig.config.channel[probe_row(rig, args.channel)]
    current = rig.path.parent / section.calibration
    previous = load_record(current)
    today = dt.datetime.now().astimezone().date().isoformat()
    path = args.output or _unused(current.with_name(f"probe-{args.channel}-{today}.toml"))
    if path.exists():
        raise UsageError(f"{path}: exists already; calibration records are never overwritten")
    points = read_points(args.points) if args.points else measure_steps(rig, args.channel, path, console)
    record, fit = _fit_record(points, args, _metadata(args, previous, today), path)
    write_record(path, record)
    load_calibration(path)  # checks the written file as a rig will read it
    if args.json:
        print_json(gap_calibration_schema(args.channel, path, record, fit))
    else:
        _print_fit(points, fit)
        print(f'{path}: written; to use it, set calibration = "{_relative_to_rig(path, rig)}" in {rig.path}')
    return 0


def run_calibrate_tacho(args: argparse.Namespace, _console: TerminalOutput) -> int:
    """Propose the tacho's switching levels; return the exit code."""
    rig = load_rig(args.config)
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


def _relative_to_rig(path: Path, rig: Rig) -> str:
    """Return a path as the rig file refers to it: relative to its folder where it lies within."""
    file, folder = path.resolve(), rig.path.parent.resolve()
    return (file.relative_to(folder) if file.is_relative_to(folder) else file).as_posix()


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


def _print_fit(points: Sequence[CalibrationPoint], fit: CalibrationFit) -> None:
    """Print the points with the residuals of the fit, as numbers and drawn to scale, and its coefficients."""
    rows = []
    for point, residual in sorted(zip(points, fit.residuals, strict=True), key=lambda pair: pair[0].gap):
        plot = [" "] * (2 * _HALF_PLOT_WIDTH + 1)
        plot[_HALF_PLOT_WIDTH] = "|"
        plot[_HALF_PLOT_WIDTH + round(_HALF_PLOT_WIDTH * float(residual) / max(fit.residual, 1e-12))] = "o"
        scatter = "" if math.isnan(point.scatter) else f"{point.scatter / MILLIVOLT:.2f}"
        gap, off = f"{point.gap / MICROMETRE:.1f}", f"{residual / MICROMETRE:+.2f}"
        rows.append((gap, f"{point.volts:.4f}", scatter, off, "".join(plot)))
    coefficients = ", ".join(f"{coefficient / MICROMETRE:.6g}" for coefficient in fit.coefficients)
    headings = ("gap µm", "volts", "scatter mV", "residual µm", f"{'0':>{_HALF_PLOT_WIDTH + 1}}")
    print_output(
        text_table(headings, rows, n_left=1),
        f"order {fit.order}: gap_um = [{coefficients}] · volts^k from {fit.volts_low:.3f} to {fit.volts_high:.3f} V, "
        f"rising, largest residual {fit.residual / MICROMETRE:.2f} µm",
    )


def _add_calibrate(add: AddCommand) -> None:
    """Add `rig calibrate` to the command line."""
    kinds = add("calibrate", run_calibrate_gap).add_subparsers(dest="kind", required=True, metavar="KIND")
    text = (
        "Calibrate a probe from micrometer steps or from a file of points. Fits gap over\n"
        "voltage, prints the residuals and writes a new calibration record; records are\n"
        "never overwritten."
    )
    command = kinds.add_parser("gap", help="a probe's calibration curve", description=text)
    command.epilog, command.formatter_class = _EXAMPLES, argparse.RawDescriptionHelpFormatter
    add_rig_file(command)
    command.add_argument("channel", metavar="CHANNEL", help="the probe's channel, such as x")
    command.add_argument("--points", type=Path, metavar="FILE.CSV", help="points instead of steps: gap in µm, volts")
    command.add_argument(
        "--order", type=int, choices=range(1, 8), metavar="N", help="polynomial order, 1 to 7 (default: 3)"
    )
    command.add_argument("-o", dest="output", type=Path, metavar="NEW.TOML", help="new record (default: a new name)")
    for option, what, default in (
        ("--sensor", "serial number", "that of the current record"),
        ("--conditioner", "serial number", "that of the current record"),
        ("--target", "material and diameter", "those of the current record"),
    ):
        command.add_argument(option, default="", help=f"{what} (default: {default})")
    command.add_argument("--operator", default="", help="name of the operator")
    command.add_argument("--note", default="", help="note stored in the record")
    add_json(command)
    text = "Propose the tacho's threshold and hysteresis from a second of its signal; the shaft must turn."
    command = kinds.add_parser("tacho", help="the tacho's switching levels", description=text)
    command.set_defaults(run=run_calibrate_tacho)
    add_rig_file(command)
    add_json(command)
