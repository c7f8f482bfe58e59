"""Renderer of plots as reproducible SVG, PNG and PDF, with matplotlib but without pyplot."""

import io
import math
import textwrap
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, MultipleLocator, NullFormatter

from daq.colours import BACKGROUND, FRAME, GRID, LABEL, MEASURED_X, MEASURED_Y, TACHO, TEXT, mixed
from daq.reports.plots.panel import FULL_TURN, POLAR_MARGIN, Curve, Panel, PlotStyle, Style, Theme
from model.studies.study import Surface

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


HEIGHT, STACKED_HEIGHT, SQUARE_HEIGHT = 0.5, 0.75, 0.75  # of a panel, over the width of the figure
MIN_HEIGHT = 55.0  # mm, of a panel in a narrow figure
TITLE_LINE = 11.0  # mm, extra height of a figure for title and caption
LINE_WIDTH = 1.0  # pt
FEW_CURVES = 6
EXTRA_WIDTH_BEHIND = 1.2  # pt, of a line behind another, to stay visible where both coincide
STACKED_LINE_WIDTH = 0.7  # pt
LARGE_DOT, SMALL_DOT, KEYPHASOR_DOT, NOTE_DOT = 3.0, 1.4, 4.5, 3.0  # pt, diameters
MAX_LARGE_DOTS = 500  # more dots are drawn smaller
CHARACTER_WIDTH = 0.5  # of the font size, mean
MARGINS = 20.0  # mm, of the figure's width left and right of title and caption
FAR = 0.88  # of an axis: labels of points beyond it are placed before the point
NOTE_OFFSET = 5.0  # pt, of a label from its point in a polar plot
SPOKE_SPACING = 30  # degrees, of a polar plot
RIM = 1.0 / POLAR_MARGIN  # of a polar plot's axes, radius of the largest value
POINT = INCH / 72.0  # mm
TICK_SPACING = 28.0  # mm of the figure's width
FEW_DECADES = 100.0  # ratio of the ends of a logarithmic axis, below which ticks between decades have labels
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def render(panels: Sequence[Panel], file_format: str, style: PlotStyle | None = None, salt: str = "rig") -> bytes:
    """Return panels, one below the other, as "svg", "png" or "pdf"; equal for equal panels, style and salt.

    In an SVG, curve k of panel j is the group with the id ``panel-j-curve-k``; the salt makes the other ids unique on
    a page.
    """
    style = style or PlotStyle()
    with plot_settings(style, salt):
        return figure_bytes(draw(panels, style), file_format, style)


def draw(panels: Sequence[Panel], style: PlotStyle) -> Figure:
    """Return a figure of the panels, one below the other."""
    heights = [_height(panel, style) for panel in panels]
    figure = new_figure(heights, style)
    grid = figure.add_gridspec(len(panels), 1, height_ratios=heights)
    for place, panel in enumerate(panels):
        _Drawing(figure.add_subplot(grid[place]), panel, place, style).draw()
    return figure


def _height(panel: Panel, style: PlotStyle) -> float:
    """Return the height of a panel, mm."""
    share = SQUARE_HEIGHT if panel.is_square else STACKED_HEIGHT if panel.is_stacked else HEIGHT
    return max(share * style.width, MIN_HEIGHT) + TITLE_LINE * bool(panel.title)


def curve_colours(theme: Theme) -> list[str]:
    """Return the colours of curves: probes x and y, both paler for a run-down, two others, the speed.

    None is the colour of the model.
    """
    x, y, background = (MEASURED_X, MEASURED_Y, BACKGROUND)
    if theme is Theme.LIGHT:
        others = ["#c2185b", "#8d6e00"]
        pale = ["#74aee8", "#86c489"]
    else:
        others = ["#ff8fb1", "#c9b37a"]
        pale = [theme.colour(mixed(x, 0.6, background)), theme.colour(mixed(y, 0.6, background))]
    return [theme.colour(x), theme.colour(y), *pale, *others, theme.colour(TEXT)]


