"""A run in a line of a list, and `rig summary`: what it was."""

import argparse

from daq.cli.progress import Console
from daq.cli.replay import found
from daq.cli.summary_text import tell
from daq.config.calibration import load_calibration
from daq.reports.summaries import Summaries
from daq.schemas import RunDocument
from daq.session.prediction.predictors import Predictors
from recordings.integrity.verify import Verdict


def run_line(run: RunDocument) -> str:
    """Return what there is to say of a run in a line of a list."""
    state = "complete" if run.is_complete else "cut short"
    if run.is_complete and not run.is_gap_free:
        state = "samples lost"
    if run.verdict not in ("", Verdict.SOUND):
        state = run.verdict
    size = f"{run.size_bytes / 1e6:9.1f} MB"
    return "  ".join((run.run, f"{run.duration_s or 0.0:8.1f} s", size, run.fault or state, *said_of(run)))


def said_of(run: RunDocument) -> list[str]:
    """Return what people say of a run: tags, note, remark."""
    words = [" ".join(text.split()) for text in (run.note or "", run.remark)]
    return [*(f"#{tag}" for tag in run.tags), *(f"“{text}”" for text in words if text)]


def summary(chosen: argparse.Namespace) -> int:
    """Say what a run was; return the exit code."""
    console = Console()
    catalogue, run_id = found(chosen.recording, chosen.folder)
    calibrations = {name: load_calibration(path) for name, path in chosen.calibration}
    with Predictors() as predictors:
        summaries = Summaries(catalogue, predictors)
        if calibrations:
            document = summaries.reevaluated(run_id, calibrations, console.progress)
        else:
            document = summaries.patiently(run_id, console.progress)
    console.clear()
    tell(document, as_json=chosen.json)
    return 0 if document.is_gap_free else 5
