"""`rig analyse`: what the samples of a run say as a whole, each kind in a table, as JSON, in files, drawn."""

import argparse
import re
import time
from collections.abc import Iterator
from enum import EnumType
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from daq.cli.arguments import AddCommand, add_folder, show_examples
from daq.cli.output.progress import Console
from daq.cli.output.terminal import Cell, align_columns, format_number, print_json, print_lines
from daq.cli.runs import find_run
from daq.errors import UsageError
from daq.reports.analysis_export import analysis_table, encode_analysis
from daq.reports.analysis_result import AnalysisResult
from daq.reports.analysis_schema import analysis_schema
from daq.reports.columns import QUANTITIES
from daq.reports.errors import DataNotFoundError, PngUnavailableError, RequestTooLargeError
from daq.reports.parameters import MAX_ORDERS, AnalysisForm, QueryParameters
from daq.reports.plots.png import require_matplotlib
from daq.reports.registry import KINDS
from daq.reports.run_samples import RunSamples
from recordings.exchange.formats import write_table
from recordings.mcap.reader import RunReader

QUIET = 1.0  # s that a command may take before it tells how far it is
TABLES = (".csv", ".parquet")
DRAWINGS = {".svg": AnalysisForm.SVG, ".png": AnalysisForm.PNG}
NAMED = re.compile(r"`(\w+)`")  # a parameter in the words on another
NOT_AN_OPTION = "format"  # a file's suffix tells it here

_EPILOG = """\
Every kind prints a table; --json gives all of it to programs, -o FILE.svg or
FILE.png draws it, -o FILE.csv or FILE.parquet keeps it. Without --time-s and
--speed-rpm the moment of the largest vibration is taken. The options are the
parameters of /api/v1/runs/RUN/analyses/KIND, which gives the same numbers.
examples: rig analyse orbit 2026-11-24T09-12-07-gj90c --speed-rpm 11000
          rig analyse orbit RUN --filter orders --orders 1 -o orbit.svg
          rig analyse bode RUN --order 2 --slow-roll-rpm 900 -o bode.png
          rig analyse cascade RUN --lines full -o full-cascade.svg
          rig analyse envelopes RUN --orders 0.49,1,2 -o orders.csv
"""


