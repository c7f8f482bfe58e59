"""Terminal output: wrapping to the width, ASCII fallback, aligned tables and JSON."""

import codecs
import io
import json
import math
import os
import re
import sys
import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from daq.schemas.units import Schema  # pydantic takes a tenth of a second, which `rig mark` does not need

Cell = float | str


def align_columns(names: Sequence[str], rows: Sequence[Sequence[Cell]], *, stacked: bool = False) -> list[str]:
    """Return a table as lines with right-aligned columns.

    Parameters
    ----------
    names : sequence of str
        Column headings.
    rows : sequence of sequences of float or str
        Cells; numbers are formatted with the digits that count.
    stacked : bool
        Whether the parts of a heading between underscores go on lines of their own, which narrows the table.
    """
    cells = [[format_number(cell) for cell in row] for row in rows]
    heads = [name.split("_") if stacked else [name] for name in names]
    height = max((len(words) for words in heads), default=0)
    top = [[words[k - height] if k - height >= -len(words) else "" for words in heads] for k in range(height)]
    widths = [max(map(len, column)) for column in zip(*top, *cells, strict=True)]
    return ["  ".join(word.rjust(width) for word, width in zip(row, widths, strict=True)) for row in [*top, *cells]]


def format_number(cell: Cell) -> str:
    """Return a number with four significant digits (thousands with one decimal); text is returned unchanged."""
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


_DEFAULT_WIDTH = 80  # columns, where the terminal does not report its width
_PART_GAP = re.compile(r"(?<=\S)  ")  # the parts of a line are two spaces apart
_LABEL = re.compile(r" *\S+(?: \S+)* {2,}(?=\S)| +(?=\S)")
_MAX_LABEL_WIDTH = 20  # columns; longer text at the start of a line is no label
_INDENT = 4  # columns, of continuation lines where the first has no label
_ASCII = {
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


def use_ascii_fallback(stream: TextIO) -> None:
    """Make a stream write ASCII stand-ins (u for µ, +/- for ±) for characters that its encoding lacks."""
    codecs.register_error("rig.ascii", _ascii_stand_ins)
    if isinstance(stream, io.TextIOWrapper):
        stream.reconfigure(errors="rig.ascii")


def _ascii_stand_ins(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(_ASCII.get(letter, "?") for letter in error.object[error.start : error.end]), error.end


def terminal_width(stream: TextIO) -> int | None:
    """Return the columns of the terminal that a stream writes to; None for a file or a pipe."""
    if not stream.isatty():
        return None
    try:
        return os.get_terminal_size(stream.fileno()).columns or _DEFAULT_WIDTH
    except (OSError, ValueError):
        return _DEFAULT_WIDTH


def fit_to_width(text: str, width: int | None) -> str:
    """Return a line shorter than ``width`` columns; parts that do not fit are left out."""
    if width is None or len(text) < width:
        return text
    first, *others = _PART_GAP.split(text)
    line = first
    for part in others:
        if len(line) + len(part) + 2 < width - 2:
            line = f"{line}  {part}"
    return f"{line[: width - 3]} …"


def wrap_line(text: str, width: int | None) -> str:
    """Return a line wrapped to ``width`` columns, continuation lines indented to the text after its label."""
    if width is None or len(text) < width:
        return text
    label = _LABEL.match(text)
    indent = label.end() if label is not None and label.end() <= _MAX_LABEL_WIDTH else _INDENT
    lines = textwrap.wrap(
        text, max(width - 1, 2 * indent), subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
    )
    return "\n".join(lines)


def print_lines(lines: Iterable[str]) -> None:
    """Print lines on standard output, wrapped where it is a terminal."""
    width = terminal_width(sys.stdout)
    for line in lines:
        print(wrap_line(line, width))


def print_json(content: "Schema | list[Schema] | dict[str, Any]") -> None:
    """Print a schema, a list of schemas or a service's response as JSON; with ASCII escapes unless stdout is UTF-8."""
    plain: object = content
    if isinstance(content, list):
        plain = [each.model_dump(mode="json") for each in content]
    elif not isinstance(content, dict):
        plain = json.loads(content.model_dump_json())
    is_utf8 = codecs.lookup(sys.stdout.encoding or "ascii").name == "utf-8"
    print(json.dumps(plain, ensure_ascii=not is_utf8, indent=2))
