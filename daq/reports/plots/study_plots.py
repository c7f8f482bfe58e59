"""Plots of model studies: curves and surfaces with labelled axes."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter, ScalarFormatter

from daq.reports.plots.panel import PlotStyle
from daq.reports.plots.render import figure_bytes, new_figure, plot_settings
from model.studies.study import Plot, Series, Style, Surface

HEIGHT = 90.0  # mm, of a plot
DEGREE_LIMITS = (0.0, 360.0)  # limits of an axis of angles in degrees
FEW_DECADES = 100.0  # ratio of the ends of a logarithmic axis, below which ticks between decades have labels
FEW_POINTS = 200  # up to this number, points are drawn larger
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_LINE_STYLES: dict[Style, dict[str, Any]] = {
    Style.LINE: {"linestyle": "-", "linewidth": 1.4},
    Style.DASHED: {"linestyle": "--", "linewidth": 1.2},
    Style.DOTTED: {"linestyle": (0, (1, 1.3)), "linewidth": 2.0},
    Style.POINTS: {"linestyle": "", "marker": ".", "markersize": 1.6, "rasterized": True},
    Style.MARKERS: {"linestyle": "", "marker": "o", "markersize": 5.5, "color": "black", "zorder": 5},
    Style.REFERENCE: {"linestyle": (0, (5, 2)), "linewidth": 1.0, "color": "0.4"},
}


def render(plots: Sequence[Plot | Surface], file_format: str, salt: str = "rig") -> bytes:
    """Return plots as "svg", "png" or "pdf", equal for equal plots and salt."""
    style = PlotStyle()
    with plot_settings(style, salt):
        return figure_bytes(draw(plots, style), file_format, style)


def draw(plots: Sequence[Plot | Surface], style: PlotStyle | None = None) -> Figure:
    """Return a figure of the plots, one below the other."""
    figure = new_figure([HEIGHT] * len(plots), style or PlotStyle())
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


def _plot(axes: Axes, plot: Plot) -> None:
    for series in plot.series:
        _series(axes, series)
    _scales(axes, plot)
    axes.grid(visible=True, which="both" if plot.x_log or plot.y_log else "major")
    _plain_numbers(axes, is_log=(plot.x_log, plot.y_log))
    named = len(axes.get_legend_handles_labels()[1])
    if not axes.lines:
        axes.set_xticks([])
        axes.set_yticks([])
        axes.text(0.5, 0.5, plot.empty_text, transform=axes.transAxes, ha="center", color="0.4")
    elif named > 1 or (named == 1 and len(plot.series) > 1):  # right of the axes, so that it hides no line
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)


def _scales(axes: Axes, plot: Plot) -> None:
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


def _series(axes: Axes, series: Series) -> None:
    if not np.any(np.isfinite(series.y)):
        return
    line_style = _LINE_STYLES[series.style]
    if not series.label and "color" not in line_style and axes.lines:
        line_style = {**line_style, "color": axes.lines[-1].get_color()}  # one legend entry for several lines
    if series.style is Style.POINTS and np.count_nonzero(np.isfinite(series.y)) <= FEW_POINTS:
        line_style = {**line_style, "markersize": 4.0}
    axes.plot(series.x, series.y, label=series.label or None, **line_style)


def _plain_numbers(axes: Axes, *, is_log: tuple[bool, bool]) -> None:
    """Format ticks as plain text, linear axes with thousands separators and without an offset."""
    for axis, logarithmic in zip((axes.xaxis, axes.yaxis), is_log, strict=True):
        low, high = sorted(axis.get_view_interval())
        if logarithmic:
            axis.set_major_formatter(FuncFormatter(_decade))
            axis.set_minor_formatter(FuncFormatter(_two_and_five) if high < FEW_DECADES * low else NullFormatter())
        elif 2000 <= max(abs(low), abs(high)) < 1e6:
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
        else:
            axis.set_major_formatter(ScalarFormatter(useOffset=False))


def _decade(value: float, _: object) -> str:
    """Return the label of a power of ten, such as 1,000 or 10⁷."""
    exponent = math.floor(math.log10(value) + 0.5)
    return f"{value:,g}" if -3 <= exponent <= 4 else "10" + str(exponent).translate(_SUPERSCRIPTS)


def _two_and_five(value: float, _: object) -> str:
    """Return the label of a tick between decades: only of 2 and 5."""
    return f"{value:g}" if f"{value:.0e}"[0] in "25" else ""


def _surface(figure: Figure, axes: Axes, plot: Surface) -> None:
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
    figure.colorbar(shown, ax=axes, label=plot.z_label, format=FuncFormatter(_decade))
