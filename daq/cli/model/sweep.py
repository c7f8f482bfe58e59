"""`rig model sweep`: a quantity for all combinations of parameters."""

import argparse
import textwrap
from collections.abc import Callable
from pathlib import Path

import numpy as np

from daq.cli.model.arguments import FloatArray, model_errors, number_range, parameters_of, positive_integer
from daq.cli.model.output import require_plot_format, save, show_study
from daq.cli.progress import TerminalOutput
from daq.errors import UsageError
from daq.session.sweep import DaskWorkers, LocalWorkers, grid, run_sweep
from model.rotor.tables import UNIT_LABELS
from model.studies.study import Plot, Series, Study, Style
from model.studies.sweep_quantities import PARAMETER_SETTERS, QUANTITIES, SweepPoint, SweepResult

MAX_TABLE_ROWS = 40  # printed
MAX_CURVES = 12  # in a plot; more are drawn as points
AXIS_UNITS = UNIT_LABELS | {
    "rad_s": "rad/s", "1_s": "1/s", "um_pk": "µm peak", "um_pp": "µm peak-to-peak", "mm": "mm", "kg": "kg",
}  # fmt: skip
_WIDTH = 78  # of the help


def add_sweep(add: Callable[[str, str], argparse.ArgumentParser]) -> None:
    """Add the subcommand `sweep`."""
    command = add("sweep", "A quantity for all combinations of parameters, in local processes or on a Dask cluster.")
    command.formatter_class = argparse.RawDescriptionHelpFormatter
    command.description = textwrap.fill(command.description or "", _WIDTH)
    command.epilog = _epilog()
    command.add_argument(
        "config", metavar="RIG.TOML", nargs="?", help="rig file or rotor file (default: the GJ90C of the thesis)"
    )
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
    command.add_argument("--plot", type=Path, metavar="FILE.svg|.png|.pdf", help="draw over the first parameter")
    command.add_argument("--json", action="store_true", help="print all points as JSON")
    where = command.add_mutually_exclusive_group()
    where.add_argument(
        "--processes", type=positive_integer, help="number of local processes (default: one per processor)"
    )
    where.add_argument("--scheduler", default="", metavar="tcp://HOST:PORT", help="use this Dask cluster instead")
    command.set_defaults(run=run)


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
    return textwrap.fill(text, _WIDTH, initial_indent=lead, subsequent_indent=lead)


def _vary(text: str) -> tuple[str, FloatArray]:
    name, equals, range_ = text.partition("=")
    if not (name and equals and range_):
        raise argparse.ArgumentTypeError(f"{text!r}: expected NAME=RANGE, such as viscosity_pa_s=0.005:0.035:7")
    return name, number_range(range_)


def run(args: argparse.Namespace) -> int:
    """Compute a sweep, write and print it; return the exit code."""
    if args.plot is not None:
        require_plot_format(args.plot, "--plot")
    vary = dict(args.vary)
    if len(vary) < len(args.vary):
        raise UsageError("--vary: a name is given twice, expected once each")
    parameters = parameters_of(args.config)
    with model_errors():
        points = grid(parameters, args.quantity, {name: list(map(float, one)) for name, one in vary.items()})
    console = TerminalOutput()

    def progress(done: int, total: int) -> None:
        console.progress(f"{done:,} of {total:,} points")

    if args.scheduler:
        cluster = DaskWorkers(args.scheduler)
        try:
            results = run_sweep(points, cluster, args.output, progress)
        finally:
            cluster.close()
    else:
        results = run_sweep(points, LocalWorkers(args.processes), args.output, progress)
    console.done()
    study = _study(points, results, args.output)
    if args.plot is not None:
        save(study.plots, args.plot)
    args.output = None  # the results are written already; -o is no plot here
    return show_study(study if args.json else _shortened(study), args)


def _study(points: list[SweepPoint], results: list[SweepResult], file: Path) -> Study:
    names = [name for name, _ in points[0].values]
    result_names = QUANTITIES[points[0].quantity].results
    columns: dict[str, FloatArray | tuple[str, ...]] = {
        name: np.array([dict(point.values)[name] for point in points]) for name in names
    }
    found = np.array([outcome.results for outcome in results])
    for number, name in enumerate(result_names):
        columns[name] = found[:, number]
    faults = sum(bool(outcome.fault) for outcome in results)
    if faults:
        columns["fault"] = tuple(outcome.fault for outcome in results)
    remarks = (f"{len(points):,} points in {file}" + (f", {faults:,} without result" if faults else ""),)
    others = np.array([[value for _, value in point.values[1:]] for point in points])
    first = np.array([point.values[0][1] for point in points])
    plots = []
    for number, name in enumerate(result_names):
        series = []
        for group in np.unique(others, axis=0) if others.size else [np.empty(0)]:
            in_group = np.all(others == group, axis=1) if others.size else np.ones(len(points), bool)
            label = ", ".join(f"{one} {value:.4g}" for one, value in zip(names[1:], group, strict=True))
            order = np.argsort(first[in_group], kind="stable")
            series.append(Series(label, first[in_group][order], found[in_group, number][order]))
        drawn = series if len(series) <= MAX_CURVES else [Series("", first, found[:, number], Style.POINTS)]
        title = f"Sweep: {points[0].quantity}" if number == 0 else ""
        plots.append(Plot(title, axis_label(names[0]), axis_label(name), tuple(drawn)))
    return Study(f"Sweep: {points[0].quantity}", columns, tuple(plots), remarks)


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
