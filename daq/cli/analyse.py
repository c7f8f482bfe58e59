"""`rig analyse`: analyses of a recorded run as table, JSON, file or plot."""

import argparse
import re
import time
from enum import EnumType
from pathlib import Path
from typing import Any, Literal, TypeVar, get_origin

from pydantic import BaseModel, ValidationError

from daq.cli.arguments import AddCommand, add_json, add_run, show_examples
from daq.cli.runs import find_run
from daq.cli.terminal import Cell, NumberTable, TerminalOutput, format_number, grid, print_json, print_output
from daq.errors import UsageError
from daq.reports.analysis_result import QUANTITIES, AnalysisResult, analysis_schema
from daq.reports.export import analysis_table, encode_analysis
from daq.reports.parameters import MAX_ORDERS, AnalysisFormat
from daq.reports.plots.panel import PlotStyle
from daq.reports.registry import KINDS
from daq.reports.run_samples import RunSamples
from recordings.exchange.formats import write_table
from recordings.mcap.reader import RunReader

PROGRESS_DELAY = 1.0  # s before progress is shown
TABLE_SUFFIXES = (".csv", ".parquet")
PLOT_FORMATS = {".svg": AnalysisFormat.SVG, ".png": AnalysisFormat.PNG, ".pdf": AnalysisFormat.PDF}
PARAMETER_NAME = re.compile(r"`(\w+)`")  # another parameter in a description
DEST_PREFIX = "parameter_"  # separates analysis parameters from other options
FORMAT_PARAMETER = "format"  # no option: the suffix of -o sets the format

Parameters = TypeVar("Parameters", bound=BaseModel)

_EPILOG = """\
Each kind prints a table; --json prints all data, -o FILE.svg, .png or .pdf
plots them, -o FILE.csv or FILE.parquet writes the table. Without --time-s and
--speed-rpm the time of the largest vibration is used. The options are the
parameters of /api/v1/runs/RUN/analyses/KIND, which returns the same numbers.
examples: rig analyse orbit 2026-11-24T09-12-07-gj90c --speed-rpm 11000
          rig analyse orbit RUN --filter orders --orders 1 -o orbit.svg
          rig analyse bode RUN --order 2 --slow-roll-rpm 900 -o bode.png
          rig analyse cascade RUN --lines full -o full-cascade.svg
          rig analyse cascade RUN --source recorded -o quick-look.svg
          rig analyse envelopes RUN --orders 0.49,1,2 -o orders.csv
"""


def add_commands(add: AddCommand) -> None:
    """Add `rig analyse` with its kinds to the command line."""
    command = add("analyse", run_analyse)
    command.epilog, command.formatter_class = _EPILOG, argparse.RawDescriptionHelpFormatter
    kinds = command.add_subparsers(dest="kind", required=True, metavar="KIND")
    for name, kind in KINDS.items():
        text = f"{kind.description}."
        subcommand = kinds.add_parser(name, help=text, description=text)
        add_run(subcommand)
        add_parameters(subcommand, kind.parameters)
        add_json(subcommand)
        subcommand.add_argument(
            "-o",
            "--output",
            type=Path,
            action="append",
            default=[],
            metavar="FILE",
            help=f"plot ({', '.join(PLOT_FORMATS)}) or table ({', '.join(TABLE_SUFFIXES)}); repeatable",
        )
        show_examples(subcommand, f"rig analyse {name} RUN -o {name}.svg")


def run_analyse(args: argparse.Namespace, console: TerminalOutput) -> int:
    """Analyse a run and print or write the result; return the exit code."""
    kind = KINDS[args.kind]
    parameters = read_parameters(args, kind.parameters)
    for file in args.output:
        _require_writable(file)
    catalogue, run_id = find_run(args)
    started = time.monotonic()

    def show_progress(doing: str, part: float | None) -> None:
        if time.monotonic() - started > PROGRESS_DELAY:
            console.progress(doing, part)

    with RunReader(catalogue.path(run_id)) as reader:
        analysis = kind.analyse(RunSamples(reader, show_progress), parameters)
    console.done()
    for file in args.output:
        _write_result(file, analysis, run_id, args.kind, parameters.plot_style())
    if args.json:
        print_json(analysis_schema(run_id, args.kind, analysis))
    else:
        _print_result(analysis)
    return 0


