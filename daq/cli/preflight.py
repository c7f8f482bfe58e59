"""The commands used before a run: `rig check`, `rig devices` and `rig preflight`."""

import argparse
import datetime as dt
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

from analysis.preflight.check_result import Verdict
from analysis.signals.units import MICROSECOND, RPM
from daq.cli.arguments import NOT_READY, AddCommand, address, duration, speed
from daq.cli.progress import TerminalOutput
from daq.cli.terminal import print_json, print_lines, terminal_width
from daq.config.devices import device_spec
from daq.config.loader import load_rig
from daq.config.rig import Rig
from daq.config.schema import Backend, DeviceSection
from daq.drivers.ni import FoundDevice, connected_devices
from daq.errors import ConfigError
from daq.schemas.checks import FoundDeviceSchema, invalid_rig_schema, preflight_schema, valid_rig_schema
from daq.session.preflight import PlannedRun, PreflightReport, disk_rate, run_preflight_checks
from recordings.catalogue.catalogue import data_folder


def run_check(args: argparse.Namespace) -> int:
    """Check a rig file without hardware; return the exit code."""
    try:
        rig = load_rig(Path(args.config))
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
        print_lines(_rig_lines(rig, rate, convert_rate))
    return 0


def _rig_lines(rig: Rig, rate: float, convert_rate: float) -> Iterator[str]:
    """Yield the settings read from a rig file, line by line; rates in Hz."""
    device = rig.config.device
    card = f"simulated {device.product}" if device.backend is Backend.SIMULATED else device.product
    if device.backend is Backend.NIDAQMX:
        card += f" serial number {device.serial}" if device.serial else f" as {device.name}"
    inputs = ", ".join(f"{channel.name} on {channel.physical}" for channel in rig.config.channel)
    yield f"{rig.path}: good"
    yield f"  rig      {rig.config.rig} on {card}"
    yield f"  inputs   {inputs}"
    between = f"convert clock {convert_rate / 1e3:.4g} kHz ({1 / convert_rate / MICROSECOND:.2f} µs between channels)"
    yield f"  rate     {rate / 1e3:g} kS/s each, {between}"
    counter = rig.tacho.counter
    if counter is not None:
        stamped = f"edges stamped by {counter.counter} on {counter.terminal} to {1e9 / counter.timebase:g} ns"
        yield f"  tacho    {stamped}; speed and phase from the {rig.tacho.reference}"
    yield f"  disk     at most {disk_rate(rig, rate) * 3600 / 1e9:.2g} GB an hour"


_STATES = {True: "busy: another program holds it", False: "free", None: "no analog input"}


def run_devices(args: argparse.Namespace) -> int:
    """List the connected devices; return the exit code."""
    devices = connected_devices(DeviceSection(backend=Backend.NIDAQMX, target=args.target or ""))
    if args.json:
        print_json([FoundDeviceSchema.of(device) for device in devices])
    elif devices:
        print(devices[0].driver)
        for device in devices:
            print(_device_row(device))
    else:
        print("no device connected: check the USB cable and the card's power supply (an unpowered card is not listed)")
    return 0


def _device_row(device: FoundDevice) -> str:
    kind = "simulated" if device.simulated else "real"
    return f"{device.name:8}  {device.product:12}  serial number {device.serial:10}  {kind:9}  {_STATES[device.busy]}"


_MAX_WIDTH = 112  # columns of the table
_MAX_VALUE_WIDTH = 34  # columns of the measured value; a longer value moves the limit to the next line
_NARROW_VALUE_WIDTH = 24  # the same on a terminal of 80 columns
_MIN_LIMIT_WIDTH = 16  # columns of the limit


def run_preflight(args: argparse.Namespace) -> int:
    """Run the preflight checks and print them; return the exit code."""
    console = TerminalOutput()
    rig = load_rig(Path(args.config))
    plan = PlannedRun(
        folder=data_folder(rig.config.storage.folder),
        duration=args.duration,
        speed=None if args.speed_rpm is None else args.speed_rpm * RPM,
    )
    report = run_preflight_checks(rig, plan, dt.datetime.now().astimezone().date(), console.progress)
    console.clear()
    if args.json:
        print_json(preflight_schema(rig.config.rig, report))
    else:
        print_lines(report_lines(report, terminal_width(sys.stdout) or _MAX_WIDTH + 1))
    if report.device_error is not None:
        return report.device_error.exit_code
    return NOT_READY if report.verdict is Verdict.FAIL else 0


def report_lines(report: PreflightReport, width: int) -> Iterator[str]:
    """Yield the checks with advice below those that are not good, and the verdict last, line by line."""
    width = min(width - 1, _MAX_WIDTH)
    names = max(len(check.name) for check in report.checks)
    values = min(
        max(len(check.value) for check in report.checks),
        _MAX_VALUE_WIDTH if width > 2 * names + _MAX_VALUE_WIDTH else _NARROW_VALUE_WIDTH,
    )
    for check in report.checks:
        row = f"{check.verdict.value}  {check.name:{names}}  {check.value:{values}}  "
        if len(row) > width - _MIN_LIMIT_WIDTH:  # the limit goes on a line of its own
            yield row.rstrip()
            row = " " * (len(row) - len(check.value) + min(len(check.value), values))
        yield from _wrap_limit(row, check.limit, width)
        if check.advice:
            yield from textwrap.wrap(check.advice, width, initial_indent="      → ", subsequent_indent="        ")
    failed = sum(check.verdict is Verdict.FAIL for check in report.checks)
    warned = sum(check.verdict is Verdict.WARN for check in report.checks)
    warnings = f"{warned} warning{'' if warned == 1 else 's'}"
    if failed:
        yield f"NOT READY: {failed} of {len(report.checks)} checks failed, {warnings}"
    else:
        yield f"ready: {len(report.checks)} checks, {warnings if warned else 'all good'}"


def _wrap_limit(row: str, limit: str, width: int) -> Iterator[str]:
    """Yield a row and its limit, wrapped within the limit's column."""
    for part in textwrap.wrap(limit, max(width - len(row), _MIN_LIMIT_WIDTH), break_long_words=False) or [""]:
        yield (row + part).rstrip()
        row = " " * len(row)


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
    """Add `rig check`, `rig devices` and `rig preflight` to the command line."""
    command = add("check", run_check)
    command.add_argument("config", metavar="RIG.TOML", help="rig file")
    command.add_argument("--json", action="store_true", help="print JSON, errors included")

    command = add("devices", run_devices)
    command.add_argument(
        "--target",
        type=address,
        metavar="HOST:PORT",
        help="NI gRPC device server (default: the driver on this machine)",
    )
    command.add_argument("--json", action="store_true", help="print JSON")

    command = add("preflight", run_preflight)
    command.description, command.epilog = _PREFLIGHT, _PREFLIGHT_END
    command.formatter_class = argparse.RawDescriptionHelpFormatter
    command.add_argument("config", metavar="RIG.TOML", help="rig file")
    text = "planned duration: 60s, 5min, 1h …"
    command.add_argument("--for", dest="duration", type=duration, metavar="TIME", help=text)
    text = "planned maximum speed (default: limits.speed_rpm)"
    command.add_argument("--speed", dest="speed_rpm", type=speed, metavar="RPM", help=text)
    command.add_argument("--json", action="store_true", help="print JSON")
