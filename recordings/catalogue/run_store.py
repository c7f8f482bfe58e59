"""Rows of one data folder in the catalogue's database: entries, summaries, tags, cached results; search."""

import hashlib
import json
import math
import operator
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sqlalchemy import (
    ColumnElement,
    Connection,
    RowMapping,
    Table,
    and_,
    delete,
    exists,
    insert,
    or_,
    select,
    update,
)

from analysis.signals.header import RunHeader
from analysis.signals.snapshot import LARGEST_OVERALL
from analysis.signals.units import MICROMETRE, RPM
from recordings.catalogue.database import CACHED, FINDING, MARKER, REVISION, RUN, SETUP, TAG, Database
from recordings.catalogue.entry import Annotations, CachedRun, RunEntry
from recordings.errors import DamagedError
from recordings.mcap.header import header_from_json, to_json
from recordings.mcap.results import Marker

if TYPE_CHECKING:  # imports scipy, for which listing runs need not wait
    from analysis.live.summary import RunSummary


@dataclass(frozen=True, slots=True)
class Search:
    """Search criteria; a run must meet all that are given.

    Only runs that are indexed with their summary have speeds and findings.

    Parameters
    ----------
    started_from_ns, started_before_ns : int or None
        Start of the run, ns since 1970: from, and before.
    speed_low, speed_high : float or None
        The run reached a speed within this range, rad/s.
    text : str
        Words that must all occur in id, rig, note, remark or markers, in any case.
    tags : tuple of str
        Tags that the run must all have.
    overall : tuple of (str, float, float)
        Names of measures `OVERALL`, and the range of their largest value in the run, m.
    onset_below : float or None
        A sub-synchronous component began below this speed, rad/s.
    is_complete : bool or None
        Whether the run was finished properly.
    rig : str
        Name of the rig.
    serial : str
        Serial number of the device.
    calibration : str
        `calibration_identity` of the probes' calibrations, or its first digits.
    """

    started_from_ns: int | None = None
    started_before_ns: int | None = None
    speed_low: float | None = None
    speed_high: float | None = None
    text: str = ""
    tags: tuple[str, ...] = ()
    overall: tuple[tuple[str, float, float], ...] = ()
    onset_below: float | None = None
    is_complete: bool | None = None
    rig: str = ""
    serial: str = ""
    calibration: str = ""


def search_condition(search: Search) -> ColumnElement[bool]:
    """Return the criteria as an SQL condition on a row of the run table."""
    comparisons = (
        (RUN.c.started_ns, operator.ge, search.started_from_ns),
        (RUN.c.started_ns, operator.lt, search.started_before_ns),
        (RUN.c.highest_speed_rpm, operator.ge, _rpm(search.speed_low)),
        (RUN.c.lowest_speed_rpm, operator.le, _rpm(search.speed_high)),
        (RUN.c.is_complete, operator.eq, search.is_complete),
        (RUN.c.rig, operator.eq, search.rig or None),
        (RUN.c.serial, operator.eq, search.serial or None),
    )
    terms = [compare(column, value) for column, compare, value in comparisons if value is not None]
    terms += [term for name, low, high in search.overall for term in _overall_terms(name, low, high)]
    terms.append(RUN.c.calibration.startswith(search.calibration, autoescape=True))
    text_columns = (RUN.c.id, RUN.c.rig, RUN.c.note, RUN.c.remark)
    for word in search.text.split():
        in_markers = _has_row(MARKER, MARKER.c.text.icontains(word, autoescape=True))
        terms.append(or_(in_markers, *(column.icontains(word, autoescape=True) for column in text_columns)))
    terms += [_has_row(TAG, TAG.c.tag == tag) for tag in search.tags]
    if search.onset_below is not None:
        terms.append(_has_row(FINDING, FINDING.c.onset_rpm < _rpm(search.onset_below)))
    return and_(*terms)


def _rpm(speed: float | None) -> float | None:
    return None if speed is None else speed / RPM


def _has_row(table: Table, condition: ColumnElement[bool]) -> ColumnElement[bool]:
    """Return whether another table has a row of the run that meets a condition."""
    return exists().where(table.c.folder == RUN.c.folder, table.c.id == RUN.c.id, condition)


PER_RUN_KEYS = {"run": "", "started_ns": 0, "note": ""}
"""Header keys that differ from run to run; the rest is stored once for all runs that share it."""


SummarisedRun = tuple[RunEntry, "RunSummary", tuple[Marker, ...]]
"""A run, with the state of its file when it was read, its summary and its markers."""


