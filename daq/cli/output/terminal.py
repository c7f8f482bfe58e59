"""Words made to fit the terminal that they are printed on: its width, and the letters that it knows.

Tables for people: numbers with the digits that count, columns that stand below each other.
"""

import codecs
import io
import json
import math
import os
import re
import sys
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any, TextIO

from daq.schemas.units import Schema

Cell = float | str


def align_columns(names: Sequence[str], rows: Sequence[Sequence[Cell]], *, stacked: bool = False) -> list[str]:
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


_USUAL = 80  # columns, of a terminal that does not tell
_PART = re.compile(r"(?<=\S)  ")  # parts of a line stand two spaces apart
_LABEL = re.compile(r" *\S+(?: \S+)* {2,}(?=\S)| +(?=\S)")
_LABEL_WIDTH = 20  # at most: what is longer is no label
_INDENT = 4  # of what follows a line that begins with no label
_LETTERS = {
    "µ": "u",
    "°": "deg",
    "∠": "<",
    "±": "+/-",
    "×": "x",
    "·": "*",
    "²": "2",
    "³": "3",
    "▲": "^",
    "▼": "v",
    "→": "->",
    "≥": ">=",
    "≤": "<=",
    "–": "-",
    "…": "...",
    "“": '"',
    "”": '"',
}


def use_known_letters(stream: TextIO) -> None:
    """Have a stream that cannot write µ, ± or ∠ write u, +/- and < instead, and never fail."""
    codecs.register_error("rig.letters", _replaced)
    if isinstance(stream, io.TextIOWrapper):
        stream.reconfigure(errors="rig.letters")


def _replaced(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(_LETTERS.get(letter, "?") for letter in error.object[error.start : error.end]), error.end


def width_of(stream: TextIO) -> int | None:
    """Return how many columns the terminal has that a stream writes to; None where it is a file or a pipe."""
    if not stream.isatty():
        return None
    try:
        return os.get_terminal_size(stream.fileno()).columns or _USUAL
    except (OSError, ValueError):
        return _USUAL


def fitted(text: str, width: int | None) -> str:
    """Return a line that leaves the last of ``width`` columns free, less those of its parts that have no room."""
    if width is None or len(text) < width:
        return text
    first, *others = _PART.split(text)
    line = first
    for part in others:
        if len(line) + len(part) + 2 < width - 2:
            line = f"{line}  {part}"
    return f"{line[: width - 3]} …"


def wrapped(text: str, width: int | None) -> str:
    """Return a line parted between words where it is longer than ``width``, what follows set in to below its text."""
    if width is None or len(text) < width:
        return text
    label = _LABEL.match(text)
    indent = label.end() if label is not None and label.end() <= _LABEL_WIDTH else _INDENT
    lines = textwrap.wrap(
        text, max(width - 1, 2 * indent), subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
    )
    return "\n".join(lines)


def show(lines: Iterable[str]) -> None:
    """Print lines on standard output, each within the terminal's width where it is one."""
    width = width_of(sys.stdout)
    for line in lines:
        print(wrapped(line, width))


def print_json(content: Schema | list[Schema] | dict[str, Any]) -> None:
    """Print a document, a list of them or what a service answered as JSON; where UTF-8 is not read, in ASCII."""
    plain: object = content
    if isinstance(content, list):
        plain = [each.model_dump(mode="json") for each in content]
    elif isinstance(content, Schema):
        plain = json.loads(content.model_dump_json())
    is_utf8 = codecs.lookup(sys.stdout.encoding or "ascii").name == "utf-8"
    print(json.dumps(plain, ensure_ascii=not is_utf8, indent=2))