class _Drawing:
    """Draws one panel into its axes."""

    def __init__(self, axes: Axes, panel: Panel, place: int, style: PlotStyle) -> None:
        self._axes, self._panel, self._place, self._style = axes, panel, place, style
        self._colour = style.theme.colour

    def draw(self) -> None:
        """Draw all elements of the panel."""
        axes, panel = self._axes, self._panel
        self._scale_axes()
        self._write_texts()
        if panel.is_empty:
            axes.text(0.5, 0.5, panel.empty_text, transform=axes.transAxes, ha="center", color=self._colour(LABEL))
        if panel.polar_zero is not None:
            self._draw_circles(panel.polar_zero, axes.get_xlim()[1])
        if panel.surface is not None:
            self._draw_surface(panel.surface)
        for number, curve in enumerate(panel.curves):
            self._draw_curve(number, curve)
        self._place_ticks()
        self._draw_notes()
        if any(curve.name for curve in panel.curves if curve.style is not Style.GUIDE) and not panel.is_empty:
            axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0, handlelength=1.6)

    def _scale_axes(self) -> None:
        """Set scale and range of both axes."""
        axes, panel = self._axes, self._panel
        x_range, y_range = panel.ranges()
        axes.set(xscale="log" if panel.x_is_log else "linear", yscale="log" if panel.y_is_log else "linear")
        if not panel.x_is_log or panel.x_range is not None:
            axes.set_xlim(*x_range)
        if not panel.y_is_log or panel.y_range is not None:
            axes.set_ylim(*(y_range[::-1] if panel.y_is_lag else y_range))
        if panel.is_square:
            axes.set_aspect("equal", adjustable="box", anchor="W")  # to the left: the legend is on the right

    def _place_ticks(self) -> None:
        """Place the ticks of both axes, when their ranges are known."""
        axes, panel = self._axes, self._panel
        if panel.polar_zero is not None or panel.is_empty:
            axes.set(xticks=[], yticks=[])
            return
        across = min(6, int(self._style.width / TICK_SPACING))
        _place_ticks(axes.xaxis, across, is_angle=panel.x_is_angle, is_log=panel.x_is_log)
        is_angle = panel.y_is_angle or panel.y_is_lag
        _place_ticks(axes.yaxis, across if panel.is_square else 5, is_angle=is_angle, is_log=panel.y_is_log)
        if panel.y_is_lag:
            axes.yaxis.set_major_formatter(FuncFormatter(lambda lag, _: _number(lag % FULL_TURN)))

    def _write_texts(self) -> None:
        """Write title, caption and axis labels, wrapped to the size of the panel."""
        axes, panel = self._axes, self._panel
        width = self._style.width - MARGINS
        caption = _wrapped(panel.caption, width, FONT_SIZE - 1.0)
        lines = caption.count("\n") + 1 if caption else 0
        axes.set_title(_wrapped(panel.title, width, TITLE_SIZE) or " ", pad=6.0 + 1.5 * (FONT_SIZE - 1.0) * lines)
        if caption:
            note = axes.annotate(
                caption, (0.0, 1.0), (0.0, 5.0), "axes fraction", "offset points",
                color=self._colour(LABEL), fontsize=FONT_SIZE - 1.0, va="bottom",
            )  # fmt: skip
            note.set_in_layout(False)  # its height is in the pad of the title
        axes.set_xlabel(_wrapped(panel.x_label, width, FONT_SIZE), loc="left" if panel.is_square else "center")
        if panel.polar_zero is None:
            axes.set_ylabel(_wrapped(panel.y_label, _height(panel, self._style) - 20.0, FONT_SIZE))

    def _draw_curve(self, number: int, curve: Curve) -> None:
        axes, panel = self._axes, self._panel
        x, y = np.array(curve.x, dtype=np.float64), np.array(curve.y, dtype=np.float64)
        is_line = curve.style in {Style.LINE, Style.DASHED, Style.DOTTED}
        depth = 2.0 + (1.0 - number / len(panel.curves) if is_line else 2.0)  # the first line is on top of the others
        if panel.is_stacked and is_line:
            axes.fill_between(x, np.nanmin(y), y, color=self._colour(BACKGROUND), zorder=depth, linewidth=0.0)
        (line,) = axes.plot(
            x, y, color=self._curve_colour(number, curve), zorder=depth, **self._line_style(number, curve)
        )
        line.set_gid(f"panel-{self._place}-curve-{number}")
        if curve.style is not Style.GUIDE:
            line.set_label(curve.name or "_unnamed")
        elif segments := curve.segments():
            axes.annotate(
                curve.name, segments[-1][-1], (-3.0, 3.0), textcoords="offset points",
                color=self._colour(LABEL), fontsize=NOTE_SIZE, ha="right", zorder=depth,
            )  # fmt: skip

    def _curve_colour(self, number: int, curve: Curve) -> str:
        if curve.style is Style.GUIDE:
            return self._colour(FRAME) if self._panel.surface is None else "white"
        if curve.style is Style.KEYPHASOR:
            return self._colour(TACHO)
        if curve.style is Style.MARKERS:
            return self._colour(TEXT)
        colours = curve_colours(self._style.theme)
        index = (0 if self._panel.is_stacked else number) if curve.colour is None else curve.colour
        return colours[index % len(colours)]

    def _line_style(self, number: int, curve: Curve) -> dict[str, Any]:
        dots: dict[str, Any] = {"linestyle": "", "marker": "o", "markeredgewidth": 0.0}
        match curve.style:
            case Style.GUIDE:
                return {"linewidth": 0.8, "linestyle": (0, (5, 3))}
            case Style.DOTS:
                is_many = len(curve.x) > MAX_LARGE_DOTS
                return {**dots, "markersize": SMALL_DOT if is_many else LARGE_DOT, "rasterized": is_many}
            case Style.KEYPHASOR | Style.MARKERS:
                return {**dots, "markersize": KEYPHASOR_DOT}
            case Style.DASHED:
                return {"linewidth": 1.2, "linestyle": "--"}
            case Style.DOTTED:
                return {"linewidth": 2.0, "linestyle": (0, (1, 1.3))}
            case Style.LINE:
                is_behind = number % 2 == 1 and len(self._panel.curves) <= FEW_CURVES
                width = LINE_WIDTH + EXTRA_WIDTH_BEHIND * is_behind
                return {"linewidth": STACKED_LINE_WIDTH if self._panel.is_stacked else width}

    def _draw_notes(self) -> None:
        colour = self._colour(LABEL)
        for text, x, y in self._panel.notes:
            self._axes.plot([x], [y], "o", color=colour, markersize=NOTE_DOT, markeredgewidth=0.0, zorder=4.5)
            across, up = self._note_offset(x, y)
            self._axes.annotate(
                text, (x, y), (across, up), textcoords="offset points", color=colour, fontsize=NOTE_SIZE, zorder=4.5,
                ha="left" if across > 0.0 else "right", va="bottom" if up > 0.0 else "top",
            )  # fmt: skip

    def _note_offset(self, x: float, y: float) -> tuple[float, float]:
        """Return where a label lies beside its point, pt: in a polar plot outwards, else inside the axes."""
        if self._panel.polar_zero is not None:
            angle = math.atan2(y, x)
            return NOTE_OFFSET * math.cos(angle), NOTE_OFFSET * math.sin(angle)
        (x_low, x_high), (y_low, y_high) = self._panel.ranges()
        is_far, is_high = (x - x_low) / (x_high - x_low) > FAR, (y - y_low) / (y_high - y_low) > FAR
        return -4.0 if is_far else 4.0, -2.0 if is_high and self._panel.is_square else 2.0

    def _draw_surface(self, surface: Surface) -> None:
        low, high = surface.z_limits
        shown = self._axes.pcolormesh(
            surface.x, surface.y, np.ma.masked_invalid(surface.z),
            norm=LogNorm(low, high), cmap="viridis", shading="nearest", rasterized=True,
        )  # fmt: skip
        self._axes.set_facecolor(self._colour(GRID))
        figure = self._axes.get_figure()
        if figure is not None:
            figure.colorbar(shown, ax=self._axes, label=surface.z_label, pad=0.02, format=FuncFormatter(_decade))

    def _draw_circles(self, zero: float, reach: float) -> None:
        """Draw the grid of a polar plot: spokes of lag and circles of amplitude."""
        axes = self._axes
        for spine in axes.spines.values():
            spine.set_visible(False)
        grid: dict[str, Any] = {"color": self._colour(GRID), "linewidth": 0.6, "zorder": 0.5}
        for text, x, y in _spokes(zero, 0.9 * reach):
            axes.plot([0.0, x], [0.0, y], **grid)
            axes.text(1.07 * x, 1.07 * y, text, fontsize=FONT_SIZE - 1.0, ha="center", va="center")
        turn = np.radians(np.arange(0.0, 361.0, 2.0))
        free = _free_direction(self._panel, zero)
        for radius in _locator(4).tick_values(0.0, RIM * reach)[1:]:
            axes.plot(radius * np.cos(turn), radius * np.sin(turn), **grid)
            axes.text(
                radius * math.cos(free), radius * math.sin(free), _number(radius), ha="center", va="center",
                color=self._colour(LABEL), fontsize=NOTE_SIZE, zorder=0.6,
                bbox={"facecolor": self._colour(BACKGROUND), "linewidth": 0.0, "pad": 1.0},
            )  # fmt: skip


