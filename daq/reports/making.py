"""Analyses as they are asked for over REST: made once as long as the file does not change."""

import re
from functools import lru_cache
from pathlib import Path

from daq.reports.analyses_questions import AnalysisForm, Asked
from daq.reports.analysis import Analysis, Tell
from daq.reports.records import status_of
from daq.reports.registry import KINDS
from daq.reports.run_samples import RunSamples
from daq.reports.sending import content
from recordings.mcap.reader import RunReader

MADE_KEPT = 8
ADDRESS = re.compile(r"(analyses/([a-z-]+))\.([a-z]+)")


def analysis_answer(path: Path, what: str, query: Asked) -> bytes:
    """Return the answer of an address with its form, as "analyses/orbit.svg"."""
    asked = ADDRESS.fullmatch(what)
    if asked is None:
        raise ValueError(f"what: {what!r}, expected an analysis and its form, as analyses/orbit.svg")
    status = status_of(path)
    alike = query.model_copy(update={"format": None})
    run, analysis = _made(path, status.st_size, status.st_mtime_ns, asked[2], alike)
    return content(analysis, run, asked[2], AnalysisForm(asked[3]))


def analysis_made(path: Path, kind: str, query: Asked, tell: Tell) -> tuple[str, Analysis]:
    """Return a run's id and an analysis of it."""
    with RunReader(path) as reader:
        return reader.header.run, KINDS[kind].make(RunSamples(reader, tell), query)


@lru_cache(maxsize=MADE_KEPT)
def _made(path: Path, _size: int, _changed_ns: int, kind: str, query: Asked) -> tuple[str, Analysis]:
    return analysis_made(path, kind, query, lambda _doing, _part: None)
