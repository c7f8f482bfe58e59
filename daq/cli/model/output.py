"""Output of a study: table, JSON and plots as SVG, PNG or PDF."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from daq.cli.terminal import align_columns, print_json
from daq.errors import UsageError
from daq.schemas.study import study_schema
from model.studies.study import Plot, Study, Surface
from recordings.file_operations import atomic_write

FORMATS = (".svg", ".png", ".pdf")


def add_output(command: argparse.ArgumentParser) -> None:
    """Add the arguments for the rig file and the output of a study."""
    command.add_argument(
        "config",
        metavar="RIG.TOML",
        nargs="?",
        help="rig file with [model], or rotor file (default: the GJ90C of the thesis)",
    )
    command.add_argument("--json", action="store_true", help="print the table as JSON")
    command.add_argument("-o", "--output", type=Path, metavar="FILE.svg|.png|.pdf", help="draw the plots")


def check_output(args: argparse.Namespace) -> None:
    """Raise UsageError, before the computation, if the output file cannot be drawn."""
    if args.output is not None:
        require_plot_format(args.output)


def show_study(study: Study, args: argparse.Namespace) -> int:
    """Print a study and, with `-o`, draw it; return the exit code."""
    if args.output is not None:
        save(study.plots, args.output)
    if args.json:
        print_json(study_schema(study))
    else:
        print("\n".join(table_lines(study)))
    return 0


def table_lines(study: Study) -> list[str]:
    """Return title, table and remarks of a study as lines of text."""
    rows = [list(row.values()) for row in study.rows()]
    return [study.title, *align_columns(list(study.columns), rows), *study.remarks]


def require_plot_format(file: Path, option: str = "-o") -> None:
    """Raise UsageError if the suffix is not that of a plot."""
    if file.suffix.lower() not in FORMATS:
        raise UsageError(f"{option} {file}: expected a name that ends with {', '.join(FORMATS)}")


def save(plots: Sequence[Plot | Surface], file: Path) -> None:
    """Draw plots, one below the other, into an SVG, PNG or PDF file."""
    from daq.reports.plots.study_plots import render  # noqa: PLC0415 - imports matplotlib, which takes a second

    try:
        with atomic_write(file) as temporary:
            temporary.write_bytes(render(plots, file.suffix.lower().removeprefix(".")))
    except OSError as error:
        raise UsageError(f"{file}: {error.strerror or error}, expected a writable file") from error