def _locator(count: int) -> MaxNLocator:
    return MaxNLocator(count, steps=[1, 2, 5, 10])


def _place_ticks(axis: Axis, count: int, *, is_angle: bool, is_log: bool) -> None:
    """Place about ``count`` ticks at round numbers, every 90 degrees, or at decades, with plain text."""
    if is_log:
        low, high = sorted(axis.get_view_interval())
        axis.set_major_formatter(FuncFormatter(_decade))
        axis.set_minor_formatter(FuncFormatter(_two_and_five) if high < FEW_DECADES * low else NullFormatter())
        return
    axis.set_major_locator(MultipleLocator(90.0) if is_angle else _locator(count))
    axis.set_major_formatter(FuncFormatter(lambda value, _: _number(value)))


def _number(value: float) -> str:
    """Return the text of a tick, thousands separated by commas, with a true minus sign."""
    return (f"{value:,.6g}" if abs(value) < 1e6 else f"{value:g}").replace("-", "−")


def _decade(value: float, _: object) -> str:
    """Return the text of a power of ten, such as 1,000 or 10⁷."""
    exponent = math.floor(math.log10(value) + 0.5)
    return f"{value:,g}" if -3 <= exponent <= 4 else "10" + str(exponent).translate(_SUPERSCRIPTS)


