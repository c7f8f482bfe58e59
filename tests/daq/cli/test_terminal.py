"""Terminal output: width, ASCII fallback, JSON and the help pages."""

import argparse
import contextlib
import io
import json
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest
from rich.console import RenderableType
from rich.text import Text

from daq.cli.commands import rig_parser
from daq.cli.main import main
from daq.cli.run_text import status_line
from daq.cli.terminal import (
    NumberTable,
    TerminalOutput,
    fit_to_width,
    grid,
    labelled,
    print_json,
    print_output,
    use_ascii_fallback,
)
from tests.daq.support.live_updates import make_live_updates

UPDATE = make_live_updates(150)[-1]


class Terminal(io.StringIO):
    """A terminal that does not report its width; 80 columns are assumed."""

    def isatty(self) -> bool:
        return True


def parsers(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """Yield a command's parser and those of its subcommands."""
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                yield from parsers(below)


@pytest.fixture
def environment() -> Iterator[Callable[..., None]]:
    """Return a setter of environment variables; None removes one. They are restored after the test."""
    before = dict(os.environ)

    def set_variables(**variables: str | None) -> None:
        for name, value in variables.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value

    set_variables(COLUMNS=None, NO_COLOR=None, FORCE_COLOR=None, TTY_COMPATIBLE=None, TERM="xterm-256color")
    yield set_variables
    os.environ.clear()
    os.environ.update(before)


def printed(stream: io.StringIO, *parts: RenderableType) -> list[str]:
    """Return the lines printed to a standard output."""
    with contextlib.redirect_stdout(stream):
        print_output(*parts)
    return stream.getvalue().splitlines()


def test_status_line_is_redrawn_within_the_terminal_width_with_the_most_important_parts(
    environment: Callable[..., None],
) -> None:
    environment(COLUMNS="80")
    long = replace(UPDATE, status=replace(UPDATE.status, model="computing 43 %", skipped=12_345))
    terminal = Terminal()
    console = TerminalOutput(terminal)
    for _ in range(3):
        console.progress(status_line(long))
        console.line("a message above the status line")
    console.done()
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "\r", terminal.getvalue())
    lines = [line for line in re.split(r"[\r\n]+", plain) if line]
    assert len(status_line(long)) > 80
    assert max(map(len, lines)) < 80
    assert lines.count("a message above the status line") == 3
    status = [line for line in lines if not line.startswith("a message")]
    assert re.match(r"\d\d:\d\d +[\d,]+ r/min . +x \d+ µm  y \d+ µm pp  .*lost 0", status[0])
    assert all(line.rstrip().endswith("…") for line in status)
    assert terminal.getvalue().endswith("\x1b[2K")  # erased


def test_finished_status_line_stays_where_it_is_to_be_kept() -> None:
    terminal = Terminal()
    console = TerminalOutput(terminal)
    console.progress("00:15  12,015 r/min")
    console.done(keep=True)
    assert terminal.getvalue().rstrip("\x1b[?25h").endswith("00:15  12,015 r/min\n")


def test_progress_on_a_terminal_is_a_bar(environment: Callable[..., None]) -> None:
    environment(NO_COLOR="1", COLUMNS="80")
    terminal = Terminal()
    console = TerminalOutput(terminal)
    console.progress("reading", 0.5)
    assert re.search(r"reading {2}[-━ ╸]{30} {2} 50 %", terminal.getvalue())


def test_closed_terminal_does_not_raise() -> None:
    attempts = []

    class Closed(Terminal):
        def write(self, text: str) -> int:
            attempts.append(text)
            raise OSError(5, "Input/output error")

    console = TerminalOutput(Closed())
    console.line("a message")
    console.progress("00:15")
    console.done()
    assert any("a message" in text for text in attempts)


def test_status_line_drops_parts_that_do_not_fit() -> None:
    line = "00:15  12,015 r/min ▲  x 32 µm  y 32 µm pp  lost 0  0.49X 13 µm  disk 33 h"
    assert fit_to_width(line, 120) == line
    assert fit_to_width(line, 70) == "00:15  12,015 r/min ▲  x 32 µm  y 32 µm pp  lost 0  0.49X 13 µm …"
    assert fit_to_width(line, 64) == "00:15  12,015 r/min ▲  x 32 µm  y 32 µm pp  lost 0  disk 33 h …"
    assert fit_to_width("one sentence that is longer than that", 20) == "one sentence that …"


