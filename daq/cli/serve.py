"""`rig serve`: the page and REST for recorded runs, until stopped."""

import argparse
from contextlib import ExitStack
from pathlib import Path

from daq.cli.live_screens import Screens
from daq.cli.progress import Console
from daq.cli.record import order_for
from daq.cli.signals import stop_requested
from daq.config.load import load_rig
from daq.config.rig import Rig
from daq.config.schema import StorageSection
from daq.reports.summaries import Summaries
from daq.service.run_reader import Readings
from daq.session.prediction.predictors import Predictors
from daq.session.recording.recorded_run import RecordedRun
from daq.session.run_manager import RunDesk
from recordings.catalogue.catalogue import Catalogue, data_folder


def run(chosen: argparse.Namespace) -> int:
    """Serve until stopped; return the exit code."""
    console = Console()
    rig = load_rig(Path(chosen.config)) if chosen.config else None
    storage = StorageSection() if rig is None else rig.config.storage
    catalogue = Catalogue(data_folder(chosen.folder or storage.folder), storage.catalogue)
    chosen.no_view = True  # runs are shown by `rig record` and `rig replay`
    with stop_requested() as stop, Predictors() as predictors, Readings(predictors) as readings, ExitStack() as stack:
        desk = None
        if rig is not None:

            def begin(rig: Rig, note: str, duration: float | None) -> RecordedRun:
                order = order_for(catalogue, rig, note, duration)
                return RecordedRun(order, predictors.for_rig(rig), is_stopping=stop.is_set)

            desk = stack.enter_context(RunDesk({rig.config.rig: rig}, begin))
        summaries = Summaries(catalogue, predictors, readings.summary)
        with Screens(chosen, catalogue, summaries, console, readings, desk) as screens:
            console.line(screens.addresses())
            while not stop.wait(1.0):  # a wait without end would not let Ctrl-C through everywhere
                continue
    return 0
