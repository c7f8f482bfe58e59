"""The commands with a live run, page, REST and live view: `rig record`, `rig replay` and `rig serve`."""

import argparse
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from daq.cli.arguments import (
    AddCommand,
    add_folder,
    add_json,
    add_rig_file,
    add_run,
    add_service_address,
    duration,
    pace,
)
from daq.cli.run_text import print_summary, status_line
from daq.cli.runs import find_run, print_runs
from daq.cli.terminal import TerminalOutput, print_json
from daq.config.loader import load_rig, with_trigger
from daq.config.rig import Rig
from daq.config.schema import StorageSection
from daq.drivers.replay import ReplaySource
from daq.errors import ServiceError, UsageError
from daq.reports.run_summaries import Summaries
from daq.schemas.events import AcknowledgedAlarmsSchema, MarkerSchema, alarm_schema, marker_schema
from daq.service.app import create_app
from daq.service.jobs.queue import JobQueue
from daq.service.middleware import is_loopback
from daq.service.results_reader import ResultsReader
from daq.service.server import ServiceServer
from daq.service.state import ServiceState
from daq.session.live_update import LiveUpdate, LiveUpdateSink, RunState, alarm_text
from daq.session.offline import with_reference_runout
from daq.session.predictor import PREDICTION_TIMEOUT, Predictors
from daq.session.recording.recorded_run import RecordedRun
from daq.session.recording.recorder import RecordingRequest
from daq.session.replayed_run import ReplayedRun
from daq.session.run import Run, RunManager, RunOutcome
from daq.stop_flag import EXIT_INTERRUPTED, StopFlag, stop_on_signals
from daq.view import open_live_view
from recordings.catalogue.catalogue import Catalogue, data_folder
from recordings.mcap.parts import file_ids
from recordings.mcap.reader import RunReader

if TYPE_CHECKING:
    from daq.view.live_view import LiveView

_POLL_INTERVAL = 0.2  # s
_REPORTED_STATES = frozenset({RunState.DEGRADED, RunState.INTERRUPTED})
MAX_FULL_SUMMARIES = 3  # recordings of one command whose summaries are printed in full; more get one line each
ACKNOWLEDGE = "ack"
"""A line with this text alone acknowledges alarms instead of adding a marker."""


def add_commands(add: AddCommand) -> None:
    """Add `rig record`, `rig replay` and `rig serve` to the command line."""
    add(
        "record",
        run_record,
        add_rig_file,
        _add_recording_options,
        add_json,
        _add_service_options,
        examples=[
            'rig record rigs/usb6251.toml --for 5min --note "new oil"',
            'rig record rigs/usb6251.toml --start "speed > 2000" --pre 2s',
        ],
    )
    command = add(
        "replay",
        run_replay,
        add_run,
        add_json,
        _add_service_options,
        examples=[
            "rig replay 2026-11-24T09-12-07-gj90c --pace 10",
            "rig replay data/2026-11-24T09-12-07-gj90c.mcap",
        ],
    )
    command.add_argument(
        "--pace", type=pace, default=1.0, help="1: real time (default), 10: ten times as fast, max: full speed"
    )
    command = add("serve", run_serve, add_folder, _add_page_options, examples=["rig serve rigs/bench.toml"])
    command.add_argument(
        "config",
        type=Path,
        metavar="RIG.TOML",
        nargs="?",
        help="rig file: serves its data folder, and starts and stops its runs over REST",
    )
    command.set_defaults(no_view=True, no_serve=False)


def _add_page_options(parser: argparse.ArgumentParser) -> argparse._ArgumentGroup:
    group = parser.add_argument_group("page, REST and live view")
    add_service_address(group)
    group.add_argument(
        "--cors",
        action="append",
        default=[],
        metavar="ORIGIN",
        help="origin whose pages may send requests, such as http://notebook.lab:8888; repeatable",
    )
    return group


def _add_service_options(parser: argparse.ArgumentParser) -> None:
    group = _add_page_options(parser)
    group.add_argument("--no-serve", action="store_true", help="without page and REST")
    group.add_argument("--no-view", action="store_true", help="without the live view (which needs rerun-sdk)")


