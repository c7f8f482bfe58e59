"""Tables for people: numbers with the digits that count, columns that stand below each other."""

import math
from collections.abc import Sequence

Cell = float | str


def aligned(names: Sequence[str], rows: Sequence[Sequence[Cell]], *, stacked: bool = False) -> list[str]:
    """Return a table as lines; ``stacked`` writes the words of its long names one above the other."""
    cells = [[number(cell) for cell in row] for row in rows]
    heads = [name.split("_") if stacked else [name] for name in names]
    height = max((len(words) for words in heads), default=0)
    top = [[words[k - height] if k - height >= -len(words) else "" for words in heads] for k in range(height)]
    widths = [max(map(len, column)) for column in zip(*top, *cells, strict=True)]
    return ["  ".join(word.rjust(width) for word, width in zip(row, widths, strict=True)) for row in [*top, *cells]]


def number(cell: Cell) -> str:
    """Return a number with the digits that count; words stay as they are."""
    if isinstance(cell, str):
        return cell
    if isinstance(cell, int):
        return f"{cell:,}"
    if not math.isfinite(cell):
        return "–"
    if cell == 0:
        return "0"
    size = abs(cell)
    if size < 1e-3 or size >= 1e7:
        return f"{cell:.4g}"
    return f"{cell:,.1f}" if size >= 1000 else f"{cell:.{max(0, 3 - math.floor(math.log10(size)))}f}"
