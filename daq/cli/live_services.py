"""What a run is watched on: the live picture and the service, started and ended together."""

import argparse
from dataclasses import replace
from types import TracebackType
from typing import TYPE_CHECKING, Self

from daq.cli.output.progress import Console
from daq.errors import ServiceError, UsageError
from daq.reports.summaries import Summaries
from daq.schemas.events import AcknowledgedAlarmsSchema, MarkerSchema, alarm_schema, marker_schema
from daq.service.access import is_loopback
from daq.service.app import ServiceFeatures, create_app
from daq.service.jobs.queue import CatalogueLocation, JobQueue
from daq.service.results_reader import ResultsReader
from daq.service.server import ServiceServer
from daq.session.live_update import LiveUpdate, LiveUpdateSink
from daq.session.run import Run, SupportsMarkers
from daq.session.run_manager import RunManager
from daq.view import open_live_view
from recordings.catalogue.catalogue import Catalogue

if TYPE_CHECKING:
    from daq.view.live_view import LiveView


class LiveServices:
    """The live picture and the service for the runs of a data folder.

    Parameters
    ----------
    args : argparse.Namespace
        The command's options: host, port, token, no_view, no_serve.
    catalogue : Catalogue
        The data folder.
    summaries : Summaries
        Who sums runs up.
    console : Console
        Where addresses are printed.
    results : ResultsReader or None
        Who answers what is asked of recorded runs beyond their summaries.
    desk : RunManager or None
        Who starts runs that are asked for over REST; None where none can be.

    Raises
    ------
    UsageError
        Where another machine may ask but no token is set.
    ServiceError
        Where an address is taken.
    """

    def __init__(
        self,
        args: argparse.Namespace,
        catalogue: Catalogue,
        summaries: Summaries,
        console: Console,
        results: ResultsReader | None = None,
        desk: RunManager | None = None,
    ) -> None:
        if not is_loopback(args.host) and not args.token:
            raise UsageError(f"--host {args.host} lets other machines in: --token SECRET must be given with it")
        self._run: Run | None = None
        self._desk = desk
        self._view = None if args.no_view else self._picture(console)
        self._server: ServiceServer | None = None
        self._jobs = JobQueue(CatalogueLocation(catalogue.folder, catalogue.url))
        if getattr(args, "no_serve", False):
            return
        app = create_app(
            catalogue,
            self,
            summaries,
            self._view.url if self._view is not None and is_loopback(args.host) else None,
            features=ServiceFeatures(results, self, desk, catalogue, self._jobs, tuple(args.cors)),
            host=args.host,
            token=args.token or None,
        )
        server = ServiceServer(app, args.host, args.port)
        try:
            server.start()
        except ServiceError:
            self.close()
            raise
        self._server = server

    @staticmethod
    def _picture(console: Console) -> "LiveView | None":
        """Return the live picture, on this machine alone: rerun's viewer knows no token."""
        try:
            return open_live_view()
        except ServiceError as error:
            console.line(f"no live picture: {error}")
            return None

    @property
    def sinks(self) -> tuple[LiveUpdateSink, ...]:
        """Who is offered frames."""
        return () if self._view is None else (self._view,)

    def show(self, run: Run) -> None:
        """Make this the run that is shown as live."""
        self._run = run

    def latest(self) -> LiveUpdate | None:
        """Return the present frame of the run that is shown; None where there is none."""
        run = self._shown
        if run is None:
            return None
        frame = run.latest()
        if self._view is None:
            return frame
        detail = frame.status.detail or self._view.failure
        return replace(frame, status=replace(frame.status, dropped_frames=self._view.dropped, detail=detail))

    def stop(self) -> str | None:
        """Ask for the end of the run that is shown; return its id, None where none is under way."""
        run = self._shown
        if run is None or run.wait(0.0):
            return None
        run.stop()
        return run.header.run

    def add_marker(self, text: str) -> MarkerSchema | None:
        """Name the present moment of the run that is recorded; None where none is."""
        run = self._shown
        marker = run.add_marker(text) if run is not None and isinstance(run, SupportsMarkers) else None
        return None if run is None or marker is None else marker_schema(marker, run.header.acquisition.rate)

    def acknowledge(self) -> AcknowledgedAlarmsSchema | None:
        """Take note of the alarms of the run that is shown; None where none is."""
        run = self._shown
        if run is None:
            return None
        return AcknowledgedAlarmsSchema(run=run.header.run, alarms=tuple(alarm_schema(a) for a in run.acknowledge()))

    @property
    def _shown(self) -> Run | None:
        return self._run or (None if self._desk is None else self._desk.run)

    def addresses(self) -> str:
        """Return where to look, an address a line."""
        lines = []
        if self._server is not None:
            lines += [
                f"page {self._server.url}/",
                f"REST {self._server.url}/api/v1, explained at {self._server.url}/docs",
            ]
        if self._view is not None:
            lines.append(f"live picture, as on the page: {self._view.url}")
        return "\n".join(lines)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End both."""
        if self._server is not None:
            self._server.close()
        self._jobs.close()
        if self._view is not None:
            self._view.close()
