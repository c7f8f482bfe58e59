"""PNG renderer of panels with matplotlib; it looks like the SVG."""

import io
import math
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from daq.reports.errors import PngUnavailableError
from daq.reports.plots.panel import Panel, Style, label, ticks
from daq.reports.plots.svg import (
    FRAME,
    GRID,
    GROUND,
    INK,
    NOTE,
    RIM,
    WIDTH,
    colour_of,
    dot_of,
    height_of,
    spokes,
    width_of,
)

DPI = 100
LABEL_LEFT_FROM = 0.88  # of the x axis: labels beyond it are placed to the left
SCALE = 1.5  # pixels per px of the SVG


def render_png(panels: Sequence[Panel]) -> bytes:
    """Return panels, one below the other, as PNG; PngUnavailableError without matplotlib."""
    require_matplotlib()
    figure_module: Any = import_module("matplotlib.figure")  # optional
    heights = [height_of(panel) for panel in panels]
    size = (SCALE * WIDTH / DPI, SCALE * sum(heights) / DPI)
    figure = figure_module.Figure(figsize=size, dpi=DPI, layout="constrained", facecolor=GROUND)
    grid = figure.add_gridspec(len(panels), 1, height_ratios=heights)
    for place, panel in enumerate(panels):
        _draw(figure.add_subplot(grid[place]), panel)
    file = io.BytesIO()
    figure.savefig(file, format="png")
    return file.getvalue()


def require_matplotlib() -> None:
    """Raise PngUnavailableError without matplotlib."""
    try:
        import_module("matplotlib.figure")
    except ImportError as error:
        raise PngUnavailableError("PNG needs matplotlib, which is not installed here; SVG does not") from error


def _draw(axes: Any, panel: Panel) -> None:
    (x_low, x_high), (y_low, y_high) = panel.ranges()
    _write(axes, panel)
    for place, curve in enumerate(panel.curves):
        depth = 2.0 - place / len(panel.curves) if curve.style is Style.LINE else 3.0
        _plot(axes, panel, place, depth)
    for words, x, y in panel.notes:
        axes.plot([x], [y], ".", color=NOTE, markersize=4)
        is_far = (x - x_low) / (x_high - x_low) > LABEL_LEFT_FROM
        placing: dict[str, Any] = {"xytext": (-4 if is_far else 4, 4), "ha": "right" if is_far else "left"}
        axes.annotate(words, (x, y), **placing, textcoords="offset points", color=NOTE, fontsize=8)
    axes.set_xlim(x_low, x_high)
    axes.set_ylim(*((y_high, y_low) if panel.y_is_lag else (y_low, y_high)))
    if panel.is_square:
        axes.set_aspect("equal", adjustable="box")
    if panel.polar_zero is not None:
        _circles(axes, panel.polar_zero, x_high)
        return
    for set_ticks, steps in zip((axes.set_xticks, axes.set_yticks), panel.tick_labels(), strict=True):
        set_ticks([value for value, _ in steps], [words for _, words in steps])


def _write(axes: Any, panel: Panel) -> None:
    """Write title, caption, labels and legend."""
    axes.set_facecolor(GROUND)
    axes.tick_params(colors=INK)
    axes.grid(visible=False) if panel.polar_zero is not None else axes.grid(color=GRID)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_color(FRAME)
    axes.set_xlabel(panel.x_label, color=INK)
    axes.set_ylabel("" if panel.polar_zero is not None else panel.y_label, color=INK)
    named = [(k, each.name) for k, each in enumerate(panel.curves) if each.name and each.style is not Style.GUIDE]
    lines = [(panel.title, INK, 11)] + ([(panel.caption, NOTE, 9)] if panel.caption else [])
    offset = 6.0 + 15.0 * bool(named)
    for words, colour, size in reversed(lines):
        axes.annotate(words, (0, 1), (0, offset), "axes fraction", "offset points", color=colour, fontsize=size)
        offset += 15.0
    at = 0.0
    for place, name in named:
        colour = colour_of(panel, place)
        axes.annotate(name, (0, 1), (at, 6), "axes fraction", "offset points", color=colour, fontsize=9)
        at += 5.4 * len(name) + 14.0


def _plot(axes: Any, panel: Panel, place: int, depth: float) -> None:
    curve, colour = panel.curves[place], colour_of(panel, place)
    looks: dict[Style, dict[str, Any]] = {
        Style.LINE: {"linewidth": width_of(panel, curve)},
        Style.GUIDE: {"linewidth": 0.9, "linestyle": "--"},
        Style.DOTS: {"linestyle": "", "marker": "o", "markersize": 2.4 * dot_of(curve), "markeredgewidth": 0.0},
        Style.KEYPHASOR: {"linestyle": "", "marker": "o", "markersize": 6.0},
    }
    for segment in curve.segments():
        across, up = [x for x, _ in segment], [y for _, y in segment]
        if panel.is_stacked and curve.style is Style.LINE:
            axes.fill_between(across, min(up), up, color=GROUND, zorder=depth, linewidth=0.0)
        axes.plot(across, up, color=colour, zorder=depth, **looks[curve.style])
        if curve.style is Style.GUIDE:
            end = (across[-1], up[-1])
            axes.annotate(curve.name, end, (-3, 3), textcoords="offset points", color=NOTE, fontsize=8, ha="right")


def _circles(axes: Any, zero: float, reach: float) -> None:
    """Draw the grid of a polar plot."""
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(False)
    for lag, x, y in spokes(zero, 0.92 * reach):
        axes.plot([0.0, x], [0.0, y], color=GRID, linewidth=0.8, zorder=0.5)
        axes.text(1.05 * x, 1.05 * y, lag, color=INK, fontsize=9, ha="center", va="center")
    turn = [math.radians(degree) for degree in range(0, 361, 2)]
    for radius in ticks(0.0, RIM * reach, 4)[1:]:
        circle = [radius * math.cos(angle) for angle in turn], [radius * math.sin(angle) for angle in turn]
        axes.plot(*circle, color=GRID, linewidth=0.8, zorder=0.5)
        axes.annotate(label(radius), (0.0, radius), (3, 2), textcoords="offset points", color=NOTE, fontsize=8)
