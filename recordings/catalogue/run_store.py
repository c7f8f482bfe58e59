"""The rows of one data folder in the catalogue's database."""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from sqlalchemy import ColumnElement, Connection, RowMapping, and_, delete, select, update

from analysis.signals.header import RunHeader
from recordings.catalogue.annotations import Annotations
from recordings.catalogue.database import Database
from recordings.catalogue.entry import RunEntry
from recordings.catalogue.run_summary import SummarisedRun
from recordings.catalogue.search import Search, condition
from recordings.catalogue.tables import DOCUMENT, FINDING, MARK, REVISION, RUN, SETUP, TAG
from recordings.errors import DamagedError
from recordings.mcap.header import header_from_json, header_to_json

OWN_KEYS = {"run": "", "started_ns": 0, "note": ""}
"""What of a header is a single run's own; the rest is kept once for all runs that share it."""


@dataclass(frozen=True, slots=True)
class StoredRun:
    """An entry as it is kept.

    Parameters
    ----------
    entry : RunEntry
        The entry.
    remarked_ns : int
        Last change of the annotations in it, ns since 1970; 0 where there were none.
    is_summarised : bool
        Whether what a search needs of its summary is kept too.
    revision : int
        Of the folder's rows when it was read.
    """

    entry: RunEntry
    remarked_ns: int
    is_summarised: bool
    revision: int


