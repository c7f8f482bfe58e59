"""The commands for the bench before a run."""

import argparse
from collections.abc import Callable

from daq.cli import calibrate, check, devices, preflight
from daq.cli.arguments import address, duration, speed

AddCommand = Callable[[str, Callable[[argparse.Namespace], int], str], argparse.ArgumentParser]


def add_bench_commands(add: AddCommand) -> None:
    """Add the commands with `add`, which takes name, function and description."""
    command = add(
        "check",
        check.run,
        "Check a rig file and the calibrations that it names, without hardware: every fault at once.",
    )
    command.add_argument("config", metavar="RIG.TOML", help="the rig")
    command.add_argument("--json", action="store_true", help="as JSON, also where there are faults")

    command = add("devices", devices.run, "List what is connected: product, serial number, simulated or real, busy.")
    command.add_argument(
        "--target",
        type=address,
        metavar="HOST:PORT",
        help="of an NI gRPC device server (default: the driver on this machine)",
    )
    command.add_argument("--json", action="store_true", help="as JSON")

    command = add(
        "preflight",
        preflight.run,
        "Look at the rig before a run: card, gaps, wiring, tacho, calibrations, disk; say what to do about it.",
    )
    command.add_argument("config", metavar="RIG.TOML", help="the rig")
    command.add_argument("--for", dest="duration", type=duration, metavar="TIME", help="planned run: 60s, 5min, 1h …")
    command.add_argument(
        "--speed", dest="speed_rpm", type=speed, metavar="RPM", help="planned highest speed (default: the rig's limit)"
    )
    command.add_argument("--json", action="store_true", help="as JSON on standard output")

    _add_calibrate(add("calibrate", calibrate.gap, "Calibrate a probe's gap, or find the tacho's switching levels."))


def _add_calibrate(parser: argparse.ArgumentParser) -> None:
    """Add the kinds of calibration to the command's parser."""
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="KIND")
    text = (
        "Calibrate a probe: step the gap with a micrometer, or give a file of points. Fits gap over voltage, shows how "
        "far the points lie off, and writes a new record; none is ever overwritten."
    )
    command = kinds.add_parser("gap", help="a probe's curve, from micrometer steps", description=text)
    command.set_defaults(run=calibrate.gap)
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
    command.set_defaults(run=calibrate.tacho)
    command.add_argument("config", metavar="RIG.TOML", help="the rig")
    command.add_argument("--json", action="store_true", help="as JSON on standard output")
