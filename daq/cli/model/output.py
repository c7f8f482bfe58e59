"""Showing a study: its table for people, JSON for programs, its plots in a file."""

import argparse
from pathlib import Path

from daq.cli.model.figures import require_drawing, save
from daq.cli.output.terminal import align_columns, print_json
from daq.schemas.study import study_schema
from model.studies.study import Study


def add_output(command: argparse.ArgumentParser) -> None:
    """Give a command the rig file and the ways in which a study is shown."""
    command.add_argument(
        "config",
        metavar="RIG.TOML",
        nargs="?",
        help="the rig, for its [model], or a rotor's own file (default: the thesis's GJ90C)",
    )
    command.add_argument("--json", action="store_true", help="the table as JSON on standard output")
    command.add_argument("-o", "--output", type=Path, metavar="FILE.svg|.png", help="draw it")


def check_output(args: argparse.Namespace) -> None:
    """Raise UsageError before anything is computed where it could not be drawn."""
    if args.output is not None:
        require_drawing(args.output)


def show_study(study: Study, args: argparse.Namespace) -> int:
    """Print a study and draw it where that was asked for; return the exit code."""
    if args.output is not None:
        save(study.plots, args.output)
    if args.json:
        print_json(study_schema(study))
    else:
        print("\n".join(table_lines(study)))
    return 0


def table_lines(study: Study) -> list[str]:
    """Return a study as lines of text."""
    rows = [list(row.values()) for row in study.rows()]
    return [study.title, *align_columns(list(study.columns), rows), *study.remarks]