class RunStore:
    """Entries of a folder's runs, kept in a database.

    Parameters
    ----------
    folder : Path
        The data folder.
    database : Database
        Where the rows are.
    """

    def __init__(self, folder: Path, database: Database) -> None:
        self._folder = folder
        self._name = str(folder.absolute())
        self._database = database
        self._setups: dict[str, RunHeader] = {}

    def revision(self) -> int:
        """Return a number that rises with every change of the folder's rows, by whomever."""
        with self._database.reading() as connection:
            return self._revision(connection)

    def entries(self, search: Search | None = None, run_id: str = "") -> dict[str, StoredRun]:
        """Return what is kept, newest first, by id: of all runs, of those of a search, or of one."""
        of_folder = RUN.c.folder == self._name
        wanted = and_(of_folder, condition(search)) if search else of_folder
        if run_id:
            wanted = and_(wanted, RUN.c.id == run_id)
        with self._database.reading() as connection:
            revision = self._revision(connection)
            rows = connection.execute(select(RUN).where(wanted).order_by(RUN.c.started_ns.desc(), RUN.c.id.desc()))
            kept = list(rows.mappings())
            self._load_setups(connection, {row["setup"] for row in kept} - {None})
            tags = self._tags(connection, run_id)
        return {
            row["id"]: StoredRun(
                self._entry(row, tags.get(row["id"], ())), row["remarked_ns"], row["is_summarised"], revision
            )
            for row in kept
        }

    def put(self, entries: list[RunEntry]) -> None:
        """Keep entries in place of those before; what was known of files that have changed since is forgotten."""
        if not entries:
            return
        setups, rows = {}, []
        for entry in entries:
            setup = None
            if entry.header is not None:
                document = json.dumps(header_to_json(entry.header) | OWN_KEYS, sort_keys=True)
                setup = hashlib.sha256(document.encode()).hexdigest()
                setups[setup] = document
            rows.append(self._row(entry, setup))
        with self._writing() as connection:
            self._database.put(connection, SETUP, [{"id": key, "document": text} for key, text in setups.items()])
            for entry in entries:  # findings and tags go with it
                connection.execute(delete(RUN).where(self._is(RUN, entry.id)))
            self._database.put(connection, RUN, rows)

    def annotate(self, run_id: str, annotations: Annotations, changed_ns: int) -> None:
        """Keep the words on a run."""
        with self._writing() as connection:
            values = {"remark": annotations.remark, "remarked_ns": changed_ns}
            if connection.execute(update(RUN).where(self._is(RUN, run_id)).values(values)).rowcount:
                connection.execute(delete(TAG).where(self._is(TAG, run_id)))
                rows = [{"folder": self._name, "id": run_id, "tag": tag} for tag in annotations.tags]
                self._database.put(connection, TAG, rows)

    @contextmanager
    def turn(self) -> Iterator[None]:
        """Keep all other writers of the catalogue, in whatever process, waiting."""
        with self._database.writing():
            yield

    def store_verdict(self, run_id: str, verdict: str) -> None:
        """Keep what a verification came to."""
        with self._writing() as connection:
            connection.execute(update(RUN).where(self._is(RUN, run_id)).values(verdict=verdict))

    def summarise(self, found: Iterable[SummarisedRun]) -> None:
        """Keep what was found in runs whose files have not changed since."""
        with self._writing() as connection:
            for one in found:
                entry, key = one.entry, {"folder": self._name, "id": one.entry.id}
                same = and_(self._is(RUN, entry.id), RUN.c.size == entry.size, RUN.c.changed_ns == entry.changed_ns)
                if connection.execute(update(RUN).where(same).values(one.columns())).rowcount:
                    for table, rows in ((FINDING, one.finding_rows()), (MARK, one.marker_rows())):
                        connection.execute(delete(table).where(self._is(table, entry.id)))
                        self._database.put(connection, table, [key | row for row in rows])

    def forget(self, run_ids: list[str]) -> None:
        """Drop what is kept of runs that are gone."""
        with self._writing() as connection:
            for run_id in run_ids:
                connection.execute(delete(DOCUMENT).where(self._is(DOCUMENT, run_id)))
                connection.execute(delete(RUN).where(self._is(RUN, run_id)))

    def load_cached(self, run_id: str, name: str, size: int, changed_ns: int) -> dict[str, Any] | None:
        """Return a document computed from the file of this size and time of change; None where there is none."""
        of_file = and_(DOCUMENT.c.name == name, DOCUMENT.c.size == size, DOCUMENT.c.changed_ns == changed_ns)
        with self._database.reading() as connection:
            text = connection.execute(select(DOCUMENT.c.document).where(self._is(DOCUMENT, run_id), of_file)).scalar()
        try:
            document = None if text is None else json.loads(text)
        except ValueError:
            return None
        return document if isinstance(document, dict) else None

    def store_cached(self, run_id: str, name: str, size: int, changed_ns: int, document: Mapping[str, Any]) -> None:
        """Keep a document computed from the file of this size and time of change."""
        row = {"folder": self._name, "id": run_id, "name": name, "size": size, "changed_ns": changed_ns}
        with self._database.writing() as connection:  # no part of an entry: the revision stays
            self._database.put(connection, DOCUMENT, [row | {"document": json.dumps(document)}])

    @contextmanager
    def _writing(self) -> Iterator[Connection]:
        with self._database.writing() as connection:
            number = self._revision(connection) + 1
            self._database.put(connection, REVISION, [{"folder": self._name, "number": number}])
            yield connection

    def _revision(self, connection: Connection) -> int:
        number = connection.execute(select(REVISION.c.number).where(REVISION.c.folder == self._name)).scalar()
        return 0 if number is None else number

    def _is(self, table: Any, run_id: str) -> ColumnElement[bool]:
        return and_(table.c.folder == self._name, table.c.id == run_id)

    def _row(self, entry: RunEntry, setup: str | None) -> dict[str, Any]:
        header = entry.header
        return {
            "folder": self._name,
            "id": entry.id,
            "size": entry.size,
            "changed_ns": entry.changed_ns,
            "started_ns": entry.started_ns,
            "setup": setup,
            "run": "" if header is None else header.run,
            "rig": "" if header is None else header.rig,
            "note": "" if header is None else header.note,
            "serial": "" if header is None else header.acquisition.device.serial,
            "calibration": entry.calibration,
            "duration_s": entry.duration,
            "samples": entry.samples,
            "is_complete": entry.is_complete,
            "is_gap_free": entry.is_gap_free,
            "fault": entry.fault,
        }

    def _entry(self, row: Mapping[str, Any] | RowMapping, tags: tuple[str, ...]) -> RunEntry:
        setup = self._setups.get(row["setup"])
        header = None
        if setup is not None:
            header = replace(setup, run=row["run"], started_ns=row["started_ns"], note=row["note"])
        return RunEntry(
            id=row["id"],
            path=self._folder / f"{row['id']}.mcap",
            size=row["size"],
            changed_ns=row["changed_ns"],
            header=header,
            duration=row["duration_s"],
            samples=row["samples"],
            is_complete=row["is_complete"],
            is_gap_free=row["is_gap_free"],
            fault=row["fault"],
            remark=row["remark"],
            tags=tags,
            verdict=row["verdict"],
            calibration=row["calibration"],
        )

    def _load_setups(self, connection: Connection, wanted: set[str]) -> None:
        missing = wanted - self._setups.keys()
        if not missing:
            return
        for key, document in connection.execute(select(SETUP.c.id, SETUP.c.document)):
            if key in missing:
                try:
                    self._setups[key] = header_from_json(json.loads(document))
                except (DamagedError, ValueError):  # as good as none: its runs are read again
                    continue

    def _tags(self, connection: Connection, run_id: str) -> dict[str, tuple[str, ...]]:
        wanted = self._is(TAG, run_id) if run_id else TAG.c.folder == self._name
        tags: dict[str, tuple[str, ...]] = {}
        for of_run, tag in connection.execute(select(TAG.c.id, TAG.c.tag).where(wanted).order_by(TAG.c.tag)):
            tags[of_run] = (*tags.get(of_run, ()), tag)
        return tags
