"""The command `rig`: its words, and what becomes of its errors."""

import argparse
import io
import os
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from typing import TextIO

from daq.cli import acknowledge, exchange, finding, listing, mark, predict, record, replay, serve, verify
from daq.cli.arguments import calibration, duration, pace, port
from daq.cli.bench import add_bench_commands
from daq.cli.model.commands import add_kinds
from daq.errors import RigError, UsageError
from recordings.errors import RecordingError

_EPILOG = """\
exit codes:
  0    good
  2    usage or configuration wrong; nothing was recorded
  3    the device is missing, busy or failed
  4    preflight: something stands against a run; calibrate tacho: its signal does not switch
  5    data lost or the recording is not whole (the file is kept)
  130  stopped by hand (the file is complete)

Runs are kept in the folder that storage.folder of the rig file names, else in $RIG_DATA, else in ./data.
"""


def _add_address(parser: argparse.ArgumentParser | argparse._ArgumentGroup, default_port: int) -> None:
    parser.add_argument("--host", default="127.0.0.1", help="address of page and REST (default: this machine only)")
    parser.add_argument(
        "--port",
        type=port,
        default=default_port,
        help=f"port of page and REST (default {default_port}; 0: any free one)",
    )
    parser.add_argument(
        "--token",
        default=os.environ.get("RIG_TOKEN", ""),
        help="bearer token that requests must carry, needed with another --host; better given as $RIG_TOKEN",
    )


def _add_screens(parser: argparse.ArgumentParser, default_port: int) -> None:
    group = parser.add_argument_group("screens")
    _add_address(group, default_port)
    group.add_argument(
        "--cors",
        action="append",
        default=[],
        metavar="ORIGIN",
        help="another site whose pages may ask, such as http://notebook.lab:8888; may be given again",
    )
    group.add_argument("--no-view", action="store_true", help="without the live picture (it needs rerun-sdk)")


def _add_recording(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--for", dest="duration", type=duration, metavar="TIME", help="stop after 60s, 5min, 1h …")
    parser.add_argument("--note", default="", help="a word to remember the run by")
    group = parser.add_argument_group("trigger")
    group.add_argument("--start", metavar="CONDITION", help='record from here on, as "speed > 2000" (r/min)')
    group.add_argument("--stop", metavar="CONDITION", help='and up to here, as "speed < 1500", "x > 4.5" (V)')
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


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="rig",
        description="Record, watch, replay and explain the runs of a rotor test rig, the model beside the measurement.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"rig {version('rig-service')}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def add(name: str, run: Callable[[argparse.Namespace], int], text: str) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=text, description=text)
        command.set_defaults(run=run)
        return command

    add_bench_commands(add)

    command = add("record", record.run, "Record a run, with live picture and REST, and sum it up at its end.")
    command.add_argument("config", metavar="RIG.TOML", help="the rig")
    _add_recording(command)
    command.add_argument("--json", action="store_true", help="print the summary as JSON on standard output")
    command.add_argument("--no-serve", action="store_true", help="without page and REST")
    _add_screens(command, 8501)

    command = add("mark", mark.run, "Name the present moment of the run that is recorded, from another terminal.")
    command.add_argument("word", metavar="WORD", nargs="*", help="what it is called (default: mark)")
    command.add_argument("--json", action="store_true", help="as JSON")
    _add_address(command, 8501)

    command = add("acknowledge", acknowledge.run, "Take note of the alarms of the run that goes on; what is over goes.")
    command.add_argument("--json", action="store_true", help="as JSON")
    _add_address(command, 8501)

    command = add("replay", replay.run, "Replay a recording through the same analysis and picture.")
    command.add_argument("recording", metavar="RUN", help="a run's id, or a file")
    command.add_argument("--pace", type=pace, default=1.0, help="1: its own pace (default), 10: ten times, max")
    command.add_argument("--folder", default="", help="where runs are kept")
    command.add_argument("--json", action="store_true", help="print the summary as JSON on standard output")
    command.add_argument("--no-serve", action="store_true", help="without page and REST")
    _add_screens(command, 8501)

    command = add("serve", serve.run, "Serve the page and REST for the recorded runs until stopped.")
    command.add_argument("config", metavar="RIG.TOML", nargs="?", help="the rig; its storage.folder is served")
    command.add_argument("--folder", default="", help="where runs are kept")
    _add_screens(command, 8501)

    command = add("summary", listing.summary, "Say what a run was: speeds, amplitudes, whirl, losses, agreement.")
    command.add_argument("recording", metavar="RUN", help="a run's id, or a file")
    command.add_argument("--folder", default="", help="where runs are kept")
    command.add_argument(
        "--calibration",
        type=calibration,
        action="append",
        default=[],
        metavar="PROBE=FILE",
        help="analyse the samples anew with this record, as x=probe-x-2026-11-24.toml; the recording stays as it is",
    )
    command.add_argument("--json", action="store_true", help="as JSON")

    finding.add_commands(add)
    verify.add_commands(add)
    exchange.add_commands(add)

    _add_model(add)
    return parser


def _add_model(add: Callable[[str, Callable[[argparse.Namespace], int], str], argparse.ArgumentParser]) -> None:
    command = add("predict", predict.run, "Compute what the model expects at the probes over speed, once, and show it.")
    command.add_argument("config", metavar="RIG.TOML", help="the rig")
    command.add_argument("--speed", dest="speed_rpm", type=float, help="only at this speed, r/min")
    command.add_argument("--json", action="store_true", help="as JSON")
    command.add_argument("--quiet", action="store_true", help="only make sure that it is computed")

    add_kinds(
        add("model", lambda _: 2, "Study the rotor and its films: modes to waterfalls, sweeps, the thesis again.")
    )


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code. KeyboardInterrupt where it was stopped by hand."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a console that knows no µ shows a question mark, and the run goes on
    chosen = _parser().parse_args(arguments)
    try:
        code: int = chosen.run(chosen)
        sys.stdout.flush()
    except RigError as error:
        print(f"rig: {error}", file=sys.stderr)
        return error.exit_code
    except RecordingError as error:
        print(f"rig: {error}", file=sys.stderr)
        return UsageError.exit_code
    except BrokenPipeError:
        if not _is_cut_off(sys.stdout):
            raise
        return 130
    return code


def _is_cut_off(stream: TextIO) -> bool:
    """Say whether nobody reads any more what is printed (`| head`); what is left of it then goes nowhere."""
    try:
        print(file=stream, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        return True
    return False