def test_labelled_text_wraps_below_itself(environment: Callable[..., None]) -> None:
    environment(COLUMNS="80")
    line = "whirl predicted from 18,000 r/min (0.21X), measured from 14,703 r/min (0.17X)"
    first, second = printed(Terminal(), labelled([("model", line)]))
    assert first.startswith("model            whirl predicted")
    assert first.endswith("measured from 14,703")
    assert second == " " * 17 + "r/min (0.17X)"
    assert printed(io.StringIO(), labelled([("model", line)])) == [f"model            {line}"]


def test_lines_in_a_file_are_not_wrapped(environment: Callable[..., None]) -> None:
    environment(COLUMNS="80")
    assert printed(io.StringIO(), "word " * 40) == [("word " * 40).rstrip()]
    assert printed(io.StringIO(), grid(("a", "b " * 200))) == ["a  " + ("b " * 200).rstrip()]


def test_text_on_a_terminal_is_wrapped_at_words(environment: Callable[..., None]) -> None:
    environment(COLUMNS="20")
    assert printed(Terminal(), "a sentence of several words") == ["a sentence of", "several words"]


def test_table_wider_than_the_terminal_is_printed_in_parts(environment: Callable[..., None]) -> None:
    environment(COLUMNS="30", NO_COLOR="1")
    names = ["order", "onset_rpm", "end_rpm", "largest_peak_um"]
    table = NumberTable(names, [[0.5, 1.0], [10_000.0, 2.0], [12_000.0, 3.0], [1.5, float("nan")]])
    lines = [re.sub(r"\x1b\[[0-9;]*m", "", line).rstrip() for line in printed(Terminal(), table)]
    assert lines == [
        "           onset       end",
        " order       rpm       rpm",
        "0.5000  10,000.0  12,000.0",
        " 1.000     2.000     3.000",
        "        largest",
        "           peak",
        " order       um",
        "0.5000    1.500",
        " 1.000        –",
    ]
    assert printed(io.StringIO(), table)[2] == " order       rpm       rpm       um"


@pytest.mark.parametrize(
    ("stream", "no_color", "expected"),
    [
        (Terminal, None, "\x1b[31mFAIL\x1b[0m"),
        (Terminal, "1", "FAIL"),
        (io.StringIO, None, "FAIL"),
    ],
)
def test_colour_is_used_on_a_terminal_without_no_color(
    stream: type[io.StringIO], no_color: str | None, expected: str, environment: Callable[..., None]
) -> None:
    environment(NO_COLOR=no_color)
    assert printed(stream(), Text("FAIL", style="red")) == [expected]


def test_progress_in_a_file_starts_at_one_per_cent() -> None:
    file = io.StringIO()
    console = TerminalOutput(file)
    for part in (0.001, 0.25, 0.5):
        console.progress("reading", part)
    assert file.getvalue() == "reading: 25 %\n"


@pytest.mark.parametrize(
    ("encoding", "expected"),
    [("utf-8", "∠µ° ± × ▲ ≥ … é"), ("cp1252", "<µ° ± × ^ >= … é"), ("ascii", "<udeg +/- x ^ >= ... ?")],
)
def test_characters_missing_in_the_encoding_are_written_as_ascii(encoding: str, expected: str) -> None:
    written = io.BytesIO()
    with io.TextIOWrapper(written, encoding=encoding) as stream:
        use_ascii_fallback(stream)
        print("∠µ° ± × ▲ ≥ … é", end="", file=stream, flush=True)
        assert written.getvalue().decode(encoding) == expected


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252", "ascii"])
def test_json_is_valid_utf_8_in_any_terminal_encoding(encoding: str) -> None:
    written = io.BytesIO()
    with io.TextIOWrapper(written, encoding=encoding) as stream, contextlib.redirect_stdout(stream):
        print_json({"text": "31 µm ∠ 45°"})
        stream.flush()
        assert json.loads(written.getvalue().decode("utf-8")) == {"text": "31 µm ∠ 45°"}


def test_every_help_page_fits_a_terminal_of_80_columns(environment: Callable[..., None]) -> None:
    environment(COLUMNS="80")
    pages = {parser.prog: parser.format_help() for parser in parsers(rig_parser())}
    assert len(pages) > 30
    assert [line for page in pages.values() for line in page.splitlines() if len(line) > 80] == []


def test_rig_without_arguments_prints_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    assert "preflight  Check the rig before a run" in capsys.readouterr().err
