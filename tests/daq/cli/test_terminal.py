"""Terminal output: width, ASCII fallback, JSON and the help pages."""

import argparse
import contextlib
import io
import json
import os
import re
from collections.abc import Iterator
from dataclasses import replace

import pytest

from daq.cli.commands import rig_parser
from daq.cli.main import main
from daq.cli.progress import TerminalOutput, status_line
from daq.cli.terminal import fit_to_width, print_json, print_lines, use_ascii_fallback, wrap_line
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


def test_status_line_is_rewritten_within_the_terminal_width_with_the_most_important_parts() -> None:
    long = replace(UPDATE, status=replace(UPDATE.status, model="computing 43 %", skipped=12_345))
    terminal = Terminal()
    console = TerminalOutput(terminal)
    for _ in range(3):
        console.progress(status_line(long))
    lines = terminal.getvalue().split("\r")[1:]
    assert len(status_line(long)) > 80
    assert [len(line) < 80 for line in lines] == [True] * 3
    assert re.match(r"\d\d:\d\d +[\d,]+ r/min . +x \d+ µm  y \d+ µm pp  .*lost 0", lines[0])
    assert lines[0].rstrip().endswith("…")
    console.clear()
    assert terminal.getvalue().endswith(" \r")


def test_status_line_drops_parts_that_do_not_fit() -> None:
    line = "00:15  12,015 r/min ▲  x 32 µm  y 32 µm pp  lost 0  0.49X 13 µm  disk 33 h"
    assert fit_to_width(line, None) == fit_to_width(line, 120) == line
    assert fit_to_width(line, 70) == "00:15  12,015 r/min ▲  x 32 µm  y 32 µm pp  lost 0  0.49X 13 µm …"
    assert fit_to_width(line, 64) == "00:15  12,015 r/min ▲  x 32 µm  y 32 µm pp  lost 0  disk 33 h …"
    assert fit_to_width("one sentence that is longer than that", 20) == "one sentence that …"


def test_long_lines_wrap_below_the_text_after_their_label() -> None:
    line = "model            whirl predicted from 18,000 r/min (0.21X), measured from 14,703 r/min (0.17X)"
    first, second = wrap_line(line, 80).split("\n")
    assert first.endswith("measured from")
    assert second == " " * 17 + "14,703 r/min (0.17X)"
    assert wrap_line(line, None) == line


def test_lines_in_a_file_are_not_wrapped(capsys: pytest.CaptureFixture[str]) -> None:
    print_lines(["word " * 40])
    assert capsys.readouterr().out == "word " * 40 + "\n"


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


def test_every_help_page_fits_a_terminal_of_80_columns() -> None:
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = "80"
    try:
        pages = {parser.prog: parser.format_help() for parser in parsers(rig_parser())}
    finally:
        os.environ.pop("COLUMNS")
        if before is not None:
            os.environ["COLUMNS"] = before
    assert len(pages) > 30
    assert [line for page in pages.values() for line in page.splitlines() if len(line) > 80] == []


def test_rig_without_arguments_prints_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    assert "preflight  Check the rig before a run" in capsys.readouterr().err
