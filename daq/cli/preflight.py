"""The commands for the bench before a run.

`rig check`: whether a rig file and the calibrations that it names are good, without any hardware.
`rig devices`: what is connected.
`rig preflight`: whether the rig is ready.
"""

import argparse
import datetime as dt
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

from analysis.preflight.checks import Verdict
from daq.cli.arguments import NOT_READY, AddCommand, address, duration, speed
from daq.cli.output.progress import RPM, Console
from daq.cli.output.terminal import print_json, print_lines, terminal_width
from daq.config.loader import load_rig
from daq.config.rig import Rig
from daq.config.schema import Backend, DeviceSection
from daq.drivers.ni import FoundDevice, connected_devices
from daq.drivers.simulation import converter
from daq.errors import ConfigError
from daq.schemas.preflight import found_device_schema, invalid_rig_schema, preflight_schema, valid_rig_schema
from daq.session.preflight.preflight import PlannedRun, PreflightReport, run_preflight_checks
from daq.session.preflight.rig_checks import disk_rate
from recordings.catalogue.catalogue import data_folder


def run_check(args: argparse.Namespace) -> int:
    """Check a rig file; return the exit code."""
    try:
        rig = load_rig(Path(args.config))
    except ConfigError as error:
        if not args.json:
            raise
        print_json(invalid_rig_schema(error))
        return error.exit_code
    rate = converter.coerced_rate(rig.config.timing.rate_hz)
    convert_rate = converter.convert_rate(rate, len(rig.config.channel))
    if args.json:
        print_json(valid_rig_schema(rig, rate=rate, convert_rate=convert_rate, disk_rate=disk_rate(rig, rate)))
    else:
        print_lines(_lines(rig, rate, convert_rate))
    return 0


def _lines(rig: Rig, rate: float, convert_rate: float) -> Iterator[str]:
    """Yield what was understood; rates in Hz."""
    device = rig.config.device
    card = f"simulated {device.product}" if device.backend is Backend.SIMULATED else device.product
    if device.backend is Backend.NIDAQMX:
        card += f" serial number {device.serial}" if device.serial else f" as {device.name}"
    inputs = ", ".join(f"{channel.name} on {channel.physical}" for channel in rig.config.channel)
    yield f"{rig.path}: good"
    yield f"  rig      {rig.config.rig} on {card}"
    yield f"  inputs   {inputs}"
    between = f"convert clock {convert_rate / 1e3:.4g} kHz ({1e6 / convert_rate:.2f} µs between channels)"
    yield f"  rate     {rate / 1e3:g} kS/s each, {between}"
    counter = rig.tacho.counter
    if counter is not None:
        stamped = f"edges stamped by {counter.counter} on {counter.terminal} to {1e9 / counter.timebase:g} ns"
        yield f"  tacho    {stamped}; speed and phase from the {rig.tacho.reference}"
    yield f"  disk     at most {disk_rate(rig, rate) * 3600 / 1e9:.2g} GB an hour"


_STATES = {True: "busy: another program holds it", False: "free", None: "no analog input"}


def run_devices(args: argparse.Namespace) -> int:
    """List what is connected; return the exit code."""
    devices = connected_devices(DeviceSection(backend=Backend.NIDAQMX, target=args.target or ""))
    if args.json:
        print_json([found_device_schema(device) for device in devices])
    elif devices:
        print(devices[0].driver)
        for device in devices:
            print(_row(device))
    else:
        print("no device is connected: check the card's own supply (it is not listed without) and its USB cable")
    return 0


def _row(device: FoundDevice) -> str:
    kind = "simulated" if device.simulated else "real"
    return f"{device.name:8}  {device.product:12}  serial number {device.serial:10}  {kind:9}  {_STATES[device.busy]}"


_WIDTH = 112  # at most
_COLUMN = 34  # of what is found, at most: what is longer pushes what is expected aside
_NARROW = 24  # the same on a terminal of 80
_LEAST = 16  # columns for what is expected


def run_preflight(args: argparse.Namespace) -> int:
    """Check and print the table; return the exit code."""
    console = Console()
    rig = load_rig(Path(args.config))
    plan = PlannedRun(
        folder=data_folder(rig.config.storage.folder),
        duration=args.duration,
        speed=None if args.speed_rpm is None else args.speed_rpm * RPM,
    )
    found = run_preflight_checks(rig, plan, dt.datetime.now().astimezone().date(), console.progress)
    console.clear()
    if args.json:
        print_json(preflight_schema(rig.config.rig, found))
    else:
        print_lines(table(found, terminal_width(sys.stdout) or _WIDTH + 1))
    if found.device_error is not None:
        return found.device_error.exit_code
    return NOT_READY if found.verdict is Verdict.FAIL else 0