def _add_recording_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--for", dest="duration", type=duration, metavar="TIME", help="stop after 60s, 5min, 1h … (default: Ctrl-C)"
    )
    parser.add_argument("--note", default="", help="note stored with the run")
    group = parser.add_argument_group("trigger", "Defaults are those of [trigger] in the rig file.")
    group.add_argument("--start", metavar="CONDITION", help='start on "speed > 2000" (r/min), "x > 4.5" (V) …')
    group.add_argument("--stop", metavar="CONDITION", help='stop on "speed < 1500", "time > 10" (s) …')
    group.add_argument("--pre", type=duration, metavar="TIME", help="also record this time before the start: 2s …")
    group.add_argument(
        "--events", type=int, metavar="N", help="rearm after each stop, for N recordings (0: until Ctrl-C); each a file"
    )
    group.add_argument("--hold-off", type=duration, metavar="TIME", help="time from a stop to rearming: 10s …")


@dataclass(slots=True)
class LiveServices:
    """The live run, its live view (rerun) and the address of its HTTP service.

    Parameters
    ----------
    view : LiveView or None
        The live view.
    manager : RunManager or None
        Starts runs on REST requests; None where that is not possible.
    run : Run or None
        The live run; None for that of the manager.
    url : str
        Address of the HTTP service; empty without one.
    """

    view: "LiveView | None"
    manager: RunManager | None
    run: Run | None = None
    url: str = ""

    @property
    def sinks(self) -> tuple[LiveUpdateSink, ...]:
        """The sinks that receive live updates."""
        return () if self.view is None else (self.view,)

    def latest(self) -> LiveUpdate | None:
        """Return the latest update of the live run; None without one."""
        run = self._live_run
        if run is None:
            return None
        update = run.latest()
        if self.view is None:
            return update
        detail = update.status.detail or self.view.failure
        return replace(update, status=replace(update.status, dropped_updates=self.view.dropped, detail=detail))

    def stop(self) -> str | None:
        """Stop the live run; return its id, None without a run in progress."""
        run = self._live_run
        if run is None or run.wait(0.0):
            return None
        run.stop()
        return run.header.run

    def add_marker(self, text: str) -> MarkerSchema | None:
        """Add a marker now to the run that is recording; return None without one."""
        run = self._live_run
        marker = run.add_marker(text) if isinstance(run, RecordedRun) else None
        return None if run is None or marker is None else marker_schema(marker, run.header.acquisition.rate)

    def acknowledge(self) -> AcknowledgedAlarmsSchema | None:
        """Acknowledge the alarms of the live run; return None without a run."""
        run = self._live_run
        if run is None:
            return None
        return AcknowledgedAlarmsSchema(run=run.header.run, alarms=tuple(alarm_schema(a) for a in run.acknowledge()))

    @property
    def _live_run(self) -> Run | None:
        return self.run or (None if self.manager is None else self.manager.run)

    def addresses(self) -> str:
        """Return the addresses of page, REST and live view, one a line."""
        lines = []
        if self.url:
            lines += [f"page {self.url}/", f"REST {self.url}/api/v1, reference at {self.url}/docs"]
        if self.view is not None:
            lines.append(f"live view, also on the page: {self.view.url}")
        return "\n".join(lines)


