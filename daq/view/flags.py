"""Marks of a run, drawn at their moment: a line and its word."""

from collections.abc import Sequence

from daq.session.live_update import PlacedMark
from daq.view.axes import Plot
from daq.view.drawing import Anchor, Drawing
from daq.view.lettering import text_width
from daq.view.palette import ALARM, MARK, QUIET, Color
from recordings.mcap.markers import MarkKind

_COLORS = {MarkKind.WORD: MARK, MarkKind.ALARM: ALARM, MarkKind.ACKNOWLEDGED: QUIET}
_LETTERS = 26  # of a word, at most


def draw_upright(drawing: Drawing, plots: Sequence[Plot], at: float, mark: PlacedMark) -> None:
    """Draw a mark across plots that share their x axis, upright at ``at`` of it, its word in the first."""
    color, word = _look(mark)
    for plot in plots:
        drawing.line(plot.place([at, at], [plot.y.low, plot.y.high]), color, 0.12 * plot.letters)
    first = plots[0]
    x, size = float(first.place(at, first.y.high)[0]), 0.85 * first.letters
    if x - size * text_width(word) > first.left:
        drawing.text(word, (x - 0.5 * size, first.top + 1.2 * size), size, color, Anchor.RIGHT)
    else:
        drawing.text(word, (x + 0.5 * size, first.top + 1.2 * size), size, color)


def draw_level(drawing: Drawing, plot: Plot, at: float, mark: PlacedMark) -> None:
    """Draw a mark across a plot, level, at ``at`` of its y axis, its word above the line."""
    color, word = _look(mark)
    line = plot.place([plot.x.low, plot.x.high], [at, at])
    drawing.line(line, color, 0.12 * plot.letters)
    place = (float(line[1, 0]) - plot.letters, float(line[1, 1]) - 0.4 * plot.letters)
    drawing.text(word, place, 0.85 * plot.letters, color, Anchor.RIGHT)


def _look(mark: PlacedMark) -> tuple[Color, str]:
    text = mark.mark.text
    return _COLORS[mark.mark.kind], text if len(text) <= _LETTERS else f"{text[: _LETTERS - 3]}..."
