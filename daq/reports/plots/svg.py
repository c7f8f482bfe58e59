"""SVG renderer of panels, without dependencies."""

import html
import math
from collections.abc import Iterator, Sequence

from daq.reports.plots.panel import POLAR_MARGIN, Curve, Panel, Style, label, ticks

WIDTH = 640  # px of one panel
HEIGHT, SQUARE_HEIGHT = 400, 640  # px; the latter for square panels
LEFT, RIGHT, TOP, BOTTOM, LINE = 68, 20, 30, 48, 17  # px of the margins, and of a line of text
LINE_WIDTH = 1.4  # px
EXTRA_WIDTH_BEHIND = 0.9  # px, of a line behind another
CHARACTER_WIDTH = 6.6  # px, approximate
COLOURS = ("#4fc3f7", "#7ce38b", "#2f87ad", "#4e9a5a", "#ff8fb1", "#c9b37a", "#ecf0f5")
"""Probes x and y as on the page, both darker for a run-down, two others, the speed; never the colour of the model."""
GUIDE, KEYPHASOR, GROUND, INK, GRID, FRAME, NOTE = (
    "#7d8899", "#be96ff", "#12161c", "#d8dee9", "#2c333d", "#6b7687", "#9aa5b5",
)  # fmt: skip
SPOKE_SPACING = 30  # degrees, of a polar plot
RIM = 1.0 / POLAR_MARGIN  # of a polar plot's axes, radius of the largest value
MAX_LARGE_DOTS = 500  # more dots are drawn smaller
STYLE = (
    f"text{{font:12px sans-serif;fill:{INK}}}.grid{{stroke:{GRID};stroke-width:1;fill:none}}"
    f".frame{{fill:none;stroke:{FRAME}}}polyline{{fill:none}}"
    f".guide{{stroke:{GUIDE};stroke-width:1;stroke-dasharray:5 4}}.note{{fill:{NOTE};font-size:10px}}"
)


def render_svg(panels: Sequence[Panel]) -> str:
    """Return panels, one below the other, as an SVG document."""
    bodies, height = [], 0
    for panel in panels:
        bodies.append(f'<g transform="translate(0,{height})">{"".join(_PanelSvg(panel).elements())}</g>')
        height += height_of(panel)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{height}" viewBox="0 0 {WIDTH} {height}">'
        f'<style>{STYLE}</style><rect width="100%" height="100%" fill="{GROUND}"/>{"".join(bodies)}</svg>'
    )


def height_of(panel: Panel) -> int:
    """Return the height of a panel, px."""
    return SQUARE_HEIGHT if panel.is_square else HEIGHT


def colour_of(panel: Panel, place: int) -> str:
    """Return the colour of a panel's curve."""
    curve = panel.curves[place]
    if curve.style in {Style.GUIDE, Style.KEYPHASOR}:
        return GUIDE if curve.style is Style.GUIDE else KEYPHASOR
    number = (0 if panel.is_stacked else place) if curve.colour is None else curve.colour
    return COLOURS[number % len(COLOURS)]


def width_of(panel: Panel, curve: Curve) -> float:
    """Return the width of a line, px; a line behind another is wider, to stay visible where both coincide."""
    behind = 0 if panel.is_stacked or curve.style is not Style.LINE else panel.curves.index(curve) % 2
    return LINE_WIDTH + EXTRA_WIDTH_BEHIND * behind


def dot_of(curve: Curve) -> float:
    """Return the radius of a dot, px."""
    return 1.9 if len(curve.x) <= MAX_LARGE_DOTS else 1.0


def spokes(zero: float, reach: float) -> Iterator[tuple[str, float, float]]:
    """Yield the spokes of a polar plot: text of the lag, which grows against the rotation, and the end point."""
    for lag in range(0, 360, SPOKE_SPACING):
        angle = zero - math.radians(lag)
        yield f"{lag}°", reach * math.cos(angle), reach * math.sin(angle)


