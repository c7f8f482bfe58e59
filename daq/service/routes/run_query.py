"""Query parameters of the run list: filters, sort order and page."""

from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from enum import StrEnum
from typing import Annotated, Final

from pydantic import BeforeValidator, Field

from analysis.signals.units import RPM
from daq.reports.parameters import MAX_SPEED_RPM, QueryParameters
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
        Field(description="TriggerStart at or after, UTC unless it names its zone", examples=["2026-11-24T09:00:00Z"]),
    ] = None
    before: Annotated[
        Timestamp | None,
        Field(description="TriggerStart before, UTC unless it names its zone", examples=["2026-11-25T09:00:00Z"]),
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