def add_parameters(command: argparse.ArgumentParser, model: type[BaseModel]) -> None:
    """Add an option for each field of a model of parameters."""
    for field, info in model.model_fields.items():
        has_choice = get_origin(info.annotation) is not Literal  # a single source of an analysis
        if has_choice and field != FORMAT_PARAMETER:
            choices = [each.value for each in type(info.default)] if isinstance(type(info.default), EnumType) else None
            default = "" if info.default is None else f" (default: {info.default})"
            text = PARAMETER_NAME.sub(lambda named: _option(named[1]), f"{info.description}{default}")
            command.add_argument(
                _option(field),
                dest=f"{DEST_PREFIX}{field}",
                choices=choices,
                default=argparse.SUPPRESS,
                metavar=None if choices else "VALUE",
                help=(text[:1].lower() + text[1:] if text[1:2].islower() else text).replace("%", "%%"),
            )


def read_parameters(args: argparse.Namespace, model: type[Parameters]) -> Parameters:
    """Return the parameters given as options; UsageError names every invalid option."""
    given = {
        name.removeprefix(DEST_PREFIX): value for name, value in vars(args).items() if name.startswith(DEST_PREFIX)
    }
    try:
        return model.model_validate(given)
    except ValidationError as error:
        faults = [f"{_option(str(each['loc'][0]))} {each['input']}: {_fault_text(each)}" for each in error.errors()]
        raise UsageError("\n     ".join(faults)) from error


def _option(field: str) -> str:
    return f"--{field.replace('_', '-')}"


def _fault_text(fault: Any) -> str:
    """Return what pydantic expected of a value, as an error message of the command line."""
    if fault["type"] == "string_pattern_mismatch":
        return f"expected numbers with commas, at most {MAX_ORDERS}, such as 0.49,1,2"
    text: str = fault["msg"]
    return text[:1].lower() + text[1:]


def _require_writable(file: Path) -> None:
    """Raise UsageError, before anything is computed, if the result could not be written to this file."""
    suffix = file.suffix.lower()
    if suffix not in {*PLOT_FORMATS, *TABLE_SUFFIXES}:
        raise UsageError(f"-o {file}: expected a name that ends with {', '.join((*PLOT_FORMATS, *TABLE_SUFFIXES))}")
    if suffix in TABLE_SUFFIXES and file.exists():
        raise UsageError(f"-o {file}: exists already; tables are never overwritten")
    if not file.parent.is_dir():
        raise UsageError(f"-o {file}: there is no folder {file.parent}")


def _write_result(file: Path, analysis: AnalysisResult, run_id: str, kind: str, style: PlotStyle) -> None:
    file_format = PLOT_FORMATS.get(file.suffix.lower())
    if file_format is None:
        write_table(file, analysis_table(analysis, run_id))
        return
    try:
        file.write_bytes(encode_analysis(analysis, run_id, kind, file_format, style))
    except OSError as error:
        raise UsageError(f"-o {file}: {error.strerror or error}") from error


def _print_result(analysis: AnalysisResult) -> None:
    """Print the preview rows of a result's table, its scalars and remarks."""
    print_output(analysis.title)
    rows = analysis.preview_rows()
    if rows.size:
        names = [column.name for column in analysis.columns]
        print_output(NumberTable(names, [_cells(column.values[rows].tolist()) for column in analysis.columns]))
    if rows.size < analysis.n_rows:
        print_output(f"{rows.size} of {analysis.n_rows:,} rows; all with --json, or -o FILE.csv")
    scalars = (
        (f"{name:16}", format_number(*_cells([value])), QUANTITIES[name].description)
        for name, value in analysis.scalars.items()
    )
    print_output(grid(*scalars), *analysis.remarks)


def _cells(values: list[Cell]) -> list[Cell]:
    """Return the cells of a column; as integers where all its numbers are whole."""
    numbers = [value for value in values if isinstance(value, float)]
    is_whole = bool(numbers) and all(value.is_integer() for value in numbers)
    return [int(value) if is_whole and isinstance(value, float) else value for value in values]
