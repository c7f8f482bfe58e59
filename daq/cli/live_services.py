"""The live view and the HTTP service of a command, started and closed together."""

import argparse
from dataclasses import replace
from types import TracebackType
from typing import TYPE_CHECKING, Self

from daq.cli.progress import TerminalOutput
from daq.errors import ServiceError, UsageError
from daq.reports.run_summaries import Summaries
from daq.schemas.events import AcknowledgedAlarmsSchema, MarkerSchema, alarm_schema, marker_schema
from daq.service.access import is_loopback
from daq.service.app import create_app
from daq.service.jobs.queue import CatalogueLocation, JobQueue
from daq.service.results_reader import ResultsReader
from daq.service.server import ServiceServer
from daq.service.state import ServiceState
from daq.session.live_update import LiveUpdate, LiveUpdateSink
from daq.session.run import Run, RunManager, SupportsMarkers
from daq.view import open_live_view
from recordings.catalogue.catalogue import Catalogue

if TYPE_CHECKING:
    from daq.view.live_view import LiveView


class LiveServices:
    """The live view (rerun) and the HTTP service for the runs of a data folder.

    Parameters
    ----------
    args : argparse.Namespace
        The command's options: host, port, token, no_view, no_serve.
    catalogue : Catalogue
        The data folder.
    summaries : Summaries
        Computes the summaries of runs.
    console : TerminalOutput
        Prints the addresses.
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

    def __init__(
        self,
        args: argparse.Namespace,
        catalogue: Catalogue,
        summaries: Summaries,
        console: TerminalOutput,
        results: ResultsReader,
        manager: RunManager | None = None,
    ) -> None:
        if not is_loopback(args.host) and not args.token:
            raise UsageError(f"--host {args.host} accepts requests from other machines: give --token SECRET with it")
        self._run: Run | None = None
        self._manager = manager
        self._view = None if args.no_view else self._open_view(console)
        self._server: ServiceServer | None = None
        self._jobs = JobQueue(CatalogueLocation(catalogue.folder, catalogue.url))
        if getattr(args, "no_serve", False):
            return
        state = ServiceState(catalogue, self, summaries, results, self._jobs, manager)
        app = create_app(
            state,
            self._view.url if self._view is not None and is_loopback(args.host) else "",
            host=args.host,
            token=args.token or None,
            cors_origins=args.cors,
        )
        server = ServiceServer(app, args.host, args.port, closing=state.closing)
        try:
            server.start()
        except ServiceError:
            self.close()
            raise
        self._server = server

    @staticmethod
    def _open_view(console: TerminalOutput) -> "LiveView | None":
        """Return the live view, served on loopback only because rerun's viewer has no access control."""
        try:
            return open_live_view()
        except ServiceError as error:
            console.line(f"no live view: {error}")
            return None

    @property
    def sinks(self) -> tuple[LiveUpdateSink, ...]:
        """The sinks that receive live updates."""
        return () if self._view is None else (self._view,)

    def show(self, run: Run) -> None:
        """Make this the live run."""
        self._run = run

    def latest(self) -> LiveUpdate | None:
        """Return the latest update of the live run; None without one."""
        run = self._live_run
        if run is None:
            return None
        update = run.latest()
        if self._view is None:
            return update
        detail = update.status.detail or self._view.failure
        return replace(update, status=replace(update.status, dropped_updates=self._view.dropped, detail=detail))

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
        marker = run.add_marker(text) if run is not None and isinstance(run, SupportsMarkers) else None
        return None if run is None or marker is None else marker_schema(marker, run.header.acquisition.rate)

    def acknowledge(self) -> AcknowledgedAlarmsSchema | None:
        """Acknowledge the alarms of the live run; return None without a run."""
        run = self._live_run
        if run is None:
            return None
        return AcknowledgedAlarmsSchema(run=run.header.run, alarms=tuple(alarm_schema(a) for a in run.acknowledge()))

    @property
    def _live_run(self) -> Run | None:
        return self._run or (None if self._manager is None else self._manager.run)

    def addresses(self) -> str:
        """Return the addresses of page, REST and live view, one a line."""
        lines = []
        if self._server is not None:
            lines += [
                f"page {self._server.url}/",
                f"REST {self._server.url}/api/v1, reference at {self._server.url}/docs",
            ]
        if self._view is not None:
            lines.append(f"live view, also on the page: {self._view.url}")
        return "\n".join(lines)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the service, its jobs and the live view."""
        if self._server is not None:
            self._server.close()
        self._jobs.close()
        if self._view is not None:
            self._view.close()
