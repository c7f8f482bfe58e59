"""The command-line parser of `rig`, and the exit codes of its errors."""

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from typing import TextIO

from daq.cli.analyse import add_analyse_command
from daq.cli.arguments import AddCommand, show_examples, speed
from daq.cli.calibrate import add_calibrate_command
from daq.cli.exchange import add_exchange_commands
from daq.cli.markers import add_marker_commands
from daq.cli.model import predict
from daq.cli.model.commands import add_model_commands
from daq.cli.output.terminal import use_ascii_fallback
from daq.cli.preflight import add_preflight_commands
from daq.cli.recording import add_recording_commands
from daq.cli.runs import add_run_commands, add_summary_command
from daq.cli.verify import add_verify_commands
from daq.errors import RigError, UsageError
from daq.stop_flag import EXIT_INTERRUPTED
from recordings.errors import RecordingError

_EPILOG = """\
exit codes:
  0    success
  1    failed; the message gives the reason
  2    wrong usage or configuration; nothing was recorded
  3    device missing, busy or failed
  4    preflight: at least one check failed;
       calibrate tacho: the signal does not switch
  5    samples lost, or the recording is incomplete or damaged; the file remains
  130  stopped by Ctrl-C or a signal; the file is complete

Recordings go to storage.folder of the rig file, else $RIG_DATA, else ./data.
"""


def rig_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(
        prog="rig",
        description="Record, view, replay and analyse the runs of a rotor test rig,\n"
        "compared with the rotor model's prediction.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"rig {version('rig-service')}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def add(name: str, run: Callable[[argparse.Namespace], int], text: str) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=text, description=text)
        command.set_defaults(run=run)
        return command

    add_preflight_commands(add)
    add_calibrate_command(add)
    add_recording_commands(add)
    add_marker_commands(add)
    add_summary_command(add)
    add_analyse_command(add)
    add_run_commands(add)
    add_verify_commands(add)
    add_exchange_commands(add)
    _add_model(add)
    return parser


def _add_model(add: AddCommand) -> None:
    command = add("predict", predict.run, "Compute and show the model's prediction at the probes over speed.")
    command.add_argument("config", metavar="RIG.TOML", help="rig file")
    command.add_argument("--speed", dest="speed_rpm", type=speed, metavar="RPM", help="only the settled motion there")
    command.add_argument("--json", action="store_true", help="print JSON")
    command.add_argument("--quiet", action="store_true", help="only compute and cache it, for later runs")
    show_examples(command, "rig predict rigs/bench.toml --speed 11000")

    text = "Study the rotor model: modes, stability, waterfalls, sweeps, thesis figures."
    add_model_commands(add("model", lambda _: UsageError.exit_code, text))


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code.

    Raises
    ------
    KeyboardInterrupt
        The command was stopped by a signal.
    """
    for stream in (sys.stdout, sys.stderr):
        use_ascii_fallback(stream)
    parser = rig_parser()
    if not (sys.argv[1:] if arguments is None else arguments):
        parser.print_help(sys.stderr)
        return UsageError.exit_code
    args = parser.parse_args(arguments)
    try:
        code: int = args.run(args)
        sys.stdout.flush()
    except RigError as error:
        print(f"rig: {error}", file=sys.stderr)
        return error.exit_code
    except RecordingError as error:
        print(f"rig: {error}", file=sys.stderr)
        return UsageError.exit_code
    except BrokenPipeError:
        if not _is_reader_gone(sys.stdout):
            raise
        return EXIT_INTERRUPTED
    return code


def _is_reader_gone(stream: TextIO) -> bool:
    """Return whether the reader of a pipe has closed it (`| head`); if so, discard further output."""
    try:
        print(file=stream, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        return True
    return False
