"""The addresses under /api/v1: what they answer and how they can fail."""

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated, Any, Protocol

from fastapi import APIRouter, Path, Query
from pydantic import BaseModel, ConfigDict, Field

from daq.service.documents import (
    HealthDocument,
    LiveDocument,
    PictureDocument,
    RunDocument,
    RunListDocument,
    SummaryDocument,
    health_document,
    live_document,
    picture_document,
    run_document,
    run_list_document,
)
from daq.service.problems import (
    BAD_PARAMETER,
    BUSY,
    HOST,
    INTERNAL,
    NO_LIVE_RUN,
    RUN_DAMAGED,
    RUN_FORMAT,
    RUN_NOT_FOUND,
    RUN_UNDER_WAY,
    STORAGE,
    TOKEN,
    Kind,
    ProblemError,
    openapi_responses,
)
from daq.service.workers import Workers
from daq.session.frame import LiveFrame
from recordings.catalogue import RunEntry
from recordings.errors import RecordingError

PREFIX = "/api/v1"


class Catalogue(Protocol):
    """The runs of a data folder."""

    def runs(self) -> Sequence[RunEntry]:
        """Return all runs, newest first."""
        ...

    def run(self, run_id: str) -> RunEntry:
        """Return one run; NotFoundError where there is none, whatever its id looks like."""
        ...


class Live(Protocol):
    """The run that is under way."""

    def latest(self) -> LiveFrame | None:
        """Return its latest moment at once; None where there is no run."""
        ...


class Summaries(Protocol):
    """What runs were."""

    def summary(self, run_id: str) -> SummaryDocument:
        """Return a run's summary; it may read the whole recording. RecordingError where it cannot be read."""
        ...


class RunQuery(BaseModel):
    """Which runs are asked for."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    rig: Annotated[str | None, Field(description="Only runs of the rig of this name", examples=["gj90c"])] = None
    complete: Annotated[
        bool | None, Field(description="Only runs whose recording is whole (true) or is not (false)", examples=[True])
    ] = None
    limit: Annotated[int, Field(description="At most so many runs", ge=1, le=200, examples=[20])] = 20
    offset: Annotated[int, Field(description="So many of the newest runs are passed over", ge=0, examples=[0])] = 0


RunId = Annotated[
    str, Path(description="Id of the run, as /api/v1/runs lists it", examples=["2026-11-24T09-12-07-gj90c"])
]


class Routes:
    """The answers; whatever reads files does so in threads, never on the event loop.

    Parameters
    ----------
    catalogue : Catalogue
        The recorded runs.
    live : Live
        The run under way.
    summaries : Summaries
        What runs were.
    version : str
        Of the service.
    """

    def __init__(self, catalogue: Catalogue, live: Live, summaries: Summaries, version: str) -> None:
        self._catalogue = catalogue
        self._live = live
        self._summaries = summaries
        self._version = version
        self._made = time.monotonic()
        self._lookups = Workers(threads=4, waiting=32)
        self._readings = Workers(threads=2, waiting=16)

    def router(self, *, with_token: bool) -> APIRouter:
        """Return the routes for an application; ``with_token`` tells clients of the token in the schema."""
        router = APIRouter(prefix=PREFIX)
        always = (HOST, INTERNAL, *((TOKEN,) if with_token else ()))
        add = partial(self._add, router, always)
        add("/runs", self.runs, "list_runs", "runs", "List the runs, newest first", BAD_PARAMETER, STORAGE, BUSY)
        add("/runs/{run}", self.run, "get_run", "runs", "One run", RUN_NOT_FOUND, BAD_PARAMETER, STORAGE, BUSY)
        add(
            "/runs/{run}/summary", self.summary, "get_run_summary", "runs", "What a run was",
            RUN_NOT_FOUND, BAD_PARAMETER, RUN_UNDER_WAY, RUN_DAMAGED, RUN_FORMAT, STORAGE, BUSY,
        )  # fmt: skip
        add("/live", self.live, "get_live", "live", "The run under way, at this moment", NO_LIVE_RUN)
        add("/live/picture", self.picture, "get_live_picture", "live", "Orbit and order spectrum now", NO_LIVE_RUN)
        add("/health", self.health, "get_health", "service", "Whether the service is well", BUSY)
        return router

    @staticmethod
    def _add(
        router: APIRouter, always: tuple[Kind, ...], path: str, endpoint: Callable[..., Any], name: str, tag: str,
        summary: str, *kinds: Kind,
    ) -> None:  # fmt: skip
        router.add_api_route(
            path,
            endpoint,
            operation_id=name,
            tags=[tag],
            summary=summary,
            response_description=summary,
            responses=openapi_responses(*kinds, *always),
        )

    async def runs(self, query: Annotated[RunQuery, Query()]) -> RunListDocument:
        """List the data folder: runs under way or cut short too, with `is_complete` false."""
        entries = await self._lookups.run(self._catalogue.runs)
        chosen = [entry for entry in entries if _is_asked_for(entry, query)]
        return run_list_document(chosen[query.offset :][: query.limit], len(chosen), query.limit, query.offset)

    async def run(self, run: RunId) -> RunDocument:
        """Answers from the recording's header and end alone, in milliseconds."""
        return run_document(await self._lookups.run(partial(self._catalogue.run, run)))

    async def summary(self, run: RunId) -> SummaryDocument:
        """Speeds, amplitudes, phases, sub-synchronous components, losses, and the agreement with the model.

        A summary that was not made when the run ended is made now from the whole recording, which takes a while.
        """
        frame = self._live.latest()
        if frame is not None and frame.header.run == run and frame.status.state.is_under_way:
            raise ProblemError(RUN_UNDER_WAY, f"run {run} is still {frame.status.state.value}")
        return await self._readings.run(partial(self._summaries.summary, run))

    async def live(self) -> LiveDocument:
        """Measured values, the model's beside them, and the state of the recording; meant to be asked for often.

        When a run has ended its last moment stays, with `state` finished or failed, until the next one begins.
        """
        return live_document(self._frame())

    async def picture(self) -> PictureDocument:
        """Give the curves of the last whole revolutions, measured and predicted, as `/live` gives the numbers."""
        return picture_document(self._frame())

    def _frame(self) -> LiveFrame:
        frame = self._live.latest()
        if frame is None:
            raise ProblemError(NO_LIVE_RUN, "nothing is recorded or replayed now")
        return frame

    async def health(self) -> HealthDocument:
        """Answer at all; `health` says whether data folder and live run are well too."""
        trouble, runs = "", None
        try:
            runs = len(await self._lookups.run(self._catalogue.runs))
        except RecordingError as error:
            trouble = str(error)
        return health_document(self._version, time.monotonic() - self._made, runs, self._live.latest(), trouble)


def _is_asked_for(entry: RunEntry, query: RunQuery) -> bool:
    rig = None if entry.header is None else entry.header.rig
    return query.rig in (None, rig) and query.complete in (None, entry.is_complete)