@contextmanager
def live_services(
    args: argparse.Namespace,
    catalogue: Catalogue,
    summaries: Summaries,
    console: TerminalOutput,
    results: ResultsReader,
    manager: RunManager | None = None,
) -> Iterator[LiveServices]:
    """Open the live view and the HTTP service for the runs of a data folder; close them, and the jobs, at the end.

    Parameters
    ----------
    args : argparse.Namespace
        The command's options: host, port, token, cors, no_view, no_serve.
    catalogue : Catalogue
        The data folder.
    summaries : Summaries
        Computes the summaries of runs.
    console : TerminalOutput
        Prints why there is no live view.
    results : ResultsReader
        Reads the results of recorded runs beyond their summaries.
    manager : RunManager or None
        Starts runs on REST requests; None where that is not possible.

    Raises
    ------
    UsageError
        The host is not the loopback address and no token is set.
    ServiceError
        The address is in use.
    """
    is_local = is_loopback(args.host)
    if not is_local and not args.token:
        raise UsageError(f"--host {args.host} accepts requests from other machines: give --token SECRET with it")
    with ExitStack() as stack:
        view = None
        if not args.no_view:
            try:  # served on loopback only because rerun's viewer has no access control
                view = stack.enter_context(closing(open_live_view()))
            except ServiceError as error:
                console.line(f"no live view: {error}")
        services = LiveServices(view, manager)
        if not args.no_serve:
            jobs = stack.enter_context(closing(JobQueue(catalogue)))
            state = ServiceState(catalogue, services, summaries, results, jobs, manager)
            viewer = view.url if view is not None and is_local else ""
            app = create_app(state, viewer, host=args.host, token=args.token or None, cors_origins=args.cors)
            server = stack.enter_context(closing(ServiceServer(app, args.host, args.port, closing=state.closing)))
            server.start()
            services.url = server.url
        yield services


def follow(run: Run, stop: StopFlag, console: TerminalOutput) -> RunOutcome:
    """Print a run's progress until it ends or `stop` is set; return its outcome.

    Lost samples, a filling buffer and a disconnected device are printed as lines that the progress line leaves alone.
    """
    is_stop_sent, state, loss = False, RunState.STARTING, ""
    try:
        while not run.wait(_POLL_INTERVAL):
            update = run.latest()
            status = update.status
            if status.last_loss != loss:
                console.line(status.last_loss)
            if status.state is not state and status.state in _REPORTED_STATES:
                console.line(status.detail)
            state, loss = status.state, status.last_loss
            console.progress(status_line(update))
            if stop.is_set() and not is_stop_sent:
                is_stop_sent = True
                run.stop()
        if stop.is_set() and not is_stop_sent:  # the recorder got the signal too and ended first
            run.stop()
        console.progress(status_line(run.latest()))
        console.done(keep=True)
    finally:  # close the run even after an error here: the recorder has an open file
        outcome = run.close()
    return outcome


def start_marker_input(run: RecordedRun, console: TerminalOutput) -> bool:
    """Start a thread that adds a marker for each typed line; return whether stdin is a terminal.

    It reads until the run has ended or the terminal is closed. It bypasses Python's buffered stdin: a thread blocked
    there would delay the exit of the program.
    """
    if sys.stdin is None or not sys.stdin.isatty():
        return False
    if hasattr(signal, "SIGTTIN"):  # POSIX: lets a read in the background fail instead of stopping the process
        signal.signal(signal.SIGTTIN, signal.SIG_IGN)
    threading.Thread(target=_read_lines, args=(sys.stdin.fileno(), run, console), name="markers", daemon=True).start()
    return True


def _read_lines(terminal: int, run: RecordedRun, console: TerminalOutput) -> None:
    encoding = (os.device_encoding(terminal) if sys.platform == "win32" else None) or "utf-8"  # Windows: a code page
    with suppress(OSError):  # the terminal is closed, or the command runs in the background
        while typed := os.read(terminal, 1024):
            text = typed.decode(encoding, errors="replace").strip()
            if text == ACKNOWLEDGE:
                alarms = run.acknowledge()
                console.line("\n".join(f"acknowledged {alarm_text(alarm)}" for alarm in alarms) or "no new alarm")
                continue
            marker = run.add_marker(text)
            if marker is None:
                return
            console.line(f"marked “{marker.text}”")


def recording_request(catalogue: Catalogue, rig: Rig, note: str, duration: float | None) -> RecordingRequest:
    """Return the request for a run that starts now, with a new run id and file name."""
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


