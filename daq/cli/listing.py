"""`rig runs` and `rig summary`: what was recorded."""

import argparse

from daq.cli.console import Console
from daq.cli.replay import found
from daq.cli.telling import print_json, tell
from daq.config.calibration import load_calibration
from daq.service.documents import RunDocument, run_document
from daq.service.summaries import Summaries
from daq.session.predictors import Predictors
from recordings.catalogue import Catalogue, data_folder


def runs(chosen: argparse.Namespace) -> int:
    """List the runs of a data folder; return the exit code."""
    catalogue = Catalogue(data_folder(chosen.folder))
    documents = [run_document(entry) for entry in catalogue.runs()]
    if chosen.json:
        print_json([*documents])
    elif documents:
        for document in documents:
            print(run_line(document))
    else:
        print(f"no runs in {catalogue.folder}")
    return 0


def run_line(run: RunDocument) -> str:
    """Return what there is to say of a run in a line of a list."""
    state = "complete" if run.is_complete else "cut short"
    if run.is_complete and not run.is_gap_free:
        state = "samples lost"
    if run.fault:
        state = run.fault
    return f"{run.run}  {run.duration_s or 0.0:8.1f} s  {run.size_bytes / 1e6:9.1f} MB  {state}" + (
        f"  “{run.note}”" if run.note else ""
    )


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
    console.done()
    tell(document, as_json=chosen.json)
    return 0 if document.is_gap_free else 5
