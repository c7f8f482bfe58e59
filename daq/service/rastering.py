"""The same drawing as a picture of points, PNG, by matplotlib where it is installed."""

import io
import math
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from daq.service.drawing import COLOURS, HEIGHT, WIDTH, Panel, Values

DOTS = 100  # an inch
GROUND, INK = "#12161c", "#d8dee9"
SCALE = 1.5  # points of the picture to one of the drawing


class NoPngError(ValueError):
    """PNG needs a package that is not installed here."""


def picture(panels: Sequence[Panel]) -> bytes:
    """Return panels one below the other as PNG; NoPngError where matplotlib is missing."""
    try:
        figure_module: Any = import_module("matplotlib.figure")  # optional
    except ImportError as error:
        raise NoPngError("PNG needs matplotlib, which is not installed here; SVG does not") from error
    size = (SCALE * WIDTH / DOTS, SCALE * HEIGHT * len(panels) / DOTS)
    figure = figure_module.Figure(figsize=size, dpi=DOTS, layout="constrained", facecolor=GROUND)
    for place, panel in enumerate(panels, 1):
        _draw(figure.add_subplot(len(panels), 1, place), panel)
    file = io.BytesIO()
    figure.savefig(file, format="png")
    return file.getvalue()


def _draw(axes: Any, panel: Panel) -> None:
    axes.set_facecolor(GROUND)
    axes.tick_params(colors=INK)
    axes.grid(color="#39414d")
    for spine in axes.spines.values():
        spine.set_color("#6b7687")
    for write, words in (
        (axes.set_title, panel.title),
        (axes.set_xlabel, panel.x_label),
        (axes.set_ylabel, panel.y_label),
    ):
        write(words, color=INK)
    for k, (name, xs, ys) in enumerate(panel.curves):
        colour = COLOURS[0 if panel.is_stacked else k % len(COLOURS)]
        across, up, depth = _numbers(xs), _numbers(ys), 2.0 - k / len(panel.curves)
        if panel.is_stacked:
            axes.fill_between(across, min(up), up, color=GROUND, zorder=depth, linewidth=0.0)
        axes.plot(across, up, color=colour, label=name, linewidth=1.2, zorder=depth)
    if any(name for name, _, _ in panel.curves):
        axes.legend(facecolor=GROUND, labelcolor=INK)
    for words, x, y in panel.notes:
        axes.annotate(words, (x, y), color="#9aa5b5", fontsize=8)
    if panel.is_square:
        axes.set_aspect("equal", adjustable="datalim")
    elif panel.y_from_zero:
        axes.set_ylim(bottom=0.0)


def _numbers(values: Values) -> list[float]:
    return [math.nan if value is None else value for value in values]
