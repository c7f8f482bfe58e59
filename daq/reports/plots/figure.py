"""Figures of all plots with matplotlib, without pyplot: settings, size, and reproducible SVG, PNG and PDF."""

import io
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from daq.colours import BACKGROUND, FRAME, GRID, TEXT
from daq.reports.plots.theme import PlotStyle

INCH = 25.4  # mm
FONT_SIZE, TITLE_SIZE, NOTE_SIZE = 9.0, 9.5, 7.5  # pt
_UNDATED = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {}}
_SETTINGS = threading.Lock()  # matplotlib's settings are global


@contextmanager
def plot_settings(style: PlotStyle, salt: str = "rig") -> Iterator[None]:
    """Apply the theme and the settings of reproducible files; ``salt`` makes the ids in an SVG unique on a page.

    Text is drawn as it is, without mathematical markup, and stays text in SVG and PDF.
    """
    colour = style.theme.colour
    settings: dict[Any, Any] = {
        "axes.axisbelow": True,
        "axes.edgecolor": colour(FRAME),
        "axes.facecolor": colour(BACKGROUND),
        "axes.grid": True,
        "axes.labelcolor": colour(TEXT),
        "axes.linewidth": 0.8,
        "axes.titlecolor": colour(TEXT),
        "axes.titlelocation": "left",
        "axes.titlesize": TITLE_SIZE,
        "figure.constrained_layout.h_pad": 0.06,
        "figure.facecolor": colour(BACKGROUND),
        "font.size": FONT_SIZE,
        "grid.color": colour(GRID),
        "grid.linewidth": 0.6,
        "legend.edgecolor": colour(FRAME),
        "legend.fontsize": FONT_SIZE - 1.0,
        "legend.frameon": False,
        "legend.labelcolor": colour(TEXT),
        "lines.linewidth": 1.3,
        "pdf.fonttype": 42,  # TrueType: searchable and editable
        "svg.fonttype": "none",
        "svg.hashsalt": salt,
        "text.color": colour(TEXT),
        "text.parse_math": False,
        "xtick.color": colour(FRAME),
        "xtick.labelcolor": colour(TEXT),
        "ytick.color": colour(FRAME),
        "ytick.labelcolor": colour(TEXT),
    }
    with _SETTINGS, mpl.rc_context(settings):
        yield


def new_figure(heights: list[float], style: PlotStyle) -> Figure:
    """Return a figure for panels of these heights, mm, one below the other; to be called within `plot_settings`."""
    return Figure(figsize=(style.width / INCH, sum(heights) / INCH), layout="constrained")


def figure_bytes(figure: Figure, file_format: str, style: PlotStyle) -> bytes:
    """Return a figure as "svg", "png" or "pdf", without a date; to be called within `plot_settings`."""
    file = io.BytesIO()
    figure.savefig(file, format=file_format, dpi=style.dpi, metadata=_UNDATED[file_format])
    return file.getvalue()
