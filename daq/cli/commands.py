"""The command `rig`: its words, and what becomes of its errors."""

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from typing import TextIO

from daq.cli import analyse, run_files, runs
from daq.cli.arguments import add_folder, calibration, show_examples, speed
from daq.cli.bench import add_bench_commands
from daq.cli.calibrate import add_calibrate_command
from daq.cli.model import predict
from daq.cli.model.commands import add_model_commands
from daq.cli.output.terminal import use_known_letters
from daq.cli.recording import add_run_commands
from daq.errors import RigError, UsageError
from recordings.errors import RecordingError

_EPILOG = """\
exit codes:
  0    good
  1    it cannot be done, and the message says why
  2    usage or configuration wrong; nothing was recorded
  3    the device is missing, busy or failed
  4    preflight: something stands against a run;
       calibrate tacho: its signal does not switch
  5    data lost or the recording is not whole (the file is kept)
  130  stopped by hand (the file is complete)

Runs are kept in the folder that storage.folder of the rig file names,
else in $RIG_DATA, else in ./data.
"""


def rig_parser() -> argparse.ArgumentParser:
    """Return what reads the command line."""
    parser = argparse.ArgumentParser(
        prog="rig",
        description="Record, watch, replay and explain the runs of a rotor test rig,\n"
        "the model beside the measurement.",
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

    add_calibrate_command(add)
    add_run_commands(add)

    command = add("summary", runs.run_summary, "Say what a run was: speeds, amplitudes, whirl, losses, agreement.")
    command.add_argument("recording", metavar="RUN", help="a run's id, or a file")
    add_folder(command)
    command.add_argument(
        "--calibration",
        type=calibration,
        action="append",
        default=[],
        metavar="PROBE=FILE",
        help="analyse the samples anew with this record, as x=probe-x-2026-11-24.toml; may be given again; "
        "the recording stays as it is",
    )
    command.add_argument("--json", action="store_true", help="as JSON")
    show_examples(command, "rig summary 2026-11-24T09-12-07-gj90c")

    analyse.add_commands(add)
    runs.add_commands(add)
    run_files.add_verify_commands(add)
    run_files.add_exchange_commands(add)

    _add_model(add)
    return parser


def _add_model(add: Callable[[str, Callable[[argparse.Namespace], int], str], argparse.ArgumentParser]) -> None:
    command = add("predict", predict.run, "Compute what the model expects at the probes over speed, once, and show it.")
    command.add_argument("config", metavar="RIG.TOML", help="the rig")
    command.add_argument("--speed", dest="speed_rpm", type=speed, metavar="RPM", help="only at this speed, settled")
    command.add_argument("--json", action="store_true", help="as JSON")
    command.add_argument("--quiet", action="store_true", help="only see that it is computed, for runs to come")
    show_examples(command, "rig predict rigs/bench.toml --speed 11000")

    add_model_commands(
        add("model", lambda _: 2, "Study the rotor and its films: modes to waterfalls, sweeps, the thesis again.")
    )


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code. KeyboardInterrupt where it was stopped by hand."""
    for stream in (sys.stdout, sys.stderr):
        use_known_letters(stream)
    parser = rig_parser()
    if not (sys.argv[1:] if arguments is None else arguments):
        parser.print_help(sys.stderr)
        return UsageError.exit_code
    chosen = parser.parse_args(arguments)
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
