"""`rig record`: one run, from the device to its summary."""

import argparse
import time
from contextlib import closing
from importlib.metadata import version
from pathlib import Path

from daq.cli.following import follow
from daq.cli.listing import run_line
from daq.cli.live_screens import Screens
from daq.cli.marking import take_marks
from daq.cli.progress import Console
from daq.cli.signals import STOPPED, stop_requested
from daq.cli.summary_text import print_json, tell
from daq.config.load import load_rig
from daq.config.rig import Rig
from daq.config.trigger import with_trigger
from daq.reports.summaries import Summaries
from daq.schemas import run_document
from daq.service.run_reader import Readings
from daq.session.prediction.predictors import Predictors
from daq.session.recording.messages import Order
from daq.session.recording.recorded_run import RecordedRun
from daq.session.runout_reference import with_known_runout
from recordings.catalogue.catalogue import Catalogue, data_folder
from recordings.mcap.parts import file_names

FEW = 3  # files of a run that are each summed up at its end


def order_for(catalogue: Catalogue, rig: Rig, note: str, duration: float | None) -> Order:
    """Return the order for a run that begins now."""
    started_ns = time.time_ns()
    run_id, path = catalogue.new_run(rig.config.rig, started_ns)
    return Order(
        rig=with_known_runout(rig, catalogue.folder),
        run=run_id,
        started_ns=started_ns,
        note=note,
        program=f"rig {version('rig-service')}",
        path=path,
        duration=duration,
    )


def run(chosen: argparse.Namespace) -> int:
    """Record a run; return the exit code."""
    console = Console()
    rig = with_trigger(
        load_rig(Path(chosen.config)),
        start=chosen.start,
        stop=chosen.stop,
        pre_s=chosen.pre,
        events=chosen.events,
        hold_off_s=chosen.hold_off,
    )
    catalogue = Catalogue(data_folder(rig.config.storage.folder), rig.config.storage.catalogue)
    with Predictors() as predictors, Readings(predictors) as readings:
        summaries = Summaries(catalogue, predictors, readings.summary)
        with stop_requested() as stop, Screens(chosen, catalogue, summaries, console, readings) as screens:
            order = order_for(catalogue, rig, chosen.note, chosen.duration)
            with closing(RecordedRun(order, predictors.for_rig(rig), screens.sinks, stop.is_set)) as recorded:
                screens.show(recorded)
                device, rate = recorded.header.acquisition.device, recorded.header.acquisition.rate
                which = "simulated" if device.simulated else f"serial {device.serial}"
                n_channels = len(recorded.header.acquisition.channels)
                console.line(
                    f"run {order.run}  {device.product} ({which})  {n_channels} × {rate / 1e3:g} kS/s  {order.path}"
                )
                console.line(screens.addresses())
                if take_marks(recorded, console):
                    console.line(
                        "type a word and Enter to mark a moment, ack to acknowledge alarms; Ctrl-C ends the run"
                    )
                outcome = follow(recorded, stop, console)
        if outcome.message:
            console.line(f"rig: {outcome.message}")
        names = list(file_names(order.path))
        if len(names) > FEW and not chosen.json:
            for name in names:
                print(run_line(run_document(catalogue.run(name))))
            print(f"{len(names)} recordings; rig summary RUN tells more of each")
            return outcome.exit_code
        try:
            documents = [summaries.patiently(name, console.progress) for name in names]
        except KeyboardInterrupt:  # once more: the run has been ended, now the wait for the model is
            console.line(f"not summed up; rig summary {order.run} does it")
            return outcome.exit_code or STOPPED
        console.done()
    if chosen.json and len(documents) > 1:
        print_json(list(documents))
    else:
        for document in documents:
            tell(document, as_json=chosen.json)
    return outcome.exit_code