def _two_and_five(value: float, _: object) -> str:
    """Return the text of a tick between decades: only of 2 and 5."""
    return f"{value:g}" if f"{value:.0e}"[0] in "25" else ""


def _spokes(zero: float, reach: float) -> Iterator[tuple[str, float, float]]:
    """Yield the spokes of a polar plot: text of the lag, which grows against the rotation, and the end point."""
    for lag in range(0, 360, SPOKE_SPACING):
        angle = zero - math.radians(lag)
        yield f"{lag}°", reach * math.cos(angle), reach * math.sin(angle)


def _free_direction(panel: Panel, zero: float) -> float:
    """Return a direction, rad, between two spokes and away from the curves, for the labels of the circles."""
    points = [point for curve in panel.curves for segment in curve.segments() for point in segment]
    across, up = (math.fsum(parts) for parts in zip(*points, strict=True)) if points else (0.0, 1.0)
    step = math.radians(SPOKE_SPACING)
    return zero + (math.floor((math.atan2(-up, -across) - zero) / step) + 0.5) * step


def _wrapped(text: str, width: float, size: float) -> str:
    """Return text of a font size, pt, on lines of about this width, mm."""
    return "\n".join(textwrap.wrap(text, max(int(width / (CHARACTER_WIDTH * size * POINT)), 12)))
