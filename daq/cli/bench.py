"""The commands for the bench before a run."""

import argparse
from collections.abc import Callable

from daq.cli import calibrate, check, devices, preflight
from daq.cli.arguments import address, duration, speed

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
_STEPS_END = """\
examples:   rig calibrate gap rigs/usb6251.toml x --operator "M. Curie"
            rig calibrate gap rigs/usb6251.toml x --points sheet.csv --order 4
"""

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

    command = add("preflight", preflight.run, "Look at the rig before a run, and say what to do about what is wrong.")
    command.description, command.epilog = _PREFLIGHT, _PREFLIGHT_END
    command.formatter_class = argparse.RawDescriptionHelpFormatter
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
        "Calibrate a probe: step the gap with a micrometer, or give a file of points.\n"
        "Fits gap over voltage, shows how far the points lie off, and writes a new\n"
        "record; none is ever overwritten."
    )
    command = kinds.add_parser("gap", help="a probe's curve, from micrometer steps", description=text)
    command.epilog, command.formatter_class = _STEPS_END, argparse.RawDescriptionHelpFormatter
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
