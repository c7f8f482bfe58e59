"""Routes of the run list, run summaries, the current run and the service's health."""

import time
from collections.abc import Sequence
from functools import partial
from typing import Annotated, Protocol

from fastapi import Query, Request, Response

from daq.schemas.live import LiveSchema, live_schema
from daq.schemas.runs import RunListSchema, RunSchema, run_list_schema, run_schema
from daq.schemas.snapshot import LiveCurvesSchema, live_curves_schema
from daq.schemas.summary import SummarySchema
from daq.service.problem_types import ProblemType
from daq.service.problems import ProblemError
from daq.service.responses import NOT_MODIFIED, matches_etag, strong_etag
from daq.service.routes.run_query import RunQuery
from daq.service.routing import BoundedThreadPool, Routing, RunId
from daq.service.schemas.health import HealthSchema, health_schema
from daq.service.stream import LiveFeed, require_ended
from daq.session.live_update import LiveUpdate
from recordings.catalogue.catalogue import RunEntry
from recordings.catalogue.run_store import Search
from recordings.errors import RecordingError


class Catalogue(Protocol):
    """The runs of a data folder."""

    def runs(self) -> Sequence[RunEntry]:
        """Return all runs, newest first."""
        ...

    def search(self, search: Search) -> Sequence[RunEntry]:
        """Return the runs that match a search, newest first."""
        ...

    def run(self, run_id: str) -> RunEntry:
        """Return one run; NotFoundError if there is none, for any id."""
        ...


class Summaries(Protocol):
    """Summaries of runs."""

    def summary(self, run_id: str) -> SummarySchema:
        """Return a run's summary; this may read the whole recording. RecordingError if it cannot be read."""
        ...


class CatalogueRoutes:
    """Routes of the run list, summaries, live values and health; files are read in threads only.

    Parameters
    ----------
    catalogue : Catalogue
        The recorded runs.
    live : LiveFeed
        The current run.
    summaries : Summaries
        Summaries of runs.
    version : str
        Version of the service.
    """

    def __init__(self, catalogue: Catalogue, live: LiveFeed, summaries: Summaries, version: str) -> None:
        self._catalogue = catalogue
        self._live = live
        self._summaries = summaries
        self._version = version
        self._started_at = time.monotonic()
        self._lookup_threads = BoundedThreadPool(threads=4, waiting=32)
        self._summary_threads = BoundedThreadPool(threads=2, waiting=16)

    def add_to(self, routing: Routing) -> None:
        """Add the routes."""
        listing = (ProblemType.INVALID_PARAMETER, ProblemType.STORAGE_UNAVAILABLE, ProblemType.BUSY)
        routing.add("/runs", self.runs, "list_runs", "runs", "List the runs", *listing)
        routing.add(
            "/runs/{run}",
            self.run,
            "get_run",
            "runs",
            "Properties of a run",
            ProblemType.RUN_NOT_FOUND,
            *listing,
            model=RunSchema,
            responses=NOT_MODIFIED,
        )
        routing.add(
            "/runs/{run}/summary",
            self.summary,
            "get_run_summary",
            "runs",
            "Summary of a run",
            ProblemType.RUN_NOT_FOUND,
            *listing,
            ProblemType.RUN_UNDER_WAY,
            ProblemType.RUN_DAMAGED,
            ProblemType.RUN_FORMAT_UNKNOWN,
            ProblemType.TIME_LIMIT_EXCEEDED,
        )
        routing.add(
            "/live", self.live, "get_live_run", "live", "Current values of the run in progress", ProblemType.NO_LIVE_RUN
        )
        routing.add(
            "/live/curves",
            self.curves,
            "get_live_curves",
            "live",
            "Current orbit and order spectrum",
            ProblemType.NO_LIVE_RUN,
        )
        routing.add("/health", self.health, "get_health", "service", "Health of the service", ProblemType.BUSY)

    async def runs(self, query: Annotated[RunQuery, Query()]) -> RunListSchema:
        """List the runs of the data folder; unfinished and truncated ones have `is_complete` false.

        Filters by measured values (speed, onset) find runs that `rig index` or the job `index` has summarised.
        """
        search = query.search()
        search_runs = partial(self._catalogue.search, search) if search != Search() else self._catalogue.runs
        chosen = query.matching(await self._lookup_threads.run(search_runs))
        return run_list_schema(chosen[query.offset :][: query.limit], len(chosen), query.limit, query.offset)

    async def run(self, request: Request, run: RunId) -> Response:
        """Return the run's properties from the recording's header and footer, within milliseconds."""
        schema = run_schema(await self._lookup_threads.run(partial(self._catalogue.run, run)))
        headers = {"ETag": strong_etag(schema), "Cache-Control": "private, no-cache"}
        if matches_etag(request.headers.get("if-none-match"), headers["ETag"]):
            return Response(status_code=304, headers=headers)
        return Response(schema.model_dump_json(), headers=headers, media_type="application/json")

    async def summary(self, run: RunId) -> SummarySchema:
        """Return speeds, amplitudes, phases, sub-synchronous components, losses, and the agreement with the model.

        If the run has no stored summary, it is computed from the whole recording, which takes a while.
        """
        require_ended(self._live, run)
        return await self._summary_threads.run(partial(self._summaries.summary, run))

    async def live(self) -> LiveSchema:
        """Return measured values, the model's prediction and the state of the recording; cheap enough for polling.

        After a run's end its last values stay, with `state` finished or failed, until the next run starts.
        """
        return live_schema(self._latest_update())

    async def curves(self) -> LiveCurvesSchema:
        """Return the measured and predicted curves of the last complete revolutions."""
        return live_curves_schema(self._latest_update())

    def _latest_update(self) -> LiveUpdate:
        update = self._live.latest()
        if update is None:
            raise ProblemError(ProblemType.NO_LIVE_RUN, "nothing is recorded or replayed now")
        return update

    async def health(self) -> HealthSchema:
        """Return the health of data folder and current run; any response shows that the service is up."""
        trouble, runs = "", None
        try:
            runs = len(await self._lookup_threads.run(self._catalogue.runs))
        except RecordingError as error:
            trouble = str(error)
        return health_schema(self._version, time.monotonic() - self._started_at, runs, self._live.latest(), trouble)
