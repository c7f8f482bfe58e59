"""Changing the data folder: words on a run, a run put away, a recording sent in."""

from functools import partial
from pathlib import Path
from typing import Final, Protocol

from fastapi import Request, Response

from daq.service.documents import RunDocument, run_document
from daq.service.documents.change import PutAwayDocument, WordsDocument
from daq.service.file_answers import OCTETS
from daq.service.incoming import Incoming
from daq.service.kinds import Kind
from daq.service.live_run import Live, require_ended
from daq.service.problems import ProblemError
from daq.service.readings import Readings
from daq.service.routing import Routing, RunId
from daq.service.workers import Workers
from recordings.catalogue import RunEntry

MOST_BYTES: Final = 64 * 1024**3
BINARY = {"content": {OCTETS: {"schema": {"type": "string", "format": "binary"}}}, "required": True}


class ChangingCatalogue(Protocol):
    """A data folder that can be changed."""

    def run(self, run_id: str) -> RunEntry:
        """Return one run; NotFoundError where there is none."""
        ...

    def annotate(self, run_id: str, *, remark: str | None, tags: tuple[str, ...] | None) -> RunEntry:
        """Give a run other words; ValueError where they cannot be."""
        ...

    def put_away(self, run_id: str) -> Path:
        """Move a run into the trash; return where it is."""
        ...

    def place_for(self, run_id: str) -> Path:
        """Return where the file of a run belongs; NotFoundError for no id."""
        ...

    def free_bytes(self) -> int:
        """Return the room left on the disk, bytes."""
        ...


class ChangeRoutes:
    """Changes to the data folder.

    Parameters
    ----------
    catalogue : ChangingCatalogue
        The data folder.
    live : Live
        The run under way, which is left alone.
    readings : Readings
        Who looks through what is sent in.
    """

    def __init__(self, catalogue: ChangingCatalogue, live: Live, readings: Readings) -> None:
        self._catalogue = catalogue
        self._live = live
        self._readings = readings
        self._changes = Workers(threads=1, waiting=16)
        self._incoming = Incoming(catalogue.free_bytes, MOST_BYTES)

    def add_to(self, routing: Routing) -> None:
        """Make the addresses known."""
        changing = (Kind.RUN_NOT_FOUND, Kind.BAD_PARAMETER, Kind.CROSS_SITE, Kind.STORAGE_UNAVAILABLE, Kind.BUSY)
        routing.add(
            "PATCH /runs/{run}", self.annotate, "annotate_run", "runs", "Change words and tags of a run",
            *changing,
        )  # fmt: skip
        routing.add(
            "DELETE /runs/{run}", self.put_away, "put_run_away", "runs", "Move a run into the trash",
            *changing, Kind.RUN_UNDER_WAY,
        )  # fmt: skip
        routing.add(
            "PUT /runs/{run}/file", self.arrive, "send_run", "runs", "Send a recording in",
            *changing, Kind.RUN_EXISTS, Kind.NO_RECORDING, Kind.TOO_LARGE, Kind.TOO_SLOW, status=201, content=BINARY,
        )  # fmt: skip

    async def annotate(self, run: RunId, words: WordsDocument) -> RunDocument:
        """Change what is said of the run; it is kept in a file beside the recording, which never changes."""
        try:
            entry = await self._changes.run(
                partial(self._catalogue.annotate, run, remark=words.remark, tags=words.tags)
            )
        except ValueError as error:
            raise ProblemError(Kind.BAD_PARAMETER, str(error)) from error
        return run_document(entry)

    async def put_away(self, run: RunId) -> PutAwayDocument:
        """Move the recording into the folder `trash` of the data folder; nothing is deleted."""
        require_ended(self._live, run)
        place = await self._changes.run(partial(self._catalogue.put_away, run))
        return PutAwayDocument(run=run, trash=f"{place.parent.name}/{place.name}")

    async def arrive(self, request: Request, run: RunId, response: Response) -> RunDocument:
        """Keep a recording under the id of the address, once it is whole and every checksum in it holds.

        What is there already is never written over, and of what is refused nothing is left.
        """
        place = self._catalogue.place_for(run)
        await self._incoming.take(request, place, self._readings.require_whole)
        response.headers["Location"] = f"/api/v1/runs/{run}"
        return run_document(await self._changes.run(partial(self._catalogue.run, run)))