class _PanelSvg:
    """Writes one panel as SVG elements."""

    def __init__(self, panel: Panel) -> None:
        self._panel = panel
        (self._x_low, self._x_high), (self._y_low, self._y_high) = panel.ranges()
        named = any(curve.name for curve in panel.curves if curve.style is not Style.GUIDE)
        self._top = TOP + LINE * (bool(panel.caption) + named)
        self._width, self._height = WIDTH - LEFT - RIGHT, height_of(panel) - self._top - BOTTOM
        if panel.is_square:
            self._width = self._height = min(self._width, self._height)
        self._right, self._bottom = LEFT + self._width, self._top + self._height

    def elements(self) -> Iterator[str]:
        """Yield all elements of the panel."""
        panel = self._panel
        yield _text(LEFT, 20, panel.title)
        if panel.caption:
            yield _text(LEFT, 20 + LINE, panel.caption, kind="note")
        yield from self._legend(self._top - 9)
        yield from self._axes() if panel.polar_zero is None else self._circles(panel.polar_zero)
        middle = (LEFT + self._right) / 2
        yield _text(middle, self._bottom + 36, panel.x_label, "middle")
        if panel.polar_zero is None:
            centre = (self._top + self._bottom) / 2
            yield (
                f'<text transform="translate(16,{centre:.0f}) rotate(-90)" text-anchor="middle">'
                f"{html.escape(panel.y_label)}</text>"
            )
        order = reversed(range(len(panel.curves)))
        for place in sorted(order, key=lambda k: panel.curves[k].style is not Style.LINE):  # guides and dots on top
            yield from self._curve(panel.curves[place], colour_of(panel, place))
        for words, x, y in panel.notes:
            yield f'<circle cx="{self._across(x):.1f}" cy="{self._up(y):.1f}" r="2" class="note"/>'
            is_far = self._across(x) + CHARACTER_WIDTH * len(words) > self._right  # the label would leave the panel
            yield _text(
                self._across(x) + (-5 if is_far else 5), self._up(y) - 4, words, "end" if is_far else "", "note"
            )

    def _across(self, x: float) -> float:
        return LEFT + self._width * (x - self._x_low) / (self._x_high - self._x_low)

    def _up(self, y: float) -> float:
        part = (y - self._y_low) / (self._y_high - self._y_low)
        return self._top + self._height * (part if self._panel.y_is_lag else 1.0 - part)

    def _axes(self) -> Iterator[str]:
        top, bottom, right = self._top, self._bottom, self._right
        xs, ys = self._panel.tick_labels()
        for x, words in xs:
            at = self._across(x)
            yield f'<line class="grid" x1="{at:.1f}" x2="{at:.1f}" y1="{top}" y2="{bottom}"/>'
            yield _text(at, bottom + 16, words, "middle")
        for y, words in ys:
            at = self._up(y)
            yield f'<line class="grid" x1="{LEFT}" x2="{right}" y1="{at:.1f}" y2="{at:.1f}"/>'
            yield _text(LEFT - 6, at + 4, words, "end")
        yield f'<rect class="frame" x="{LEFT}" y="{top}" width="{self._width}" height="{self._height}"/>'

    def _circles(self, zero: float) -> Iterator[str]:
        reach = self._x_high
        across, up = self._across(0.0), self._up(0.0)
        for lag, x, y in spokes(zero, 0.92 * reach):
            end = f'x2="{self._across(x):.1f}" y2="{self._up(y):.1f}"'
            yield f'<line class="grid" x1="{across:.1f}" y1="{up:.1f}" {end}/>'
            yield _text(self._across(1.05 * x), self._up(1.05 * y) + 4, lag, "middle")
        for radius in ticks(0.0, RIM * reach, 4)[1:]:
            size = self._across(radius) - across
            yield f'<circle class="grid" cx="{across:.1f}" cy="{up:.1f}" r="{size:.1f}"/>'
            yield _text(across + 3, up - size - 3, label(radius), kind="note")

    def _legend(self, line: float) -> Iterator[str]:
        at = float(LEFT)
        for place, curve in enumerate(self._panel.curves):
            if curve.name and curve.style is not Style.GUIDE:
                colour = colour_of(self._panel, place)
                yield f'<text x="{at:.0f}" y="{line}" style="fill:{colour}">{html.escape(curve.name)}</text>'
                at += CHARACTER_WIDTH * len(curve.name) + 18

    def _curve(self, curve: Curve, colour: str) -> Iterator[str]:
        for segment in curve.segments():
            points = [(self._across(x), self._up(y)) for x, y in segment]
            if curve.style in {Style.DOTS, Style.KEYPHASOR}:
                radius = 3.5 if curve.style is Style.KEYPHASOR else dot_of(curve)
                yield (
                    f'<g fill="{colour}">'
                    + "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}"/>' for x, y in points)
                    + "</g>"
                )
                continue
            line = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
            if curve.style is Style.GUIDE:
                yield f'<polyline class="guide" points="{line}"/>'
                yield _text(points[-1][0] - 3, points[-1][1] - 4, curve.name, "end", "note")
                continue
            look = f' stroke="{colour}" stroke-width="{width_of(self._panel, curve)}"'
            hiding = f' style="fill:{GROUND}"' if self._panel.is_stacked else ""
            yield f'<polyline{hiding}{look} points="{line}"/>'


def _text(x: float, y: float, words: str, anchor: str = "", kind: str = "") -> str:
    looks = (f' text-anchor="{anchor}"' if anchor else "") + (f' class="{kind}"' if kind else "")
    return f'<text x="{x:.1f}" y="{y:.1f}"{looks}>{html.escape(words)}</text>'
