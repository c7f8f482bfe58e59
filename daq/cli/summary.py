"""`rig summary`: the summary of a recorded run."""

import argparse

from daq.cli.arguments import INCOMPLETE, AddCommand, add_folder, calibration, show_examples
from daq.cli.progress import TerminalOutput
from daq.cli.run_text import print_summary
from daq.cli.runs import find_run
from daq.config.calibration import load_calibration
from daq.reports.run_summaries import Summaries
from daq.session.predictor import Predictors


def add_commands(add: AddCommand) -> None:
    """Add `rig summary` to the command line."""
    command = add("summary", run_summary)
    command.add_argument("recording", metavar="RUN", help="run id or file")
    add_folder(command)
    command.add_argument(
        "--calibration",
        type=calibration,
        action="append",
        default=[],
        metavar="PROBE=FILE",
        help="re-evaluate the samples with this calibration, as x=probe-x-2026-11-24.toml; repeatable; the recording "
        "is not changed",
    )
    command.add_argument("--json", action="store_true", help="print JSON")
    show_examples(command, "rig summary 2026-11-24T09-12-07-gj90c")


def run_summary(args: argparse.Namespace) -> int:
    """Print the summary of a run; return the exit code."""
    console = TerminalOutput()
    catalogue, run_id = find_run(args.recording, args.folder)
    calibrations = {name: load_calibration(path) for name, path in args.calibration}
    with Predictors() as predictors:
        summaries = Summaries(catalogue, predictors)
        if calibrations:
            summary = summaries.recalibrated_summary(run_id, calibrations, console.progress)
        else:
            summary = summaries.summary_with_agreement(run_id, console.progress)
    console.clear()
    print_summary(summary, as_json=args.json)
    return 0 if summary.is_gap_free else INCOMPLETE
