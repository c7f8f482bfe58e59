"""`rig serve`: the page and REST for recorded runs, until stopped."""

import argparse
from pathlib import Path

from daq.cli.console import Console
from daq.cli.screens import Screens
from daq.cli.stopping import stop_requested
from daq.config.load import load_rig
from daq.config.schema import StorageSection
from daq.service.summaries import Summaries
from daq.session.predictors import Predictors
from recordings.catalogue import Catalogue, data_folder


def run(chosen: argparse.Namespace) -> int:
    """Serve until stopped; return the exit code."""
    console = Console()
    storage = load_rig(Path(chosen.config)).config.storage if chosen.config else StorageSection()
    catalogue = Catalogue(data_folder(chosen.folder or storage.folder), storage.catalogue)
    chosen.no_view = True  # nothing is live: runs are shown by `rig replay`
    with stop_requested() as stop, Predictors() as predictors:
        summaries = Summaries(catalogue, predictors)
        with Screens(chosen, catalogue, summaries, console) as screens:
            console.line(screens.addresses())
            while not stop.wait(1.0):  # a wait without end would not let Ctrl-C through everywhere
                continue
    return 0
