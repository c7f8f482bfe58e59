"""A small drawing of curves over two axes, SVG: enough for a spectrum, an orbit, a Bode plot and a cascade."""

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass

WIDTH, HEIGHT = 640, 400  # px of one panel
LEFT, RIGHT, TOP, BOTTOM = 64, 16, 32, 48  # px round it
COLOURS = ("#4cc2ff", "#ffb454", "#2a7fad", "#a8732e")  # probes x and y, and both again, darker, for a run-down
STYLE = (
    "text{font:12px sans-serif;fill:#d8dee9}.grid{stroke:#39414d;stroke-width:1}.frame{fill:none;stroke:#6b7687}"
    "polyline{fill:none;stroke-width:1.4}.note{fill:#9aa5b5;font-size:10px}"
)

Values = Sequence[float | None]


@dataclass(frozen=True, slots=True)
class Panel:
    """Curves over two axes.

    Parameters
    ----------
    title, x_label, y_label : str
        What is written at it; labels carry the unit.
    curves : tuple
        Name, abscissas and ordinates of each; a None breaks the curve.
    is_square : bool
        Whether both axes have one scale and their zero in the middle.
    y_from_zero : bool
        Whether the ordinates begin at 0.
    is_stacked : bool
        Whether the curves stand one behind the other, the first in front.
    notes : tuple
        Words, and abscissa and ordinate where they stand.
    """

    title: str
    x_label: str
    y_label: str
    curves: tuple[tuple[str, Values, Values], ...]
    is_square: bool = False
    y_from_zero: bool = True
    is_stacked: bool = False
    notes: tuple[tuple[str, float, float], ...] = ()


def drawing(panels: Sequence[Panel]) -> str:
    """Return panels one below the other as an SVG document."""
    bodies = [f'<g transform="translate(0,{k * HEIGHT})">{_panel(panel)}</g>' for k, panel in enumerate(panels)]
    height = HEIGHT * len(panels)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{height}" viewBox="0 0 {WIDTH} {height}">'
        f'<style>{STYLE}</style><rect width="100%" height="100%" fill="#12161c"/>{"".join(bodies)}</svg>'
    )


def ticks(low: float, high: float, wanted: int = 6) -> list[float]:
    """Return round numbers from ``low`` to ``high``, about so many."""
    step = (high - low) / wanted
    power = 10.0 ** math.floor(math.log10(step))
    step = next((factor * power for factor in (1, 2, 5) if factor * power >= step), 10 * power)
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


def _panel(panel: Panel) -> str:
    (x_low, x_high), (y_low, y_high) = _ranges(panel)
    inner_width, inner_height = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM
    if panel.is_square:
        inner_width = inner_height

    def across(x: float) -> float:
        return LEFT + inner_width * (x - x_low) / (x_high - x_low)

    def up(y: float) -> float:
        return TOP + inner_height * (y_high - y) / (y_high - y_low)

    right, bottom = LEFT + inner_width, TOP + inner_height
    parts = [f'<text x="{LEFT}" y="20">{html.escape(panel.title)}</text>']
    for x in ticks(x_low, x_high):
        parts.append(f'<line class="grid" x1="{across(x):.1f}" x2="{across(x):.1f}" y1="{TOP}" y2="{bottom}"/>')
        parts.append(f'<text x="{across(x):.1f}" y="{bottom + 16}" text-anchor="middle">{x:g}</text>')
    for y in ticks(y_low, y_high, 5):
        parts.append(f'<line class="grid" x1="{LEFT}" x2="{right}" y1="{up(y):.1f}" y2="{up(y):.1f}"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{up(y) + 4:.1f}" text-anchor="end">{y:g}</text>')
    parts.append(f'<rect class="frame" x="{LEFT}" y="{TOP}" width="{inner_width}" height="{inner_height}"/>')
    hiding = ' style="fill:#12161c"' if panel.is_stacked else ""  # what stands behind
    middle = (LEFT + right) / 2
    parts.append(f'<text x="{middle:.0f}" y="{bottom + 36}" text-anchor="middle">{html.escape(panel.x_label)}</text>')
    parts.append(
        f'<text transform="translate(16,{(TOP + bottom) / 2:.0f}) rotate(-90)" text-anchor="middle">'
        f"{html.escape(panel.y_label)}</text>"
    )
    for k, (name, xs, ys) in reversed(list(enumerate(panel.curves))):
        colour = COLOURS[0 if panel.is_stacked else k % len(COLOURS)]
        for points in _runs(xs, ys):
            line = " ".join(f"{across(x):.1f},{up(y):.1f}" for x, y in points)
            parts.append(f'<polyline{hiding} stroke="{colour}" points="{line}"/>')
        if name:
            place = f'x="{right - 8 - 40 * k}" y="20" text-anchor="end" style="fill:{colour}"'
            parts.append(f"<text {place}>{html.escape(name)}</text>")
    for words, x, y in panel.notes:
        parts.append(f'<circle cx="{across(x):.1f}" cy="{up(y):.1f}" r="2" class="note"/>')
        parts.append(f'<text class="note" x="{across(x) + 5:.1f}" y="{up(y) - 4:.1f}">{html.escape(words)}</text>')
    return "".join(parts)


def _runs(xs: Values, ys: Values) -> list[list[tuple[float, float]]]:
    """Return the unbroken stretches of a curve."""
    runs: list[list[tuple[float, float]]] = [[]]
    for x, y in zip(xs, ys, strict=True):
        if x is None or y is None:
            runs.append([])
        else:
            runs[-1].append((x, y))
    return [run for run in runs if run]


def _ranges(panel: Panel) -> tuple[tuple[float, float], tuple[float, float]]:
    xs = [x for _, values, _ in panel.curves for x in values if x is not None] or [0.0]
    ys = [y for _, _, values in panel.curves for y in values if y is not None] or [0.0]
    if panel.is_square:
        most = 1.1 * max(*map(abs, xs), *map(abs, ys)) or 1.0
        return (-most, most), (-most, most)
    y_low, y_high = (0.0 if panel.y_from_zero else min(ys)), max(ys)
    room = 0.05 * (y_high - y_low) or 1.0
    x_low, x_high = min(xs), max(xs)
    return (x_low, x_high if x_high > x_low else x_low + 1.0), (y_low, y_high + room)
