"""The command-line parser of `rig`, and the exit codes of its errors."""

import argparse
import importlib
import os
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from typing import TextIO

from daq.cli.arguments import Run, show_examples
from daq.cli.terminal import TerminalOutput, use_ascii_fallback
from daq.errors import RigError, UsageError
from daq.stop_flag import EXIT_INTERRUPTED

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


COMMANDS = {
    "check": ("preflight", "Check a rig file and its calibrations without hardware; all errors are reported together."),
    "devices": ("preflight", "List the connected devices: product, serial number, simulated, busy."),
    "preflight": ("preflight", "Check the rig before a run; report the remedy for each failed check."),
    "calibrate": ("preflight", "Calibrate a probe, or determine the tacho's switching levels."),
    "record": ("recording", "Record a run with live view and REST, and print its summary."),
    "replay": ("recording", "Replay a recording through the live analysis and view."),
    "serve": ("recording", "Serve page and REST for the recorded runs until stopped."),
    "mark": ("markers", "Add a marker to the run that is recording, from another terminal."),
    "acknowledge": ("markers", "Acknowledge the alarms of the live run, from another terminal."),
    "summary": ("runs", "Summarise a run: speeds, amplitudes, whirl, lost samples, agreement with the model."),
    "analyse": ("analyse", "Analyse a run's samples: orbit, Bode plot, cascade, orders, sub-synchronous …"),
    "index": ("runs", "Update the catalogue from the files; list new, changed, damaged and missing recordings."),
    "runs": ("runs", "List the recorded runs, newest first, filtered by the options given."),
    "annotate": ("runs", "Add a remark or tags to a run; the recording is not changed."),
    "verify": ("runs", "Check a recording: checksums, indexes, continuity, sample counts, calibration."),
    "recover": ("runs", "Copy the intact part of a damaged recording and list what is missing."),
    "import": ("exchange", "Import another program's file as a run."),
    "export": ("exchange", "Export a run or part of it to another format."),
    "predict": ("model.studies", "Compute and show the model's prediction at the probes over speed."),
    "model": ("model.studies", "Study the rotor model: modes, stability, waterfalls, sweeps, thesis figures."),
}
"""Module of each command, below daq.cli, and what the command does."""


def rig_parser(command: str | None = None) -> argparse.ArgumentParser:
    """Return the parser of the command line.

    Parameters
    ----------
    command : str or None
        The command whose module is imported and adds its arguments; none of them where it is no command; all where it
        is None. Importing all takes seconds.
    """
    parser = argparse.ArgumentParser(
        prog="rig",
        description="Record, view, replay and analyse the runs of a rotor test rig,\n"
        "compared with the rotor model's prediction.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"rig {version('rig-service')}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    parsers = {name: commands.add_parser(name, help=text, description=text) for name, (_, text) in COMMANDS.items()}

    def add(
        name: str, run: Run, *shared: Callable[[argparse.ArgumentParser], object], examples: Sequence[str] = ()
    ) -> argparse.ArgumentParser:
        parsers[name].set_defaults(run=run)
        if examples:
            show_examples(parsers[name], *examples)
        for add_arguments in shared:
            add_arguments(parsers[name])
        return parsers[name]

    wanted = COMMANDS if command is None else {command} & COMMANDS.keys()
    for module in dict.fromkeys(COMMANDS[name][0] for name in wanted):
        importlib.import_module(f"daq.cli.{module}").add_commands(add)
    return parser


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code.

    Errors of our own become one message; any other exception is a defect and escapes with its traceback.

    Raises
    ------
    KeyboardInterrupt
        The command was stopped by a signal.
    """
    for stream in (sys.stdout, sys.stderr):
        use_ascii_fallback(stream)
    given = sys.argv[1:] if arguments is None else arguments
    parser = rig_parser(next((argument for argument in given if not argument.startswith("-")), ""))
    if not given:
        parser.print_help(sys.stderr)
        return UsageError.exit_code
    args = parser.parse_args(given)
    console = TerminalOutput()
    try:
        code: int = args.run(args, console)
        sys.stdout.flush()
    except RigError as error:
        console.line(f"rig: {error}")
        return error.exit_code
    except tuple(_exit_codes()) as error:
        console.line(f"rig: {error}")
        return next(code for tree, code in _exit_codes().items() if isinstance(error, tree))
    except BrokenPipeError:
        if not _is_reader_gone(sys.stdout):
            raise
        return EXIT_INTERRUPTED
    finally:
        console.done()
    return code


def _exit_codes() -> dict[type[Exception], int]:
    """Return the exit codes of the error trees below daq; imported only after an error: they are in large packages."""
    from analysis.signals.errors import AnalysisError
    from model.errors import ModelError, ParameterError
    from recordings.errors import RecordingError

    return {RecordingError: UsageError.exit_code, ParameterError: UsageError.exit_code, ModelError: 1, AnalysisError: 1}


def _is_reader_gone(stream: TextIO) -> bool:
    """Return whether the reader of a pipe has closed it (`| head`); if so, discard further output."""
    try:
        print(file=stream, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        return True
    return False
