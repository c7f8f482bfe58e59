"""Changing the data folder: words on a run, a run put away, a recording sent in."""

from functools import partial
from pathlib import Path
from typing import Annotated, Final, Protocol

from fastapi import Path as PathParameter
from fastapi import Request, Response

from daq.schemas.runs import RunSchema, run_schema
from daq.service.problem_types import ProblemType
from daq.service.problems import ProblemError
from daq.service.responses import OCTET_STREAM, allows_change, strong_etag
from daq.service.results_reader import ResultsReader
from daq.service.routing import API_PREFIX, BoundedThreadPool, IfMatch, Routing, RunId
from daq.service.schemas.runs import (
    AnnotationRequest,
    RestoreRequest,
    TrashedRunSchema,
    TrashEntrySchema,
    TrashSchema,
)
from daq.service.stream import LiveFeed, require_ended
from daq.service.uploads import UploadReceiver
from recordings.catalogue.catalogue import RunEntry
from recordings.catalogue.trash import TrashedRun
from recordings.errors import NotFoundError, RunExistsError

MAX_RECORDING_SIZE: Final = 64 * 1024**3
BINARY = {"content": {OCTET_STREAM: {"schema": {"type": "string", "format": "binary"}}}, "required": True}


TrashName = Annotated[
    str,
    PathParameter(description="Name in the trash, as /api/v1/trash lists it", examples=["2026-11-24T09-12-07-gj90c"]),
]


class EditableCatalogue(Protocol):
    """A data folder that can be changed."""

    def run(self, run_id: str) -> RunEntry:
        """Return one run; NotFoundError where there is none."""
        ...

    def annotate(self, run_id: str, *, remark: str | None, tags: tuple[str, ...] | None) -> RunEntry:
        """Give a run other words; ValueError where they cannot be."""
        ...

    def move_to_trash(self, run_id: str) -> Path:
        """Move a run into the trash; return where it is."""
        ...

    def trashed_runs(self) -> list[TrashedRun]:
        """Return what lies in the trash."""
        ...

    def restore(self, name: str, run_id: str = "") -> RunEntry:
        """Move a run out of the trash; NotFoundError, RunExistsError."""
        ...

    def path_for(self, run_id: str) -> Path:
        """Return where the file of a run belongs; NotFoundError for no id."""
        ...

    def free_bytes(self) -> int:
        """Return the room left on the disk, bytes."""
        ...


class RunEditRoutes:
    """Changes to the data folder.

    Parameters
    ----------
    catalogue : ChangingCatalogue
        The data folder.
    live : LiveFeed
        The run under way, which is left alone.
    results : ResultsReader
        Who looks through what is sent in.
    """

    def __init__(self, catalogue: EditableCatalogue, live: LiveFeed, results: ResultsReader) -> None:
        self._catalogue = catalogue
        self._live = live
        self._results = results
        self._edit_threads = BoundedThreadPool(threads=1, waiting=16)
        self._incoming = UploadReceiver(catalogue.free_bytes, MAX_RECORDING_SIZE)

    def add_to(self, routing: Routing) -> None:
        """Make the addresses known."""
        changing = (
            ProblemType.RUN_NOT_FOUND,
            ProblemType.INVALID_PARAMETER,
            ProblemType.CROSS_SITE_REQUEST,
            ProblemType.STORAGE_UNAVAILABLE,
            ProblemType.BUSY,
        )
        routing.add(
            "PATCH /runs/{run}",
            self.annotate,
            "annotate_run",
            "runs",
            "Change words and tags of a run",
            *changing,
            ProblemType.PRECONDITION_FAILED,
        )
        routing.add(
            "DELETE /runs/{run}",
            self.move_to_trash,
            "trash_run",
            "runs",
            "Move a run into the trash",
            *changing,
            ProblemType.RUN_UNDER_WAY,
            ProblemType.PRECONDITION_FAILED,
        )
        routing.add("/trash", self.trash, "list_trash", "runs", "List the runs in the trash", *changing[-2:])
        routing.add(
            "POST /trash/{name}/restore",
            self.restore,
            "restore_run",
            "runs",
            "Take a run out of the trash",
            ProblemType.NOT_IN_TRASH,
            ProblemType.RUN_EXISTS,
            *changing,
            status=201,
        )
        routing.add(
            "PUT /runs/{run}/file",
            self.arrive,
            "upload_run",
            "runs",
            "Send a recording in",
            *changing,
            ProblemType.RUN_EXISTS,
            ProblemType.INVALID_RECORDING,
            ProblemType.CONTENT_TOO_LARGE,
            ProblemType.REQUEST_TIMEOUT,
            status=201,
            content=BINARY,
        )

    async def annotate(
        self, run: RunId, words: AnnotationRequest, response: Response, if_match: IfMatch = None
    ) -> RunSchema:
        """Change what is said of the run; it is kept in a file beside the recording, which never changes."""

        def changed() -> RunEntry:
            self._require_meant(run, if_match)
            return self._catalogue.annotate(run, remark=words.remark, tags=words.tags)

        try:
            document = run_schema(await self._edit_threads.run(changed))
        except ValueError as error:
            raise ProblemError(ProblemType.INVALID_PARAMETER, str(error)) from error
        response.headers["ETag"] = strong_etag(document)
        return document

    async def move_to_trash(self, run: RunId, if_match: IfMatch = None) -> TrashedRunSchema:
        """Move the recording into the folder `trash` of the data folder; nothing is deleted."""
        require_ended(self._live, run)

        def moved() -> Path:
            self._require_meant(run, if_match)
            return self._catalogue.move_to_trash(run)

        place = await self._edit_threads.run(moved)
        return TrashedRunSchema(run=run, trash=f"{place.parent.name}/{place.name}", name=place.stem)

    def _require_meant(self, run: str, if_match: str | None) -> None:
        """Raise ProblemError where a run is no longer what a change rests on."""
        if if_match is not None and not allows_change(if_match, strong_etag(run_schema(self._catalogue.run(run)))):
            raise ProblemError(ProblemType.PRECONDITION_FAILED, f"run {run} has changed")

    async def trash(self) -> TrashSchema:
        """List what was put away; nothing is ever deleted by the service."""
        found = await self._edit_threads.run(self._catalogue.trashed_runs)
        return TrashSchema(runs=tuple(TrashEntrySchema(name=each.name, size_bytes=each.size) for each in found))

    async def restore(self, name: TrashName, order: RestoreRequest, response: Response) -> RunSchema:
        """Move a run and what was said of it back into the data folder, never in place of another."""
        try:
            entry = await self._edit_threads.run(partial(self._catalogue.restore, name, order.run or ""))
        except NotFoundError as error:
            raise ProblemError(ProblemType.NOT_IN_TRASH, str(error)) from error
        except RunExistsError as error:
            raise ProblemError(ProblemType.RUN_EXISTS, str(error)) from error
        response.headers["Location"] = f"{API_PREFIX}/runs/{entry.id}"
        return run_schema(entry)

    async def arrive(self, request: Request, run: RunId, response: Response) -> RunSchema:
        """Keep a recording under the id of the address, once it is whole and every checksum in it holds.

        What is there already is never written over, and of what is refused nothing is left.
        """
        place = self._catalogue.path_for(run)
        await self._incoming.receive(request, place, self._results.require_sound)
        response.headers["Location"] = f"{API_PREFIX}/runs/{run}"
        return run_schema(await self._edit_threads.run(partial(self._catalogue.run, run)))
