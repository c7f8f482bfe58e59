"""The commands for runs that go on: recorded, marked, replayed, served.

Watching a run from the terminal until it ends or is stopped.
`rig record`: one run, from the device to its summary.
`rig replay`: a recording through the live analysis and picture.
`rig serve`: the page and REST for recorded runs, until stopped.
"""

import argparse
import os
import time
from contextlib import ExitStack, closing
from importlib.metadata import version
from pathlib import Path

from daq.cli import markers
from daq.cli.arguments import AddCommand, add_folder, duration, pace, port, show_examples
from daq.cli.live_services import LiveServices
from daq.cli.markers import take_markers
from daq.cli.output.progress import Console, status_line
from daq.cli.output.summary_text import print_summary
from daq.cli.output.terminal import print_json
from daq.cli.runs import find_run, run_row
from daq.config.loader import load_rig, with_trigger
from daq.config.rig import Rig
from daq.config.schema import StorageSection
from daq.drivers.replay import open_replay
from daq.reports.summaries import Summaries
from daq.schemas.runs import run_schema
from daq.service.results_reader import ResultsReader
from daq.session.live_update import RunState, Status
from daq.session.prediction.predictors import PATIENCE, Predictors
from daq.session.recording.messages import RecordingRequest
from daq.session.recording.recorded_run import RecordedRun
from daq.session.replayed_run import ReplayedRun
from daq.session.run import Run, RunOutcome
from daq.session.run_manager import RunManager
from daq.session.runout_reference import with_reference_runout
from daq.stop_flag import EXIT_INTERRUPTED, StopFlag, stop_on_signals
from recordings.catalogue.catalogue import Catalogue, data_folder
from recordings.mcap.parts import file_ids
from recordings.mcap.reader import RunReader

_LOOK = 0.2  # s
_TROUBLE = frozenset({RunState.DEGRADED, RunState.INTERRUPTED})


def follow(run: Run, stop: StopFlag, console: Console) -> RunOutcome:
    """Show the run's progress until its end; a set `stop` ends it by hand."""
    asked, telling = False, _Telling(console)
    try:
        while not run.wait(_LOOK):
            frame = run.latest()
            telling.take(frame.status)
            console.progress(status_line(frame))
            if stop.is_set() and not asked:
                asked = True
                run.stop()
        if stop.is_set() and not asked:  # the recorder was told as well, and was faster
            run.stop()
        console.progress(status_line(run.latest()))
        console.done()
    finally:  # whatever happens here, the recorder is not left alone with an open file
        outcome = run.close()
    return outcome


