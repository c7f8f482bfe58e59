"""The commands for runs that go on: recorded, marked, replayed, served."""

import argparse
import os
from collections.abc import Callable

from daq.cli import acknowledge, mark, record, replay, serve
from daq.cli.arguments import add_folder, duration, pace, port, show_examples

_PORT = 8501

AddCommand = Callable[[str, Callable[[argparse.Namespace], int], str], argparse.ArgumentParser]


def add_run_commands(add: AddCommand) -> None:
    """Add the commands with `add`, which takes name, function and description."""
    command = add("record", record.run, "Record a run, with live picture and REST, and sum it up at its end.")
    command.add_argument("config", metavar="RIG.TOML", help="the rig")
    _add_recording(command)
    command.add_argument("--json", action="store_true", help="print the summary as JSON on standard output")
    command.add_argument("--no-serve", action="store_true", help="without page and REST")
    _add_screens(command)
    show_examples(
        command,
        'rig record rigs/usb6251.toml --for 5min --note "new oil"',
        'rig record rigs/usb6251.toml --start "speed > 2000" --pre 2s',
    )

    command = add("mark", mark.run, "Name the present moment of the run that is recorded, from another terminal.")
    command.add_argument("word", metavar="WORD", nargs="*", help="what it is called (default: mark)")
    command.add_argument("--json", action="store_true", help="as JSON")
    _add_address(command)
    show_examples(command, "rig mark knocking begins")

    command = add("acknowledge", acknowledge.run, "Take note of the alarms of the run that goes on; what is over goes.")
    command.add_argument("--json", action="store_true", help="as JSON")
    _add_address(command)

    command = add("replay", replay.run, "Replay a recording through the same analysis and picture.")
    command.add_argument("recording", metavar="RUN", help="a run's id, or a file")
    command.add_argument(
        "--pace",
        type=pace,
        default=1.0,
        help="1: its own pace (default), 10: ten times as fast, max: as fast as it goes",
    )
    add_folder(command)
    command.add_argument("--json", action="store_true", help="print the summary as JSON on standard output")
    command.add_argument("--no-serve", action="store_true", help="without page and REST")
    _add_screens(command)
    show_examples(
        command, "rig replay 2026-11-24T09-12-07-gj90c --pace 10", "rig replay data/2026-11-24T09-12-07-gj90c.mcap"
    )

    command = add("serve", serve.run, "Serve the page and REST for the recorded runs until stopped.")
    command.add_argument(
        "config",
        metavar="RIG.TOML",
        nargs="?",
        help="the rig: its folder is served, and its runs are started and stopped over REST",
    )
    add_folder(command)
    _add_screens(command)
    show_examples(command, "rig serve rigs/bench.toml")


def _add_address(parser: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    parser.add_argument("--host", default="127.0.0.1", help="address of page and REST (default: this machine only)")
    parser.add_argument(
        "--port",
        type=port,
        default=_PORT,
        help=f"port of page and REST (default {_PORT}; 0: any free one)",
    )
    parser.add_argument(
        "--token",
        default=os.environ.get("RIG_TOKEN", ""),
        help="bearer token that requests must carry, needed with another --host; better given as $RIG_TOKEN",
    )


def _add_screens(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("screens")
    _add_address(group)
    group.add_argument(
        "--cors",
        action="append",
        default=[],
        metavar="ORIGIN",
        help="another site whose pages may ask, such as http://notebook.lab:8888; may be given again",
    )
    group.add_argument("--no-view", action="store_true", help="without the live picture (it needs rerun-sdk)")


def _add_recording(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--for", dest="duration", type=duration, metavar="TIME", help="stop after 60s, 5min, 1h … (default: Ctrl-C)"
    )
    parser.add_argument("--note", default="", help="a word to remember the run by")
    group = parser.add_argument_group("trigger", "What is not given is as [trigger] of the rig file says.")
    group.add_argument(
        "--start", metavar="CONDITION", help='record from here on: "speed > 2000" (r/min), "x > 4.5" (V) …'
    )
    group.add_argument("--stop", metavar="CONDITION", help='and up to here: "speed < 1500", "time > 10" (s) …')
    group.add_argument("--pre", type=duration, metavar="TIME", help="from before the start, recorded too: 2s …")
    group.add_argument(
        "--events",
        type=int,
        metavar="N",
        help="wait for the start again after a stop, for N recordings in all, each a file (0: until Ctrl-C)",
    )
    group.add_argument(
        "--hold-off", type=duration, metavar="TIME", help="after a stop, before a start is looked for: 10s …"
    )
