"""`rig replay`: a recording through the live analysis and picture."""

import argparse
from pathlib import Path

from daq.cli.following import follow
from daq.cli.live_screens import Screens
from daq.cli.progress import Console
from daq.cli.signals import stop_requested
from daq.cli.summary_text import tell
from daq.drivers.replay import open_replay
from daq.reports.summaries import Summaries
from daq.service.run_reader import Readings
from daq.session.prediction.predictors import PATIENCE, Predictors
from daq.session.replayed_run import ReplayedRun
from recordings.catalogue.catalogue import SUFFIX, Catalogue, data_folder
from recordings.errors import NotFoundError
from recordings.mcap.reader import RunReader


def found(recording: str, folder: str) -> tuple[Catalogue, str]:
    """Return the catalogue and the id of a recording that is given by its id or its file.

    Raises
    ------
    NotFoundError
        There is no such recording.
    """
    path = Path(recording)
    if path.suffix == SUFFIX or path.is_file():
        if not path.is_file():
            raise NotFoundError(f"{path}: there is no such file")
        catalogue, run_id = Catalogue(path.parent), path.stem
    else:
        catalogue, run_id = Catalogue(data_folder(folder)), recording
    catalogue.path(run_id)
    return catalogue, run_id


def run(chosen: argparse.Namespace) -> int:
    """Replay a recording; return the exit code."""
    console = Console()
    catalogue, run_id = found(chosen.recording, chosen.folder)
    path = catalogue.path(run_id)
    with RunReader(path) as reader:
        header, delivery, marks = reader.header, reader.delivery, reader.marks()
    with Predictors() as predictors, Readings(predictors) as readings:
        summaries = Summaries(catalogue, predictors, readings.summary)
        model = predictors.of(header)
        with stop_requested() as stop, Screens(chosen, catalogue, summaries, console, readings) as screens:
            source = open_replay(path, chosen.pace)
            replayed = ReplayedRun(header, source, model, screens.sinks, marks)
            screens.show(replayed)
            pace = "as fast as it goes" if chosen.pace is None else f"at {chosen.pace:g} × its own pace"
            console.line(f"replay of {run_id} {pace}")
            console.line(screens.addresses())
            outcome = follow(replayed, stop, console)
        model.wait(PATIENCE, lambda state: console.progress(f"model {state}"))
        console.done()
        document = summaries.document(replayed.summary(), header, delivery, marks)
    tell(document, as_json=chosen.json)
    return outcome.exit_code
