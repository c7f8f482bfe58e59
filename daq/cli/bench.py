"""The commands for the bench before a run."""

import argparse
from collections.abc import Callable

from daq.cli import check, devices, preflight
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