def run_record(args: argparse.Namespace, console: TerminalOutput) -> int:
    """Record a run; return the exit code."""
    rig = with_trigger(
        load_rig(args.config),
        start=args.start,
        stop=args.stop,
        pre_s=args.pre,
        events=args.events,
        hold_off_s=args.hold_off,
    )
    catalogue = Catalogue(data_folder(rig.config.storage.folder), rig.config.storage.catalogue)
    with closing(Predictors()) as predictors, closing(ResultsReader(predictors)) as results:
        summaries = Summaries(catalogue, predictors, results.summary)
        with stop_on_signals() as stop, live_services(args, catalogue, summaries, console, results) as services:
            request = recording_request(catalogue, rig, args.note, args.duration)
            with closing(RecordedRun(request, predictors.for_rig(rig), services.sinks, stop.is_set)) as recorded:
                services.run = recorded
                device, rate = recorded.header.acquisition.device, recorded.header.acquisition.rate
                which = "simulated" if device.simulated else f"serial {device.serial}"
                n_channels = len(recorded.header.acquisition.channels)
                card = f"{device.product} ({which})  {n_channels} × {rate / 1e3:g} kS/s"
                console.line(f"run {request.run}  {card}  {request.path}")
                console.line(services.addresses())
                if start_marker_input(recorded, console):
                    console.line("type text and Enter to add a marker, ack to acknowledge alarms; Ctrl-C stops the run")
                outcome = follow(recorded, stop, console)
        if outcome.message:
            console.line(f"rig: {outcome.message}")
        names = list(file_ids(request.path))
        if len(names) > MAX_FULL_SUMMARIES and not args.json:
            print_runs(map(catalogue.run, names))
            print(f"{len(names)} recordings; rig summary RUN shows each")
            return outcome.exit_code
        try:
            run_summaries = [summaries.summary_with_agreement(name, console.progress) for name in names]
        except KeyboardInterrupt:  # a second Ctrl-C: stops the wait for the model; the recording is complete
            console.line(f"no summary yet: rig summary {request.run} prints it")
            return outcome.exit_code or EXIT_INTERRUPTED
        console.done()
    if args.json and len(run_summaries) > 1:
        print_json(run_summaries)
    else:
        for summary in run_summaries:
            print_summary(summary, as_json=args.json)
    return outcome.exit_code


def run_replay(args: argparse.Namespace, console: TerminalOutput) -> int:
    """Replay a recording; return the exit code."""
    catalogue, run_id = find_run(args)
    path = catalogue.path(run_id)
    with RunReader(path) as reader:
        header, delivery, markers = reader.header, reader.delivery, reader.markers()
    with closing(Predictors()) as predictors, closing(ResultsReader(predictors)) as results:
        summaries = Summaries(catalogue, predictors, results.summary)
        model = predictors.for_run(header)
        with stop_on_signals() as stop, live_services(args, catalogue, summaries, console, results) as services:
            source = ReplaySource(path, args.pace)
            replayed = ReplayedRun(header, source, model, services.sinks, markers)
            services.run = replayed
            pace = "at full speed" if args.pace is None else f"at {args.pace:g} × real time"
            console.line(f"replay of {run_id} {pace}")
            console.line(services.addresses())
            outcome = follow(replayed, stop, console)
        model.wait(PREDICTION_TIMEOUT, lambda state: console.progress(f"model {state}"))
        console.done()
        summary = summaries.with_agreement(replayed.summary(), header, delivery, markers)
    print_summary(summary, as_json=args.json)
    return outcome.exit_code


def run_serve(args: argparse.Namespace, console: TerminalOutput) -> int:
    """Serve page and REST until stopped; return the exit code."""
    rig = load_rig(args.config) if args.config else None
    storage = StorageSection() if rig is None else rig.config.storage
    catalogue = Catalogue(data_folder(args.folder or storage.folder), storage.catalogue)
    with (
        stop_on_signals() as stop,
        closing(Predictors()) as predictors,
        closing(ResultsReader(predictors)) as results,
        ExitStack() as stack,
    ):
        manager = None
        if rig is not None:

            def start(rig: Rig, note: str, duration: float | None) -> RecordedRun:
                request = recording_request(catalogue, rig, note, duration)
                return RecordedRun(request, predictors.for_rig(rig), is_stopping=stop.is_set)

            manager = stack.enter_context(closing(RunManager(rig, start)))
        summaries = Summaries(catalogue, predictors, results.summary)
        with live_services(args, catalogue, summaries, console, results, manager) as services:
            console.line(services.addresses())
            while not stop.wait(1.0):  # with a timeout: an endless wait blocks Ctrl-C on some systems
                continue
    return 0
