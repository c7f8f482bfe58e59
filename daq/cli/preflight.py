"""`rig preflight`: whether the rig is ready."""

import argparse
import datetime as dt
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

from analysis.preflight.verdict import Verdict
from daq.cli.progress import RPM, Console
from daq.cli.summary_text import print_json
from daq.cli.terminal import show, width_of
from daq.config.load import load_rig
from daq.schemas.preflight import preflight_document
from daq.session.preflight.preflight import Plan, Preflight, preflight
from recordings.catalogue.catalogue import data_folder

NOT_READY = 4  # exit code
_WIDTH = 112  # at most
_COLUMN = 34  # of what is found, at most: what is longer pushes what is expected aside
_NARROW = 24  # the same on a terminal of 80
_LEAST = 16  # columns for what is expected


def run(chosen: argparse.Namespace) -> int:
    """Check and print the table; return the exit code."""
    console = Console()
    rig = load_rig(Path(chosen.config))
    plan = Plan(
        folder=data_folder(rig.config.storage.folder),
        duration=chosen.duration,
        speed=None if chosen.speed_rpm is None else chosen.speed_rpm * RPM,
    )
    found = preflight(rig, plan, dt.datetime.now().astimezone().date(), console.progress)
    console.clear()
    if chosen.json:
        print_json(preflight_document(rig.config.rig, found))
    else:
        show(table(found, width_of(sys.stdout) or _WIDTH + 1))
    if found.trouble is not None:
        return found.trouble.exit_code
    return NOT_READY if found.verdict is Verdict.FAIL else 0


def table(found: Preflight, width: int) -> Iterator[str]:
    """Yield the checks line by line, with what to do under those that are not good, and the verdict last."""
    width = min(width - 1, _WIDTH)
    names = max(len(check.name) for check in found.checks)
    values = min(max(len(check.value) for check in found.checks), _COLUMN if width > 2 * names + _COLUMN else _NARROW)
    for check in found.checks:
        row = f"{check.verdict.value}  {check.name:{names}}  {check.value:{values}}  "
        if len(row) > width - _LEAST:  # what is expected has a line of its own
            yield row.rstrip()
            row = " " * (len(row) - len(check.value) + min(len(check.value), values))
        yield from _hung(row, check.limit, width)
        if check.advice:
            yield from textwrap.wrap(check.advice, width, initial_indent="      → ", subsequent_indent="        ")
    failed = sum(check.verdict is Verdict.FAIL for check in found.checks)
    warned = sum(check.verdict is Verdict.WARN for check in found.checks)
    warnings = f"{warned} warning{'' if warned == 1 else 's'}"
    if failed:
        yield f"NOT READY: {failed} of {len(found.checks)} checks failed, {warnings}"
    else:
        yield f"ready: {len(found.checks)} checks, {warnings if warned else 'all good'}"


def _hung(row: str, limit: str, width: int) -> Iterator[str]:
    """Yield a row with its last column, which goes on below itself."""
    for part in textwrap.wrap(limit, max(width - len(row), _LEAST), break_long_words=False) or [""]:
        yield (row + part).rstrip()
        row = " " * len(row)