class _Telling:
    """Keeps on the terminal what went wrong, when the line of progress has long gone on."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._state = RunState.STARTING
        self._loss = ""

    def take(self, status: Status) -> None:
        """Print a line where trouble begins, and where a segment was lost."""
        if status.last_loss != self._loss:
            self._loss = status.last_loss
            self._console.line(self._loss)
        if status.state is not self._state:
            self._state = status.state
            if status.state in _TROUBLE:
                self._console.line(status.detail)


FEW = 3  # files of a run that are each summed up at its end


def order_for(catalogue: Catalogue, rig: Rig, note: str, duration: float | None) -> RecordingRequest:
    """Return the order for a run that begins now."""
    started_ns = time.time_ns()
    run_id, path = catalogue.new_run(rig.config.rig, started_ns)
    return RecordingRequest(
        rig=with_reference_runout(rig, catalogue.folder),
        run=run_id,
        started_ns=started_ns,
        note=note,
        program=f"rig {version('rig-service')}",
        path=path,
        duration=duration,
    )


def run_record(args: argparse.Namespace) -> int:
    """Record a run; return the exit code."""
    console = Console()
    rig = with_trigger(
        load_rig(Path(args.config)),
        start=args.start,
        stop=args.stop,
        pre_s=args.pre,
        events=args.events,
        hold_off_s=args.hold_off,
    )
    catalogue = Catalogue(data_folder(rig.config.storage.folder), rig.config.storage.catalogue)
    with Predictors() as predictors, ResultsReader(predictors) as results:
        summaries = Summaries(catalogue, predictors, results.summary)
        with stop_on_signals() as stop, LiveServices(args, catalogue, summaries, console, results) as screens:
            order = order_for(catalogue, rig, args.note, args.duration)
            with closing(RecordedRun(order, predictors.for_rig(rig), screens.sinks, stop.is_set)) as recorded:
                screens.show(recorded)
                device, rate = recorded.header.acquisition.device, recorded.header.acquisition.rate
                which = "simulated" if device.simulated else f"serial {device.serial}"
                n_channels = len(recorded.header.acquisition.channels)
                console.line(
                    f"run {order.run}  {device.product} ({which})  {n_channels} × {rate / 1e3:g} kS/s  {order.path}"
                )
                console.line(screens.addresses())
                if take_markers(recorded, console):
                    console.line(
                        "type a word and Enter to mark a moment, ack to acknowledge alarms; Ctrl-C ends the run"
                    )
                outcome = follow(recorded, stop, console)
        if outcome.message:
            console.line(f"rig: {outcome.message}")
        names = list(file_ids(order.path))
        if len(names) > FEW and not args.json:
            for name in names:
                print(run_row(run_schema(catalogue.run(name))))
            print(f"{len(names)} recordings; rig summary RUN tells more of each")
            return outcome.exit_code
        try:
            documents = [summaries.patiently(name, console.progress) for name in names]
        except KeyboardInterrupt:  # once more: the run has been ended, now the wait for the model is
            console.line(f"not summed up; rig summary {order.run} does it")
            return outcome.exit_code or EXIT_INTERRUPTED
        console.done()
    if args.json and len(documents) > 1:
        print_json(list(documents))
    else:
        for document in documents:
            print_summary(document, as_json=args.json)
    return outcome.exit_code


def run_replay(args: argparse.Namespace) -> int:
    """Replay a recording; return the exit code."""
    console = Console()
    catalogue, run_id = find_run(args.recording, args.folder)
    path = catalogue.path(run_id)
    with RunReader(path) as reader:
        header, delivery, markers = reader.header, reader.delivery, reader.markers()
    with Predictors() as predictors, ResultsReader(predictors) as results:
        summaries = Summaries(catalogue, predictors, results.summary)
        model = predictors.for_run(header)
        with stop_on_signals() as stop, LiveServices(args, catalogue, summaries, console, results) as screens:
            source = open_replay(path, args.pace)
            replayed = ReplayedRun(header, source, model, screens.sinks, markers)
            screens.show(replayed)
            pace = "as fast as it goes" if args.pace is None else f"at {args.pace:g} × its own pace"
            console.line(f"replay of {run_id} {pace}")
            console.line(screens.addresses())
            outcome = follow(replayed, stop, console)
        model.wait(PATIENCE, lambda state: console.progress(f"model {state}"))
        console.done()
        document = summaries.document(replayed.summary(), header, delivery, markers)
    print_summary(document, as_json=args.json)
    return outcome.exit_code


def run_serve(args: argparse.Namespace) -> int:
    """Serve until stopped; return the exit code."""
    console = Console()
    rig = load_rig(Path(args.config)) if args.config else None
    storage = StorageSection() if rig is None else rig.config.storage
    catalogue = Catalogue(data_folder(args.folder or storage.folder), storage.catalogue)
    args.no_view = True  # runs are shown by `rig record` and `rig replay`
    with (
        stop_on_signals() as stop,
        Predictors() as predictors,
        ResultsReader(predictors) as results,
        ExitStack() as stack,
    ):
        desk = None
        if rig is not None:

            def begin(rig: Rig, note: str, duration: float | None) -> RecordedRun:
                order = order_for(catalogue, rig, note, duration)
                return RecordedRun(order, predictors.for_rig(rig), is_stopping=stop.is_set)

            desk = stack.enter_context(RunManager({rig.config.rig: rig}, begin))
        summaries = Summaries(catalogue, predictors, results.summary)
        with LiveServices(args, catalogue, summaries, console, results, desk) as screens:
            console.line(screens.addresses())
            while not stop.wait(1.0):  # a wait without end would not let Ctrl-C through everywhere
                continue
    return 0


_PORT = 8501


def add_recording_commands(add: AddCommand) -> None:
    """Add the commands with `add`, which takes name, function and description."""
    command = add("record", run_record, "Record a run, with live picture and REST, and sum it up at its end.")
    command.add_argument("config", metavar="RIG.TOML", help="the rig")
    _add_recording(command)
    command.add_argument("--json", action="store_true", help="print the summary as JSON on standard output")
    command.add_argument("--no-serve", action="store_true", help="without page and REST")
    _add_screens(command)
    show_examples(
        command,
        'rig record rigs/usb6251.toml --for 5min --note "new oil"',
        'rig record rigs/usb6251.toml --start "speed > 2000" --pre 2s',
    )

    command = add(
        "mark", markers.run_mark, "Name the present moment of the run that is recorded, from another terminal."
    )
    command.add_argument("word", metavar="WORD", nargs="*", help="what it is called (default: mark)")
    command.add_argument("--json", action="store_true", help="as JSON")
    _add_address(command)
    show_examples(command, "rig mark knocking begins")

    command = add(
        "acknowledge",
        markers.run_acknowledge,
        "Take note of the alarms of the run that goes on; what is over goes.",
    )
    command.add_argument("--json", action="store_true", help="as JSON")
    _add_address(command)

    command = add("replay", run_replay, "Replay a recording through the same analysis and picture.")
    command.add_argument("recording", metavar="RUN", help="a run's id, or a file")
    command.add_argument(
        "--pace",
        type=pace,
        default=1.0,
        help="1: its own pace (default), 10: ten times as fast, max: as fast as it goes",
    )
    add_folder(command)
    command.add_argument("--json", action="store_true", help="print the summary as JSON on standard output")
    command.add_argument("--no-serve", action="store_true", help="without page and REST")
    _add_screens(command)
    show_examples(
        command, "rig replay 2026-11-24T09-12-07-gj90c --pace 10", "rig replay data/2026-11-24T09-12-07-gj90c.mcap"
    )

    command = add("serve", run_serve, "Serve the page and REST for the recorded runs until stopped.")
    command.add_argument(
        "config",
        metavar="RIG.TOML",
        nargs="?",
        help="the rig: its folder is served, and its runs are started and stopped over REST",
    )
    add_folder(command)
    _add_screens(command)
    show_examples(command, "rig serve rigs/bench.toml")


def _add_address(parser: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    parser.add_argument("--host", default="127.0.0.1", help="address of page and REST (default: this machine only)")
    parser.add_argument(
        "--port",
        type=port,
        default=_PORT,
        help=f"port of page and REST (default {_PORT}; 0: any free one)",
    )
    parser.add_argument(
        "--token",
        default=os.environ.get("RIG_TOKEN", ""),
        help="bearer token that requests must carry, needed with another --host; better given as $RIG_TOKEN",
    )


def _add_screens(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("screens")
    _add_address(group)
    group.add_argument(
        "--cors",
        action="append",
        default=[],
        metavar="ORIGIN",
        help="another site whose pages may ask, such as http://notebook.lab:8888; may be given again",
    )
    group.add_argument("--no-view", action="store_true", help="without the live picture (it needs rerun-sdk)")


def _add_recording(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--for", dest="duration", type=duration, metavar="TIME", help="stop after 60s, 5min, 1h … (default: Ctrl-C)"
    )
    parser.add_argument("--note", default="", help="a word to remember the run by")
    group = parser.add_argument_group("trigger", "What is not given is as [trigger] of the rig file says.")
    group.add_argument(
        "--start", metavar="CONDITION", help='record from here on: "speed > 2000" (r/min), "x > 4.5" (V) …'
    )
    group.add_argument("--stop", metavar="CONDITION", help='and up to here: "speed < 1500", "time > 10" (s) …')
    group.add_argument("--pre", type=duration, metavar="TIME", help="from before the start, recorded too: 2s …")
    group.add_argument(
        "--events",
        type=int,
        metavar="N",
        help="wait for the start again after a stop, for N recordings in all, each a file (0: until Ctrl-C)",
    )
    group.add_argument(
        "--hold-off", type=duration, metavar="TIME", help="after a stop, before a start is looked for: 10s …"
    )
