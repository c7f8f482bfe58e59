"""The addresses under /api/v1: what they answer and how they can fail."""

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
from recordings.catalogue.search import Search
from recordings.errors import RecordingError


class Catalogue(Protocol):
    """The runs of a data folder."""

    def runs(self) -> Sequence[RunEntry]:
        """Return all runs, newest first."""
        ...

    def search(self, search: Search) -> Sequence[RunEntry]:
        """Return the runs that a search asks for, newest first."""
        ...

    def run(self, run_id: str) -> RunEntry:
        """Return one run; NotFoundError where there is none, whatever its id looks like."""
        ...


class Summaries(Protocol):
    """What runs were."""

    def summary(self, run_id: str) -> SummarySchema:
        """Return a run's summary; it may read the whole recording. RecordingError where it cannot be read."""
        ...


class CatalogueRoutes:
    """The answers; whatever reads files does so in threads, never on the event loop.

    Parameters
    ----------
    catalogue : Catalogue
        The recorded runs.
    live : LiveFeed
        The run under way.
    summaries : Summaries
        What runs were.
    version : str
        Of the service.
    """

    def __init__(self, catalogue: Catalogue, live: LiveFeed, summaries: Summaries, version: str) -> None:
        self._catalogue = catalogue
        self._live = live
        self._summaries = summaries
        self._version = version
        self._made = time.monotonic()
        self._lookup_threads = BoundedThreadPool(threads=4, waiting=32)
        self._summary_threads = BoundedThreadPool(threads=2, waiting=16)

    def add_to(self, routing: Routing) -> None:
        """Make the addresses known."""
        listing = (ProblemType.INVALID_PARAMETER, ProblemType.STORAGE_UNAVAILABLE, ProblemType.BUSY)
        routing.add("/runs", self.runs, "list_runs", "runs", "List the runs", *listing)
        routing.add(
            "/runs/{run}",
            self.run,
            "get_run",
            "runs",
            "One run",
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
            "What a run was",
            ProblemType.RUN_NOT_FOUND,
            *listing,
            ProblemType.RUN_UNDER_WAY,
            ProblemType.RUN_DAMAGED,
            ProblemType.RUN_FORMAT_UNKNOWN,
            ProblemType.TIME_LIMIT_EXCEEDED,
        )
        routing.add(
            "/live", self.live, "get_live_run", "live", "The run under way, at this moment", ProblemType.NO_LIVE_RUN
        )
        routing.add(
            "/live/curves",
            self.curves,
            "get_live_curves",
            "live",
            "Orbit and order spectrum now",
            ProblemType.NO_LIVE_RUN,
        )
        routing.add("/health", self.health, "get_health", "service", "Whether the service is well", ProblemType.BUSY)

    async def runs(self, query: Annotated[RunQuery, Query()]) -> RunListSchema:
        """List the data folder; runs under way or cut short too, with `is_complete` false.

        What was measured (speed, onset) is known of runs that the job `index` or `rig index` has summed up.
        """
        search = query.search()
        found = partial(self._catalogue.search, search) if search != Search() else self._catalogue.runs
        chosen = query.chosen(await self._lookup_threads.run(found))
        return run_list_schema(chosen[query.offset :][: query.limit], len(chosen), query.limit, query.offset)

    async def run(self, request: Request, run: RunId) -> Response:
        """Answers from the recording's header and end alone, in milliseconds."""
        document = run_schema(await self._lookup_threads.run(partial(self._catalogue.run, run)))
        headers = {"ETag": strong_etag(document), "Cache-Control": "private, no-cache"}
        if matches_etag(request.headers.get("if-none-match"), headers["ETag"]):
            return Response(status_code=304, headers=headers)
        return Response(document.model_dump_json(), headers=headers, media_type="application/json")

    async def summary(self, run: RunId) -> SummarySchema:
        """Speeds, amplitudes, phases, sub-synchronous components, losses, and the agreement with the model.

        A summary that was not made when the run ended is made now from the whole recording, which takes a while.
        """
        require_ended(self._live, run)
        return await self._summary_threads.run(partial(self._summaries.summary, run))

    async def live(self) -> LiveSchema:
        """Measured values, the model's beside them, and the state of the recording; meant to be asked for often.

        When a run has ended its last moment stays, with `state` finished or failed, until the next one begins.
        """
        return live_schema(self._frame())

    async def curves(self) -> LiveCurvesSchema:
        """Give the curves of the last whole revolutions, measured and predicted, as `/live` gives the numbers."""
        return live_curves_schema(self._frame())

    def _frame(self) -> LiveUpdate:
        frame = self._live.latest()
        if frame is None:
            raise ProblemError(ProblemType.NO_LIVE_RUN, "nothing is recorded or replayed now")
        return frame

    async def health(self) -> HealthSchema:
        """Answer at all; `health` says whether data folder and live run are well too."""
        trouble, runs = "", None
        try:
            runs = len(await self._lookup_threads.run(self._catalogue.runs))
        except RecordingError as error:
            trouble = str(error)
        return health_schema(self._version, time.monotonic() - self._made, runs, self._live.latest(), trouble)