class RunStore:
    """Entries of the runs of a data folder in the catalogue's database.

    Parameters
    ----------
    folder : Path
        The data folder.
    database : Database
        The database.
    """

    def __init__(self, folder: Path, database: Database) -> None:
        self._folder = folder
        self._name = str(folder.absolute())
        self._database = database
        self._setups: dict[str, RunHeader] = {}

    def revision(self) -> int:
        """Return the folder's revision: a number that increases with every change of its rows, by any process."""
        with self._database.reading() as connection:
            return self._revision(connection)

    def entries(self, search: Search | None = None, run_id: str = "") -> dict[str, CachedRun]:
        """Return the stored runs by id, newest first: all, those that match a search, or the one of an id."""
        is_wanted = RUN.c.folder == self._name
        if search is not None:
            is_wanted = and_(is_wanted, search_condition(search))
        if run_id:
            is_wanted = and_(is_wanted, RUN.c.id == run_id)
        with self._database.reading() as connection:
            revision = self._revision(connection)
            selected = select(RUN).where(is_wanted).order_by(RUN.c.started_ns.desc(), RUN.c.id.desc())
            rows = list(connection.execute(selected).mappings())
            self._load_setups(connection, {row["setup"] for row in rows} - {None})
            tags = self._tags(connection, run_id)
        return {
            row["id"]: CachedRun(
                self._entry(row, tags[row["id"]]), row["annotations_modified_ns"], revision, row["is_summarised"]
            )
            for row in rows
        }

    def store_entries(self, entries: list[RunEntry]) -> None:
        """Store entries in place of earlier ones; the summaries, findings and tags of those are deleted."""
        if not entries:
            return
        setups, rows = {}, []
        for entry in entries:
            setup = None
            if entry.header is not None:
                shared = json.dumps(to_json(entry.header) | PER_RUN_KEYS, sort_keys=True)
                setup = hashlib.sha256(shared.encode()).hexdigest()
                setups[setup] = shared
            rows.append(self._row(entry, setup))
        with self._writing() as connection:
            for entry in entries:  # deletes findings and tags with the row
                connection.execute(delete(RUN).where(self._is(RUN, entry.id)))
            _insert(connection, RUN, rows)
            known = set(connection.execute(select(SETUP.c.id)).scalars())
            _insert(connection, SETUP, [{"id": key, "document": setups[key]} for key in setups.keys() - known])

    def annotate(self, run_id: str, annotations: Annotations, modified_ns: int) -> None:
        """Store the annotations of a run, with the modification time of their file, ns since 1970."""
        with self._writing() as connection:
            values = {"remark": annotations.remark, "annotations_modified_ns": modified_ns}
            if connection.execute(update(RUN).where(self._is(RUN, run_id)).values(values)).rowcount:
                self._replace(connection, TAG, run_id, [{"tag": tag} for tag in annotations.tags])

    @contextmanager
    def writer_lock(self) -> Iterator[None]:
        """Hold the catalogue's write lock: all other writers, in any process, wait."""
        with self._database.writing():
            yield

    def store_verdict(self, run_id: str, verdict: str) -> None:
        """Store the verdict of a verification."""
        with self._writing() as connection:
            connection.execute(update(RUN).where(self._is(RUN, run_id)).values(verdict=verdict))

    def store_summaries(self, runs: Sequence[SummarisedRun]) -> None:
        """Store summaries and markers of runs; a run whose file has changed since it was read is left out."""
        if not runs:
            return
        with self._writing() as connection:
            for entry, summary, markers in runs:
                columns = {
                    "is_summarised": True,
                    "lowest_speed_rpm": _finite(summary.lowest_speed / RPM),
                    "highest_speed_rpm": _finite(summary.highest_speed / RPM),
                    **{
                        row.full_name: _finite(row.shown(value))
                        for row, value in zip(LARGEST_OVERALL.rows, summary.largest, strict=True)
                    },
                    "severity": summary.severity.value,
                }
                findings = [
                    {
                        "number": number,
                        "order": whirl.order,
                        "is_forward": whirl.is_forward,
                        "onset_rpm": whirl.onset.speed / RPM,
                        "end_rpm": whirl.end.speed / RPM,
                        "largest_peak_um": whirl.amplitude / MICROMETRE,
                    }
                    for number, whirl in enumerate(summary.whirls)
                    if math.isfinite(whirl.onset.speed) and math.isfinite(whirl.end.speed)
                ]
                notes = [
                    {"number": number, "segment": marker.segment, "sample": marker.sample, "text": marker.text}
                    for number, marker in enumerate(markers)
                ]
                is_same = and_(
                    self._is(RUN, entry.id), RUN.c.size == entry.size, RUN.c.modified_ns == entry.modified_ns
                )
                if connection.execute(update(RUN).where(is_same).values(columns)).rowcount:
                    self._replace(connection, FINDING, entry.id, findings)
                    self._replace(connection, MARKER, entry.id, notes)

    def delete_runs(self, run_ids: list[str]) -> None:
        """Delete all rows of runs whose files are gone."""
        with self._writing() as connection:
            for run_id in run_ids:
                connection.execute(delete(CACHED).where(self._is(CACHED, run_id)))
                connection.execute(delete(RUN).where(self._is(RUN, run_id)))

    def load_cached(self, run_id: str, name: str, size: int, modified_ns: int) -> dict[str, Any] | None:
        """Return a result cached for the file of this size and modification time; None if there is none."""
        of_file = and_(CACHED.c.name == name, CACHED.c.size == size, CACHED.c.modified_ns == modified_ns)
        with self._database.reading() as connection:
            text = connection.execute(select(CACHED.c.document).where(self._is(CACHED, run_id), of_file)).scalar()
        try:
            result = None if text is None else json.loads(text)
        except json.JSONDecodeError:
            return None
        return result if isinstance(result, dict) else None

    def store_cached(self, run_id: str, name: str, size: int, modified_ns: int, result: Mapping[str, Any]) -> None:
        """Cache a result computed from the file of this size and modification time."""
        row = {"name": name, "size": size, "modified_ns": modified_ns, "document": json.dumps(result)}
        with self._database.writing() as connection:  # no part of an entry, so the revision stays
            self._replace(connection, CACHED, run_id, [row], CACHED.c.name == name)

    @contextmanager
    def _writing(self) -> Iterator[Connection]:
        """Yield a writing connection that increments the revision."""
        with self._database.writing() as connection:
            number = self._revision(connection) + 1
            connection.execute(delete(REVISION).where(REVISION.c.folder == self._name))
            _insert(connection, REVISION, [{"folder": self._name, "number": number}])
            yield connection

    def _revision(self, connection: Connection) -> int:
        number = connection.execute(select(REVISION.c.number).where(REVISION.c.folder == self._name)).scalar()
        return 0 if number is None else number

    def _replace(
        self, connection: Connection, table: Table, run_id: str, rows: list[dict[str, Any]], *where: ColumnElement[bool]
    ) -> None:
        """Replace the rows of a run in a table."""
        connection.execute(delete(table).where(self._is(table, run_id), *where))
        _insert(connection, table, [{"folder": self._name, "id": run_id} | row for row in rows])

    def _is(self, table: Table, run_id: str) -> ColumnElement[bool]:
        return and_(table.c.folder == self._name, table.c.id == run_id)

    def _row(self, entry: RunEntry, setup: str | None) -> dict[str, Any]:
        header = entry.header
        return {
            "folder": self._name,
            "id": entry.id,
            "size": entry.size,
            "modified_ns": entry.modified_ns,
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
            modified_ns=row["modified_ns"],
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
            largest=_largest(row) if row["is_summarised"] else None,
        )

    def _load_setups(self, connection: Connection, keys: set[str]) -> None:
        """Load the shared header parts of these keys into memory."""
        missing = keys - self._setups.keys()
        rows = connection.execute(select(SETUP.c.id, SETUP.c.document)) if missing else ()
        for key, text in rows:
            if key in missing:
                with suppress(DamagedError, json.JSONDecodeError):  # its runs are read from their files again
                    self._setups[key] = header_from_json(json.loads(text))

    def _tags(self, connection: Connection, run_id: str) -> dict[str, tuple[str, ...]]:
        is_wanted = self._is(TAG, run_id) if run_id else TAG.c.folder == self._name
        tags: dict[str, tuple[str, ...]] = defaultdict(tuple)
        for tagged_id, tag in connection.execute(select(TAG.c.id, TAG.c.tag).where(is_wanted).order_by(TAG.c.tag)):
            tags[tagged_id] += (tag,)
        return tags


def _overall_terms(name: str, low: float, high: float) -> Iterator[ColumnElement[bool]]:
    """Yield the conditions for a range of the largest overall vibration by a measure, m."""
    measure = next(row for row in LARGEST_OVERALL.rows if row.name == f"largest_{name}")
    yield RUN.c[measure.full_name] >= measure.shown(low)
    if math.isfinite(high):
        yield RUN.c[measure.full_name] <= measure.shown(high)


def _largest(row: Mapping[str, Any] | RowMapping) -> tuple[float, ...]:
    """Return the largest overall vibration by the measures `OVERALL`, NaN where unknown."""
    values = [(measure, row[measure.full_name]) for measure in LARGEST_OVERALL.rows]
    return tuple(math.nan if value is None else value * measure.scale for measure, value in values)


def _insert(connection: Connection, table: Table, rows: list[dict[str, Any]]) -> None:
    if rows:
        connection.execute(insert(table), rows)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
