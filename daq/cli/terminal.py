"""Terminal output by rich: text and tables fitted to the width, progress, ASCII fallback; and JSON."""

import codecs
import io
import json
import math
import re
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:  # rich and pydantic take a tenth of a second each, which `rig mark` does not need
    from rich.console import Console, ConsoleOptions, RenderableType
    from rich.live import Live
    from rich.table import Table


Cell = float | str

_FILE_WIDTH = 10_000  # columns of a file or pipe, in which nothing is wrapped
_LABEL_WIDTH = 15  # columns of a label, two columns left of its text
_TERMINAL_INTERVAL = 0.1  # s between redraws on a terminal
_FILE_INTERVAL = 5.0  # s between progress lines where the output is no terminal
_PART_GAP = re.compile(r"(?<=\S)  ")  # the parts of a status line are two spaces apart
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


def print_output(*parts: "RenderableType") -> None:
    """Print text and tables on standard output, wrapped and coloured on a terminal only."""
    from rich.console import Console, Group

    console = Console(highlight=False, markup=False, emoji=False)
    if not console.is_terminal:
        console.width = _FILE_WIDTH
    with console.capture() as captured:
        console.print(Group(*parts), crop=False)
    for line in captured.get().removesuffix("\n").split("\n"):
        print(line.rstrip())


def grid(*rows: Sequence["RenderableType"], label_width: int | None = None) -> "Table":
    """Return rows of text in columns, of which the last is wrapped.

    Parameters
    ----------
    *rows : sequences of text
        The cells of each row.
    label_width : int, optional
        Minimum width of the first column.
    """
    from rich.table import Table

    table = Table.grid(padding=(0, 2))
    n_columns = len(rows[0]) if rows else 1
    for k in range(n_columns):
        is_last = k == n_columns - 1
        table.add_column(no_wrap=not is_last, overflow="fold", min_width=label_width if k == 0 else None)
    for row in rows:
        table.add_row(*row)
    return table


def labelled(rows: Iterable[tuple[str, str]]) -> "Table":
    """Return texts with their labels to the left."""
    return grid(*rows, label_width=_LABEL_WIDTH)


@dataclass(frozen=True, slots=True)
class NumberTable:
    """A table of right-aligned columns; one too wide for the terminal is printed in parts, each with the first column.

    Parameters
    ----------
    names : sequence of str
        Column headings; their parts between underscores are printed below each other.
    columns : sequence of sequences of float or str
        The columns; numbers are printed with the digits that count.
    """

    names: Sequence[str]
    columns: Sequence[Sequence[Cell]]

    def __rich_console__(self, console: "Console", options: "ConsoleOptions") -> "Iterator[RenderableType]":
        """Yield the table, or its parts."""
        cells = [
            [name.replace("_", "\n"), *map(format_number, column)]
            for name, column in zip(self.names, self.columns, strict=True)
        ]
        widths = [max(len(line) for cell in column for line in cell.split("\n")) + 2 for column in cells]
        first, others = cells[:1], cells[1:]
        while True:
            totals = accumulate(widths[len(cells) - len(others) :], initial=widths[0])
            n_columns = max(1, sum(total <= options.max_width + 2 for total in totals) - 1)
            headings, *rows = zip(*first, *others[:n_columns], strict=True)
            yield text_table(headings, rows)
            others = others[n_columns:]
            if not others:
                return


def text_table(headings: Sequence[str], rows: Iterable[Sequence[str]], *, n_left: int = 0) -> "Table":
    """Return a table of right-aligned columns; the last ``n_left`` are left-aligned."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for k, heading in enumerate(headings):
        is_left = k >= len(headings) - n_left
        table.add_column(heading, justify="left" if is_left else "right", vertical="bottom", no_wrap=not is_left)
    for row in rows:
        table.add_row(*row)
    return table


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


def print_json(content: object) -> None:
    """Print schemas or a service's response as JSON; with ASCII escapes unless stdout is UTF-8."""
    from pydantic_core import to_jsonable_python

    is_utf8 = codecs.lookup(sys.stdout.encoding or "ascii").name == "utf-8"
    print(json.dumps(to_jsonable_python(content), ensure_ascii=not is_utf8, indent=2))


def fit_to_width(text: str, width: int) -> str:
    """Return a status line shorter than ``width`` columns; parts that do not fit are left out."""
    if len(text) < width:
        return text
    line, *others = _PART_GAP.split(text)
    for part in others:
        if len(line) + len(part) + 2 < width - 2:
            line = f"{line}  {part}"
    return f"{line[: width - 3]} …"


class TerminalOutput:
    """Prints lines and progress to a stream: a redrawn line on a terminal, a line every 5 s in a file.

    Parameters
    ----------
    stream : TextIO
        Output; by default standard error, because `--json` prints on standard output.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._live: Live | None = None
        self._last = -math.inf

    @cached_property
    def _terminal(self) -> "Console | None":
        if not self._stream.isatty():
            return None
        from rich.console import Console

        return Console(file=self._stream, force_terminal=True, highlight=False, markup=False, emoji=False)

    def line(self, text: str) -> None:
        """Print lines that progress does not overwrite."""
        with suppress(OSError, ValueError):  # the terminal was closed; the run continues
            if self._terminal is None:
                print(text, file=self._stream, flush=True)
            else:
                self._terminal.print(text, soft_wrap=True)  # wrapped by the terminal, so that addresses can be copied

    def progress(self, text: str, part: float | None = None) -> None:
        """Show progress, with the fraction done, 0 to 1; on a terminal it replaces the last progress line."""
        now = time.monotonic()
        is_due = now - self._last >= (_FILE_INTERVAL if self._terminal is None else _TERMINAL_INTERVAL)
        if self._terminal is not None:
            with suppress(OSError, ValueError):
                self._draw(self._terminal, text, part, refresh=is_due)
        elif is_due and (part is None or part >= 0.01):
            self.line(text if part is None else f"{text}: {100 * part:.0f} %")
        else:
            return
        if is_due:
            self._last = now

    def _draw(self, terminal: "Console", text: str, part: float | None, *, refresh: bool) -> None:
        from rich.live import Live
        from rich.progress_bar import ProgressBar
        from rich.text import Text

        if self._live is None:
            self._live = Live(console=terminal, auto_refresh=False, redirect_stdout=False, redirect_stderr=False)
            self._live.start()
            terminal.show_cursor()
        shown: RenderableType = Text(fit_to_width(text, terminal.width), no_wrap=True)
        if part is not None:
            shown = grid((text, ProgressBar(total=1.0, completed=part, width=30), f"{100 * part:3.0f} %"))
        self._live.update(shown, refresh=refresh)

    def done(self, *, keep: bool = False) -> None:
        """End the progress line; erase it unless it is to stay on the terminal."""
        live, self._live = self._live, None
        if live is not None:
            live.transient = not keep
            with suppress(OSError, ValueError):
                live.stop()
