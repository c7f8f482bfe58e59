"""Query parameters of the run list, and schemas for starting, annotating, deleting and restoring runs."""

from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from enum import StrEnum
from typing import Annotated, Final

from pydantic import BeforeValidator, Field

from analysis.signals.units import RPM
from daq.reports.parameters import MAX_SPEED_RPM, QueryParameters
from daq.schemas.runs import RunId
from daq.schemas.units import Schema
from daq.schemas.vibration import OverallRangeQuery
from recordings.catalogue.catalogue import RunEntry
from recordings.catalogue.run_store import Search

NANOSECONDS_PER_SECOND = 1_000_000_000
MAX_TEXT_LENGTH = 200
MAX_NANOSECONDS = 2**62  # ns


class SortOrder(StrEnum):
    """Sort key of the run list; a minus sign sorts in descending order."""

    NEWEST = "-started"
    OLDEST = "started"
    LONGEST = "-duration"
    SHORTEST = "duration"
    LARGEST = "-size"
    SMALLEST = "size"


SORT_KEYS: Final[Mapping[str, Callable[[RunEntry], float]]] = {
    "started": lambda entry: entry.started_ns,
    "duration": lambda entry: entry.duration,
    "size": lambda entry: entry.size,
}


def _with_timezone(value: object) -> object:
    """Return a timestamp with UTC as default zone; numbers are rejected."""
    if isinstance(value, str):
        timestamp = datetime.fromisoformat(value)
        return timestamp if timestamp.tzinfo is not None else timestamp.replace(tzinfo=UTC)
    return value


def _nanoseconds(timestamp: datetime | None) -> int | None:
    """Return ns since 1970, limited to the range of the database."""
    return (
        None
        if timestamp is None
        else max(min(round(timestamp.timestamp() * NANOSECONDS_PER_SECOND), MAX_NANOSECONDS), -MAX_NANOSECONDS)
    )


Text = Annotated[str, Field(max_length=MAX_TEXT_LENGTH, pattern=r"^[^\x00]*$")]
Speed = Annotated[float, Field(ge=0, le=MAX_SPEED_RPM)]
Timestamp = Annotated[datetime, BeforeValidator(_with_timezone)]


class RunQuery(OverallRangeQuery, QueryParameters):
    """Filters, sort order and page of the run list; a run must match all filters."""

    rig: Annotated[str | None, Field(description="Only runs of the rig with this name", examples=["gj90c"])] = None
    complete: Annotated[
        bool | None,
        Field(description="Only runs whose recording is complete (true) or incomplete (false)", examples=[True]),
    ] = None
    device: Annotated[
        Text, Field(description="Only runs of the device with this serial number", examples=["1A2B3C"])
    ] = ""
    calibration: Annotated[
        Text,
        Field(
            description="Only runs with this `calibration` id of their probes, or with its first digits",
            examples=["5d41"],
        ),
    ] = ""
    since: Annotated[
        Timestamp | None,
        Field(description="Started at or after, UTC unless it names its zone", examples=["2026-11-24T09:00:00Z"]),
    ] = None
    before: Annotated[
        Timestamp | None,
        Field(description="Started before, UTC unless it names its zone", examples=["2026-11-25T09:00:00Z"]),
    ] = None
    speed_from_rpm: Annotated[
        Speed | None, Field(description="Only runs that reached a speed at or above this, r/min", examples=[9000.0])
    ] = None
    speed_to_rpm: Annotated[
        Speed | None, Field(description="Only runs that had a speed at or below this, r/min", examples=[12_000.0])
    ] = None
    text: Annotated[
        Text, Field(description="Words that must all occur in id, rig, note, remark or markers", examples=["oil"])
    ] = ""
    tag: Annotated[
        tuple[Text, ...],
        Field(description="Only runs with this tag; may be repeated", max_length=10, examples=[["good"]]),
    ] = ()
    onset_below_rpm: Annotated[
        Speed | None,
        Field(description="Only runs with a sub-synchronous onset below this speed, r/min", examples=[11_000.0]),
    ] = None
    sort: Annotated[SortOrder, Field(description="Sort order", examples=["-started"])] = SortOrder.NEWEST
    limit: Annotated[int, Field(description="Maximum number of runs", ge=1, le=200, examples=[20])] = 20
    offset: Annotated[int, Field(description="Number of runs to skip", ge=0, le=10_000_000, examples=[0])] = 0

    def search(self) -> Search:
        """Return the catalogue search of the filters."""
        return Search(
            started_from_ns=_nanoseconds(self.since),
            started_before_ns=_nanoseconds(self.before),
            speed_low=None if self.speed_from_rpm is None else self.speed_from_rpm * RPM,
            speed_high=None if self.speed_to_rpm is None else self.speed_to_rpm * RPM,
            overall=self.overall_ranges(),
            text=self.text,
            tags=self.tag,
            onset_below=None if self.onset_below_rpm is None else self.onset_below_rpm * RPM,
            serial=self.device,
            calibration=self.calibration,
        )

    def matching(self, entries: Sequence[RunEntry]) -> list[RunEntry]:
        """Return the runs of the requested rig and state, sorted."""
        matching = [entry for entry in entries if self._matches(entry)]
        if self.sort is SortOrder.NEWEST:  # the catalogue's order
            return matching
        key = SORT_KEYS[self.sort.removeprefix("-")]
        return sorted(matching, key=lambda entry: (key(entry), entry.id), reverse=self.sort.startswith("-"))

    def _matches(self, entry: RunEntry) -> bool:
        rig = None if entry.header is None else entry.header.rig
        return self.rig in (None, rig) and self.complete in (None, entry.is_complete)