def table(found: PreflightReport, width: int) -> Iterator[str]:
    """Yield the checks line by line, with what to do under those that are not good, and the verdict last."""
    width = min(width - 1, _WIDTH)
    names = max(len(check.name) for check in found.checks)
    values = min(max(len(check.value) for check in found.checks), _COLUMN if width > 2 * names + _COLUMN else _NARROW)
    for check in found.checks:
        row = f"{check.verdict.value}  {check.name:{names}}  {check.value:{values}}  "
        if len(row) > width - _LEAST:  # what is expected has a line of its own
            yield row.rstrip()
            row = " " * (len(row) - len(check.value) + min(len(check.value), values))
        yield from _hung(row, check.limit, width)
        if check.advice:
            yield from textwrap.wrap(check.advice, width, initial_indent="      → ", subsequent_indent="        ")
    failed = sum(check.verdict is Verdict.FAIL for check in found.checks)
    warned = sum(check.verdict is Verdict.WARN for check in found.checks)
    warnings = f"{warned} warning{'' if warned == 1 else 's'}"
    if failed:
        yield f"NOT READY: {failed} of {len(found.checks)} checks failed, {warnings}"
    else:
        yield f"ready: {len(found.checks)} checks, {warnings if warned else 'all good'}"


def _hung(row: str, limit: str, width: int) -> Iterator[str]:
    """Yield a row with its last column, which goes on below itself."""
    for part in textwrap.wrap(limit, max(width - len(row), _LEAST), break_long_words=False) or [""]:
        yield (row + part).rstrip()
        row = " " * len(row)


_PREFLIGHT = """\
Look at the rig before a run, and say what is not as it should be and what to
do about it:

  card         there, with the serial number of the rig file, its own test
               passed, real and not simulated
  samples      one second of them, each one, at the rate asked for, without a
               backlog
  each probe   gap voltage in its window (else: unplugged, gap closed, too wide,
               wires exchanged), clipping, calibrated span, mains hum beside the
               shaft's own orders
  both probes  two signals and not one (bridged), 1X going round with the shaft
               (exchanged)
  tacho        levels against threshold and hysteresis, noise, scatter, width of
               the mark, speed limit of the sensor
  records      age, fit and serial numbers of the calibrations; room on the disk
               for the planned run

The shaft may stand still or turn; at rest the tacho and the direction of the
orbit are left open, and that is said.
"""
_PREFLIGHT_END = """\
exit codes: 0 ready, perhaps with warnings; 2 rig file wrong;
            3 device missing, busy or failed; 4 not ready
example:    rig preflight rigs/usb6251.toml --for 5min --speed 15000
"""


def add_preflight_commands(add: AddCommand) -> None:
    """Add the commands with `add`, which takes name, function and description."""
    command = add(
        "check",
        run_check,
        "Check a rig file and the calibrations that it names, without hardware: every fault at once.",
    )
    command.add_argument("config", metavar="RIG.TOML", help="the rig")
    command.add_argument("--json", action="store_true", help="as JSON, also where there are faults")

    command = add("devices", run_devices, "List what is connected: product, serial number, simulated or real, busy.")
    command.add_argument(
        "--target",
        type=address,
        metavar="HOST:PORT",
        help="of an NI gRPC device server (default: the driver on this machine)",
    )
    command.add_argument("--json", action="store_true", help="as JSON")

    command = add("preflight", run_preflight, "Look at the rig before a run, and say what to do about what is wrong.")
    command.description, command.epilog = _PREFLIGHT, _PREFLIGHT_END
    command.formatter_class = argparse.RawDescriptionHelpFormatter
    command.add_argument("config", metavar="RIG.TOML", help="the rig")
    command.add_argument("--for", dest="duration", type=duration, metavar="TIME", help="planned run: 60s, 5min, 1h …")
    command.add_argument(
        "--speed", dest="speed_rpm", type=speed, metavar="RPM", help="planned highest speed (default: the rig's limit)"
    )
    command.add_argument("--json", action="store_true", help="as JSON on standard output")
