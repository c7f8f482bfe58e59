"""Which runs are asked for, and in which order."""

import math
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from enum import StrEnum
from typing import Annotated, Final

from pydantic import BeforeValidator, Field

from daq.reports.parameters import MAX_SPEED_RPM, QueryParameters
from recordings.catalogue.catalogue import RunEntry
from recordings.catalogue.search import Search

RPM = math.pi / 30.0
SECOND = 1_000_000_000
MAX_TEXT_LENGTH = 200
LATEST = 2**62  # ns


class Sorting(StrEnum):
    """By what runs are sorted; with a minus the largest or latest first."""

    NEWEST = "-started"
    OLDEST = "started"
    LONGEST = "-duration"
    SHORTEST = "duration"
    LARGEST = "-size"
    SMALLEST = "size"


KEYS: Final[Mapping[str, Callable[[RunEntry], float]]] = {
    "started": lambda entry: entry.started_ns,
    "duration": lambda entry: entry.duration,
    "size": lambda entry: entry.size,
}


def _named(value: object) -> object:
    """Take a moment without a zone as UTC, and refuse a mere number."""
    if isinstance(value, str):
        moment = datetime.fromisoformat(value)
        return moment if moment.tzinfo is not None else moment.replace(tzinfo=UTC)
    return value


def _nanoseconds(moment: datetime | None) -> int | None:
    """Return ns since 1970, as near as a database can hold them."""
    return None if moment is None else max(min(round(moment.timestamp() * SECOND), LATEST), -LATEST)


Text = Annotated[str, Field(max_length=MAX_TEXT_LENGTH, pattern=r"^[^\x00]*$")]
Speed = Annotated[float, Field(ge=0, le=MAX_SPEED_RPM)]
Moment = Annotated[datetime, BeforeValidator(_named)]


class RunQuery(QueryParameters):
    """Which runs are asked for; all that is given must hold."""

    rig: Annotated[str | None, Field(description="Only runs of the rig of this name", examples=["gj90c"])] = None
    complete: Annotated[
        bool | None, Field(description="Only runs whose recording is whole (true) or is not (false)", examples=[True])
    ] = None
    device: Annotated[Text, Field(description="Only runs of the device of this serial number", examples=["1A2B3C"])] = (
        ""
    )
    calibration: Annotated[
        Text,
        Field(
            description="Only runs with probes calibrated so: `calibration` of a run, or its first digits",
            examples=["5d41"],
        ),
    ] = ""
    since: Annotated[
        Moment | None,
        Field(description="TriggerStart at or after, UTC unless it names its zone", examples=["2026-11-24T09:00:00Z"]),
    ] = None
    before: Annotated[
        Moment | None,
        Field(description="TriggerStart before, UTC unless it names its zone", examples=["2026-11-25T09:00:00Z"]),
    ] = None
    speed_from_rpm: Annotated[
        Speed | None, Field(description="Went through some speed from here, r/min", examples=[9000.0])
    ] = None
    speed_to_rpm: Annotated[
        Speed | None, Field(description="Went through some speed up to here, r/min", examples=[12_000.0])
    ] = None
    text: Annotated[
        Text, Field(description="Words that all stand in id, rig, note, remark or marks", examples=["oil"])
    ] = ""
    tag: Annotated[
        tuple[Text, ...], Field(description="A tag that it has; may be given again", max_length=10, examples=[["good"]])
    ] = ()
    onset_below_rpm: Annotated[
        Speed | None,
        Field(description="A component below 1X began below this speed, r/min", examples=[11_000.0]),
    ] = None
    sort: Annotated[Sorting, Field(description="Order of the list", examples=["-started"])] = Sorting.NEWEST
    limit: Annotated[int, Field(description="At most so many runs", ge=1, le=200, examples=[20])] = 20
    offset: Annotated[
        int, Field(description="So many of the first runs are passed over", ge=0, le=10_000_000, examples=[0])
    ] = 0

    def search(self) -> Search:
        """Return what the catalogue is asked."""
        return Search(
            started_from_ns=_nanoseconds(self.since),
            started_before_ns=_nanoseconds(self.before),
            speed_low=None if self.speed_from_rpm is None else self.speed_from_rpm * RPM,
            speed_high=None if self.speed_to_rpm is None else self.speed_to_rpm * RPM,
            text=self.text,
            tags=self.tag,
            onset_below=None if self.onset_below_rpm is None else self.onset_below_rpm * RPM,
            serial=self.device,
            calibration=self.calibration,
        )

    def chosen(self, entries: Sequence[RunEntry]) -> list[RunEntry]:
        """Return those of the rig and state asked for, in order."""
        chosen = [entry for entry in entries if self._is_asked_for(entry)]
        if self.sort is Sorting.NEWEST:  # as the catalogue gives them
            return chosen
        key = KEYS[self.sort.removeprefix("-")]
        return sorted(chosen, key=lambda entry: (key(entry), entry.id), reverse=self.sort.startswith("-"))

    def _is_asked_for(self, entry: RunEntry) -> bool:
        rig = None if entry.header is None else entry.header.rig
        return self.rig in (None, rig) and self.complete in (None, entry.is_complete)
