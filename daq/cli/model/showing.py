"""Showing a study: its table for people, JSON for programs, its plots in a file."""

import argparse
import math
from pathlib import Path

from daq.cli.model.drawing import require_drawing, save
from daq.cli.telling import print_json
from daq.service.documents.study import study_document
from model.studies.study import Cell, Study


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


def check_output(chosen: argparse.Namespace) -> None:
    """Raise UsageError before anything is computed where it could not be drawn."""
    if chosen.output is not None:
        require_drawing(chosen.output)


def show(study: Study, chosen: argparse.Namespace) -> int:
    """Print a study and draw it where that was asked for; return the exit code."""
    if chosen.output is not None:
        save(study.plots, chosen.output)
    if chosen.json:
        print_json(study_document(study))
    else:
        print("\n".join(table_lines(study)))
    return 0


def table_lines(study: Study) -> list[str]:
    """Return a study as lines of text."""
    names = list(study.columns)
    rows = [[_text(cell) for cell in row.values()] for row in study.rows()]
    widths = [max(map(len, column)) for column in zip(names, *rows, strict=True)]
    lines = [study.title, "  ".join(name.rjust(width) for name, width in zip(names, widths, strict=True))]
    lines += ["  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    return lines + list(study.remarks)


def _text(cell: Cell) -> str:
    if isinstance(cell, str):
        return cell
    if not math.isfinite(cell):
        return "–"
    if cell == 0:
        return "0"
    size = abs(cell)
    if size < 1e-3 or size >= 1e7:
        return f"{cell:.4g}"
    return f"{cell:,.1f}" if size >= 1000 else f"{cell:.{max(0, 3 - math.floor(math.log10(size)))}f}"