def add_analyse_command(add: AddCommand) -> None:
    """AddCommand the command to the command line."""
    command = add("analyse", lambda _: 2, "Analyse a run's samples: orbits, Bode, cascades, orders, what is below 1X …")
    command.epilog = _EPILOG
    command.formatter_class = argparse.RawDescriptionHelpFormatter
    kinds = command.add_subparsers(dest="kind", required=True, metavar="KIND")
    for name, kind in KINDS.items():
        text = f"{kind.description}."
        one = kinds.add_parser(name, help=text, description=text)
        one.add_argument("recording", metavar="RUN", help="a run's id, or a file")
        for field, info in kind.parameters.model_fields.items():
            if field != NOT_AN_OPTION:
                _add_option(one, field, info)
        add_folder(one)
        one.add_argument("--json", action="store_true", help="everything as JSON on standard output")
        one.add_argument(
            "-o", "--output", type=Path, action="append", default=[], metavar="FILE",
            help=f"draw it ({', '.join(DRAWINGS)}) or keep its table ({', '.join(TABLES)}); may be given again",
        )  # fmt: skip
        show_examples(one, f"rig analyse {name} RUN -o {name}.svg")
        one.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Make an analysis; return the exit code."""
    kind = KINDS[args.kind]
    question = _question(kind.parameters, args)
    for file in args.output:
        _require_writable(file)
    catalogue, run_id = find_run(args.recording, args.folder)
    console, begun = Console(), time.monotonic()

    def tell(doing: str, part: float | None) -> None:
        if time.monotonic() - begun > QUIET:
            console.progress(doing, part)

    try:
        with RunReader(catalogue.path(run_id)) as reader:
            analysis = kind.analyse(RunSamples(reader, tell), question)
    except (DataNotFoundError, RequestTooLargeError) as error:
        raise UsageError(str(error)) from error
    finally:
        console.done()
    for file in args.output:
        _write(file, analysis, run_id, args.kind)
    if args.json:
        print_json(analysis_schema(run_id, args.kind, analysis))
    else:
        print_lines(_lines(analysis))
    return 0


def _add_option(command: argparse.ArgumentParser, field: str, info: FieldInfo) -> None:
    default = info.default
    told = "" if default is None else f" (default: {default})"
    choices = [each.value for each in type(default)] if isinstance(type(default), EnumType) else None
    description = NAMED.sub(lambda named: _option(named[1]), f"{info.description}{told}")
    description = description.replace("%", "%%").replace("is a 404", "is refused")
    metavar = None if choices else "VALUE"
    command.add_argument(
        _option(field), dest=f"asked_{field}", choices=choices, default=argparse.SUPPRESS, metavar=metavar,
        help=description[:1].lower() + description[1:] if description[1:2].islower() else description,
    )  # fmt: skip


def _option(field: str) -> str:
    return f"--{field.replace('_', '-')}"


def _question(model: type[QueryParameters], args: argparse.Namespace) -> QueryParameters:
    """Return what was asked; UsageError names every option that is wrong."""
    given = {name.removeprefix("asked_"): value for name, value in vars(args).items() if name.startswith("asked_")}
    try:
        return model.model_validate(given)
    except ValidationError as error:
        faults = [f"{_option(str(each['loc'][0]))} {each['input']}: {_said(each)}" for each in error.errors()]
        raise UsageError("\n     ".join(faults)) from error


def _said(fault: Any) -> str:
    if fault["type"] == "string_pattern_mismatch":
        return f"expected numbers with commas, at most {MAX_ORDERS}, such as 0.49,1,2"
    text: str = fault["msg"]
    return text[:1].lower() + text[1:]


def _require_writable(file: Path) -> None:
    """Raise UsageError before anything is computed where it could not be kept or drawn."""
    suffix = file.suffix.lower()
    if suffix not in {*DRAWINGS, *TABLES}:
        raise UsageError(f"-o {file}: expected a name that ends with {', '.join((*DRAWINGS, *TABLES))}")
    if suffix in TABLES and file.exists():
        raise UsageError(f"-o {file}: exists already; nothing is written over")
    if not file.parent.is_dir():
        raise UsageError(f"-o {file}: there is no folder {file.parent}")
    if DRAWINGS.get(suffix) is AnalysisForm.PNG:
        try:
            require_matplotlib()
        except PngUnavailableError as error:
            raise UsageError(f"-o {file}: {error}") from error


def _write(file: Path, analysis: AnalysisResult, run_id: str, kind: str) -> None:
    form = DRAWINGS.get(file.suffix.lower())
    if form is None:
        write_table(file, analysis_table(analysis, run_id))
        return
    try:
        file.write_bytes(encode_analysis(analysis, run_id, kind, form))
    except OSError as error:
        raise UsageError(f"-o {file}: {error.strerror or error}") from error


def _lines(analysis: AnalysisResult) -> Iterator[str]:
    """Yield an analysis for a terminal: the rows that tell most, the figures, the remarks."""
    yield analysis.title
    rows = analysis.preview_rows()
    if rows.size:
        names = [column.name for column in analysis.columns]
        cells = zip(*(_cells(column.values[rows].tolist()) for column in analysis.columns), strict=True)
        yield from align_columns(names, list(cells), stacked=True)
    if rows.size < analysis.n_rows:
        yield f"{rows.size} of {analysis.n_rows:,} rows; all with --json, or -o FILE.csv"
    for name, value in analysis.figures.items():
        yield f"{name:16}  {format_number(*_cells([value]))}  {QUANTITIES[name].description}"
    yield from analysis.remarks


def _cells(values: list[Cell]) -> list[Cell]:
    """Return values to be printed, whole numbers as such."""
    numbers = [value for value in values if isinstance(value, float)]
    is_whole = bool(numbers) and all(value.is_integer() for value in numbers)
    return [int(value) if is_whole and isinstance(value, float) else value for value in values]
