"""`rig model sweep`: a quantity for all combinations of parameters."""

import argparse
import textwrap
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np

from daq.cli.arguments import HELP_WIDTH, positive_integer
from daq.cli.model.arguments import (
    FloatArray,
    add_model_file,
    number_range,
    parameters_of,
    plot_file,
    save,
    show_study,
)
from daq.cli.terminal import TerminalOutput
from daq.errors import UsageError
from daq.session.sweep import DaskWorkers, LocalWorkers, Workers, grid, run_sweep
from model.rotor.tables import UNIT_LABELS
from model.studies.study import Plot, Series, Study, Style
from model.studies.sweep_quantities import PARAMETER_SETTERS, QUANTITIES, SweepPoint, SweepResult

MAX_TABLE_ROWS = 40  # printed
MAX_CURVES = 12  # in a plot; more are drawn as points
AXIS_UNITS = UNIT_LABELS | {
    "rad_s": "rad/s", "1_s": "1/s", "um_pk": "µm peak", "um_pp": "µm peak-to-peak", "mm": "mm", "kg": "kg",
}  # fmt: skip


def add_sweep(studies: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the subcommand `sweep`."""
    text = "A quantity for all combinations of parameters, in local processes or on a Dask cluster."
    command = studies.add_parser("sweep", help=text, description=textwrap.fill(text, HELP_WIDTH), allow_abbrev=False)
    command.formatter_class, command.epilog = argparse.RawDescriptionHelpFormatter, _epilog()
    add_model_file(command)
    command.add_argument(
        "--vary",
        type=_vary,
        action="append",
        required=True,
        metavar="NAME=RANGE",
        help="such as viscosity_pa_s=0.005:0.035:7",
    )
    command.add_argument("--quantity", choices=QUANTITIES, default="onset", help="quantity to compute (default: onset)")
    command.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FILE.parquet", help="results; an interrupted sweep resumes"
    )
    command.add_argument("--plot", type=plot_file, metavar="FILE.svg|.png|.pdf", help="draw over the first parameter")
    command.add_argument("--json", action="store_true", help="print all points as JSON")
    where = command.add_mutually_exclusive_group()
    where.add_argument(
        "--processes", type=positive_integer, help="number of local processes (default: one per processor)"
    )
    where.add_argument("--scheduler", default="", metavar="tcp://HOST:PORT", help="use this Dask cluster instead")
    command.set_defaults(run=run_sweep_command)


def _epilog() -> str:
    """Return the help text on parameters and quantities."""
    parts = [
        "parameters:",
        _indented(", ".join(PARAMETER_SETTERS), 2),
        "quantities, with their own options and results:",
    ]
    for name, one in QUANTITIES.items():
        parts += [
            _indented(f"{name}: {one.description}", 2),
            _indented(f"options: {', '.join(one.options)}", 6),
            _indented(f"results: {', '.join(one.results)}", 6),
        ]
    parts.append("example: rig model sweep --vary viscosity_pa_s=0.005:0.035:7 -o onset.parquet")
    return "\n".join(parts)


def _indented(text: str, indent: int) -> str:
    lead = " " * indent
    return textwrap.fill(text, HELP_WIDTH, initial_indent=lead, subsequent_indent=lead)


def _vary(text: str) -> tuple[str, FloatArray]:
    name, equals, range_ = text.partition("=")
    if not (name and equals and range_):
        raise argparse.ArgumentTypeError(f"{text!r}: expected NAME=RANGE, such as viscosity_pa_s=0.005:0.035:7")
    return name, number_range(range_)


def run_sweep_command(args: argparse.Namespace, console: TerminalOutput) -> int:
    """Compute a sweep, write and print it; return the exit code."""
    vary = {name: list(map(float, values)) for name, values in args.vary}
    if len(vary) < len(args.vary):
        raise UsageError("--vary: a name is given twice, expected once each")
    points = grid(parameters_of(args.config), args.quantity, vary)

    def progress(done: int, total: int) -> None:
        console.progress(f"{done:,} of {total:,} points", done / total)

    with ExitStack() as stack:
        workers: Workers = LocalWorkers(args.processes)
        if args.scheduler:
            workers = stack.enter_context(closing(DaskWorkers(args.scheduler)))
        results = run_sweep(points, workers, args.output, progress)
    console.done()
    study = _study(points, results, args.output)
    if args.plot is not None:
        save(study.plots, args.plot)
    show_study(study if args.json else _shortened(study), as_json=args.json)
    return 0


def _study(points: list[SweepPoint], results: list[SweepResult], file: Path) -> Study:
    title, result_names = f"Sweep: {points[0].quantity}", QUANTITIES[points[0].quantity].results
    names = [name for name, _ in points[0].values]
    varied = np.array([[value for _, value in point.values] for point in points])
    found = np.array([outcome.results for outcome in results])
    columns: dict[str, FloatArray | tuple[str, ...]] = dict(
        zip((*names, *result_names), np.hstack((varied, found)).T, strict=True)
    )
    faults = sum(bool(outcome.fault) for outcome in results)
    if faults:
        columns["fault"] = tuple(outcome.fault for outcome in results)
    remarks = (f"{len(points):,} points in {file}" + (f", {faults:,} without result" if faults else ""),)
    plots = tuple(
        Plot(title if k == 0 else "", axis_label(names[0]), axis_label(name), _series(names, varied, found[:, k]))
        for k, name in enumerate(result_names)
    )
    return Study(title, columns, plots, remarks)


def _series(names: list[str], varied: FloatArray, result: FloatArray) -> tuple[Series, ...]:
    """Return a result over the first parameter: a curve for each combination of the others, or points of all."""
    groups, group_of = np.unique(varied[:, 1:], axis=0, return_inverse=True)
    if len(groups) > MAX_CURVES:
        return (Series("", varied[:, 0], result, Style.POINTS),)
    order = np.argsort(varied[:, 0], kind="stable")
    series = []
    for k, group in enumerate(groups):
        label = ", ".join(f"{name} {value:.4g}" for name, value in zip(names[1:], group, strict=True))
        rows = order[group_of.ravel()[order] == k]
        series.append(Series(label, varied[rows, 0], result[rows]))
    return tuple(series)


def axis_label(name: str) -> str:
    """Return the axis label of a name that ends with a unit: "Onset [rad/s]" for ``onset_rad_s``."""
    unit = max((unit for unit in AXIS_UNITS if name.endswith(f"_{unit}")), key=len, default="")
    quantity = name.removesuffix(f"_{unit}").replace("_", " ") if unit else name.replace("_", " ")
    return f"{quantity[0].upper()}{quantity[1:]} [{AXIS_UNITS.get(unit, '–')}]"


def _shortened(study: Study) -> Study:
    size = len(next(iter(study.columns.values())))
    if size <= MAX_TABLE_ROWS:
        return study
    columns = {name: column[:MAX_TABLE_ROWS] for name, column in study.columns.items()}
    return Study(
        study.title, columns, study.plots, (f"… the first {MAX_TABLE_ROWS} of {size:,} points", *study.remarks)
    )
