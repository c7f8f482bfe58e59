"""Output of a study: table, JSON, and plots as SVG or PNG with matplotlib (an extra), without pyplot."""

import argparse
import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from daq.cli.output.terminal import align_columns, print_json
from daq.errors import UsageError
from daq.schemas.study import study_schema
from model.studies.study import Plot, Series, Study, Style, Surface
from recordings.atomic_file import atomic_write

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH, HEIGHT = 8.0, 4.2  # inches
FORMATS = (".svg", ".png")
DEGREE_LIMITS = (0.0, 360.0)  # limits of an axis of angles in degrees
FEW_POINTS = 200  # up to this number, points are drawn larger
_LINE_STYLES: dict[Style, dict[str, Any]] = {
    Style.LINE: {"linestyle": "-", "linewidth": 1.4},
    Style.DASHED: {"linestyle": "--", "linewidth": 1.2},
    Style.DOTTED: {"linestyle": (0, (1, 1.3)), "linewidth": 2.0},
    Style.POINTS: {"linestyle": "", "marker": ".", "markersize": 1.6, "rasterized": True},
    Style.MARKERS: {"linestyle": "", "marker": "o", "markersize": 5.5, "color": "black", "zorder": 5},
    Style.REFERENCE: {"linestyle": (0, (5, 2)), "linewidth": 1.0, "color": "0.4"},
}


def add_output(command: argparse.ArgumentParser) -> None:
    """Add the arguments for the rig file and the output of a study."""
    command.add_argument(
        "config",
        metavar="RIG.TOML",
        nargs="?",
        help="rig file with [model], or rotor file (default: the GJ90C of the thesis)",
    )
    command.add_argument("--json", action="store_true", help="print the table as JSON")
    command.add_argument("-o", "--output", type=Path, metavar="FILE.svg|.png", help="draw the plots into this file")


def check_output(args: argparse.Namespace) -> None:
    """Raise UsageError, before the computation, if the output file cannot be drawn."""
    if args.output is not None:
        require_drawing(args.output)


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


def require_drawing(file: Path | None = None, option: str = "-o") -> None:
    """Raise UsageError if matplotlib is missing or the file format is not supported."""
    if file is not None and file.suffix.lower() not in FORMATS:
        raise UsageError(f"{option} {file}: expected a name that ends with {' or '.join(FORMATS)}")
    try:
        import matplotlib.figure  # noqa: F401, PLC0415  # an extra: only checks whether it is installed
    except ImportError as error:
        raise UsageError("plots need matplotlib: install the extra, pip install 'rig-service[plots]'") from error


def save(plots: Sequence[Plot | Surface], file: Path) -> None:
    """Draw plots, one below the other, into an SVG or PNG file."""
    try:
        with atomic_write(file) as temporary:
            temporary.write_bytes(render(plots, file.suffix.lower().removeprefix(".")))
    except OSError as error:
        raise UsageError(f"{file}: {error.strerror or error}, expected a writable file") from error


def render(plots: Sequence[Plot | Surface], kind: str, salt: str = "rig") -> bytes:
    """Return plots as bytes of an "svg" or "png", reproducible for equal plots and salt."""
    import matplotlib as mpl  # noqa: PLC0415  # an extra, slow to import

    buffer = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": salt, "svg.fonttype": "none", "font.size": 9.5, "axes.titlesize": 10.5}):
        figure = draw(plots)
        metadata = {"Date": None} if kind == "svg" else None
        figure.savefig(buffer, format=kind, dpi=120, metadata=metadata)
    return buffer.getvalue()


def draw(plots: Sequence[Plot | Surface]) -> "Figure":
    """Return a figure of the plots, one below the other."""
    from matplotlib.figure import Figure  # noqa: PLC0415  # an extra, slow to import

    figure = Figure(figsize=(WIDTH, HEIGHT * len(plots)), layout="constrained")
    grid = figure.subplots(len(plots), 1, squeeze=False)
    for axes, plot in zip(grid[:, 0], plots, strict=True):
        axes.set_title(plot.title)
        axes.set_xlabel(plot.x_label)
        axes.set_ylabel(plot.y_label)
        if isinstance(plot, Surface):
            _surface(figure, axes, plot)
        else:
            _plot(axes, plot)
    return figure


def _plot(axes: "Axes", plot: Plot) -> None:
    for series in plot.series:
        _series(axes, series)
    _scales(axes, plot)
    axes.grid(visible=True, which="both" if plot.x_log or plot.y_log else "major", color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    _plain_numbers(axes, is_log=(plot.x_log, plot.y_log))
    named = len(axes.get_legend_handles_labels()[1])
    if not axes.lines:
        axes.set_xticks([])
        axes.set_yticks([])
        axes.text(0.5, 0.5, plot.empty_text, transform=axes.transAxes, ha="center", color="0.4")
    elif named > 1 or (named == 1 and len(plot.series) > 1):  # right of the axes, so that it hides no line
        axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)


def _scales(axes: "Axes", plot: Plot) -> None:
    if plot.x_log:
        axes.set_xscale("log")
    if plot.y_log:
        axes.set_yscale("log")
    if plot.x_limits is not None:
        axes.set_xlim(*plot.x_limits)
        if plot.x_limits == DEGREE_LIMITS:
            axes.set_xticks(range(0, 361, 90))
    elif not plot.x_log:
        axes.margins(x=0.02)
    if plot.y_limits is not None:
        axes.set_ylim(*plot.y_limits)
        if plot.y_limits == DEGREE_LIMITS:
            axes.set_yticks(range(0, 361, 90))
    if plot.is_square:
        axes.set_aspect("equal", adjustable="datalim")


def _series(axes: "Axes", series: Series) -> None:
    if not np.any(np.isfinite(series.y)):
        return
    line_style = _LINE_STYLES[series.style]
    if not series.label and "color" not in line_style and axes.lines:
        line_style = {**line_style, "color": axes.lines[-1].get_color()}  # one legend entry for several lines
    if series.style is Style.POINTS and np.count_nonzero(np.isfinite(series.y)) <= FEW_POINTS:
        line_style = {**line_style, "markersize": 4.0}
    axes.plot(series.x, series.y, label=series.label or None, **line_style)


def _plain_numbers(axes: "Axes", *, is_log: tuple[bool, bool]) -> None:
    """Format linear axes with thousands separators and without an offset."""
    from matplotlib.ticker import FuncFormatter, ScalarFormatter  # noqa: PLC0415  # an extra, slow to import

    for axis, logarithmic in zip((axes.xaxis, axes.yaxis), is_log, strict=True):
        low, high = sorted(axis.get_view_interval())
        if logarithmic:
            continue
        if 2000 <= max(abs(low), abs(high)) < 1e6:
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
        else:
            axis.set_major_formatter(ScalarFormatter(useOffset=False))


def _surface(figure: "Figure", axes: "Axes", plot: Surface) -> None:
    from matplotlib.colors import LogNorm  # noqa: PLC0415  # an extra, slow to import

    low, high = plot.z_limits
    shown = axes.pcolormesh(
        plot.x,
        plot.y,
        np.ma.masked_invalid(plot.z),
        norm=LogNorm(low, high),
        cmap="viridis",
        shading="nearest",
        rasterized=True,
    )
    axes.set_facecolor("0.85")
    for series in plot.guides:
        axes.plot(series.x, series.y, color="white", linewidth=0.8, linestyle="--")
    axes.set_xlim(plot.x[0], plot.x[-1])
    _plain_numbers(axes, is_log=(False, False))
    figure.colorbar(shown, ax=axes, label=plot.z_label)