class AnnotationRequest(Schema):
    """Remark and tags of a run; a field that is left out or null is not changed."""

    remark: str | None = Field(
        None,
        description="Remark on the run; replaces the previous one",
        max_length=10_000,
        examples=["bearing changed"],
    )
    tags: tuple[Annotated[str, Field(max_length=64)], ...] | None = Field(
        None, description="All tags; replaces the previous ones. Printable, without leading or trailing spaces",
        max_length=100, examples=[["reference"]],
    )  # fmt: skip


class TrashedRunSchema(Schema):
    """A run that was moved into the trash."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    trash: str = Field(
        description="Its file, relative to the data folder; the run can be restored",
        examples=["trash/2026-11-24T09-12-07-gj90c.mcap"],
    )
    name: str = Field(description="Its name in the trash", examples=["2026-11-24T09-12-07-gj90c"])


class TrashEntrySchema(Schema):
    """A run in the trash."""

    name: str = Field(
        description="Its id, with a number if the trash already had a run of this id",
        examples=["2026-11-24T09-12-07-gj90c (2)"],
    )
    size_bytes: int = Field(description="Size of its file, bytes", ge=0, examples=[154_000_000])


class TrashSchema(Schema):
    """The runs in the trash."""

    runs: tuple[TrashEntrySchema, ...] = Field(description="Sorted by name")


class RestoreRequest(Schema):
    """Id of the restored run."""

    run: str | None = Field(
        None, description="New id; null: its name in the trash", max_length=200, examples=["2026-11-24T09-12-07-gj90c"]
    )


class StartRequest(Schema):
    """Request to start a run."""

    rig: str | None = Field(
        None, description="Name of the rig that the service was started with; null does not check it",
        max_length=200, examples=["gj90c"],
    )  # fmt: skip
    note: str = Field("", description="The operator's note", max_length=2000, examples=["after the oil change"])
    duration_s: float | None = Field(
        None, description="Duration after which the run ends, s of samples; null: until it is stopped",
        strict=True, gt=0, le=1e6, examples=[300.0],
    )  # fmt: skip


class StartedRunSchema(Schema):
    """A run that has started."""

    run: RunId
    rig: str = Field(description="Name of the rig", examples=["gj90c"])
    started_at: datetime = Field(description="Wall clock at the start, UTC", examples=["2026-11-24T09:12:07.250000Z"])
