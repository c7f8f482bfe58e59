"""Routes that edit the data folder: annotate, delete, restore and upload runs."""

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
RECORDING_BODY = {"content": {OCTET_STREAM: {"schema": {"type": "string", "format": "binary"}}}, "required": True}


TrashName = Annotated[
    str,
    PathParameter(description="Name in the trash, from /api/v1/trash", examples=["2026-11-24T09-12-07-gj90c"]),
]


class EditableCatalogue(Protocol):
    """A catalogue whose runs can be edited."""

    def run(self, run_id: str) -> RunEntry:
        """Return one run; NotFoundError if there is none."""
        ...

    def annotate(self, run_id: str, *, remark: str | None, tags: tuple[str, ...] | None) -> RunEntry:
        """Change a run's remark and tags; ValueError if they are invalid."""
        ...

    def move_to_trash(self, run_id: str) -> Path:
        """Move a run into the trash; return its new path."""
        ...

    def trashed_runs(self) -> list[TrashedRun]:
        """Return the runs in the trash."""
        ...

    def restore(self, name: str, run_id: str = "") -> RunEntry:
        """Move a run out of the trash; NotFoundError, RunExistsError."""
        ...

    def path_for(self, run_id: str) -> Path:
        """Return the path of a run's file; NotFoundError if the id is invalid."""
        ...

    def free_bytes(self) -> int:
        """Return the free disk space, bytes."""
        ...


class RunEditRoutes:
    """Routes that edit runs of the data folder.

    Parameters
    ----------
    catalogue : EditableCatalogue
        The data folder.
    live : LiveFeed
        The current run, which cannot be edited.
    results : ResultsReader
        Checks uploaded recordings.
    """

    def __init__(self, catalogue: EditableCatalogue, live: LiveFeed, results: ResultsReader) -> None:
        self._catalogue = catalogue
        self._live = live
        self._results = results
        self._edit_threads = BoundedThreadPool(threads=1, waiting=16)
        self._receiver = UploadReceiver(catalogue.free_bytes, MAX_RECORDING_SIZE)

    def add_to(self, routing: Routing) -> None:
        """Add the routes."""
        edit_problems = (
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
            "Change a run's remark and tags",
            *edit_problems,
            ProblemType.PRECONDITION_FAILED,
        )
        routing.add(
            "DELETE /runs/{run}",
            self.move_to_trash,
            "delete_run",
            "runs",
            "Move a run into the trash",
            *edit_problems,
            ProblemType.RUN_UNDER_WAY,
            ProblemType.PRECONDITION_FAILED,
        )
        routing.add("/trash", self.trash, "list_trash", "runs", "List the runs in the trash", *edit_problems[-2:])
        routing.add(
            "POST /trash/{name}/restore",
            self.restore,
            "restore_run",
            "runs",
            "Restore a run from the trash",
            ProblemType.NOT_IN_TRASH,
            ProblemType.RUN_EXISTS,
            *edit_problems,
            status=201,
        )
        routing.add(
            "PUT /runs/{run}/file",
            self.upload,
            "upload_run",
            "runs",
            "Upload a recording",
            *edit_problems,
            ProblemType.RUN_EXISTS,
            ProblemType.INVALID_RECORDING,
            ProblemType.CONTENT_TOO_LARGE,
            ProblemType.REQUEST_TIMEOUT,
            status=201,
            content=RECORDING_BODY,
        )

    async def annotate(
        self, run: RunId, annotation: AnnotationRequest, response: Response, if_match: IfMatch = None
    ) -> RunSchema:
        """Change the run's remark and tags, stored in a file beside the recording, which is not changed."""

        def annotate_run() -> RunEntry:
            self._check_if_match(run, if_match)
            return self._catalogue.annotate(run, remark=annotation.remark, tags=annotation.tags)

        schema = run_schema(await self._edit_threads.run(annotate_run))
        response.headers["ETag"] = strong_etag(schema)
        return schema

    async def move_to_trash(self, run: RunId, if_match: IfMatch = None) -> TrashedRunSchema:
        """Move the recording into the folder `trash` of the data folder; nothing is deleted."""
        require_ended(self._live, run)

        def move() -> Path:
            self._check_if_match(run, if_match)
            return self._catalogue.move_to_trash(run)

        path = await self._edit_threads.run(move)
        return TrashedRunSchema(run=run, trash=f"{path.parent.name}/{path.name}", name=path.stem)

    def _check_if_match(self, run: str, if_match: str | None) -> None:
        """Raise ProblemError if a run has changed since the version in If-Match."""
        if if_match is not None and not allows_change(if_match, strong_etag(run_schema(self._catalogue.run(run)))):
            raise ProblemError(ProblemType.PRECONDITION_FAILED, f"run {run} has changed")

    async def trash(self) -> TrashSchema:
        """List the runs in the trash; the service never deletes them permanently."""
        trashed = await self._edit_threads.run(self._catalogue.trashed_runs)
        return TrashSchema(runs=tuple(TrashEntrySchema(name=each.name, size_bytes=each.size) for each in trashed))

    async def restore(self, name: TrashName, request: RestoreRequest, response: Response) -> RunSchema:
        """Move a run and its annotations back into the data folder; an existing run is never replaced."""
        try:
            entry = await self._edit_threads.run(partial(self._catalogue.restore, name, request.run or ""))
        except NotFoundError as error:
            raise ProblemError(ProblemType.NOT_IN_TRASH, str(error)) from error
        except RunExistsError as error:
            raise ProblemError(ProblemType.RUN_EXISTS, str(error)) from error
        response.headers["Location"] = f"{API_PREFIX}/runs/{entry.id}"
        return run_schema(entry)

    async def upload(self, request: Request, run: RunId, response: Response) -> RunSchema:
        """Store a recording under the path's id once it is complete and all its checksums are correct.

        An existing run is never overwritten, and nothing of a rejected recording is left.
        """
        path = self._catalogue.path_for(run)
        await self._receiver.receive(request, path, self._results.require_sound)
        response.headers["Location"] = f"{API_PREFIX}/runs/{run}"
        return run_schema(await self._edit_threads.run(partial(self._catalogue.run, run)))
