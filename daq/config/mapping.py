"""The mapping file of an import: which column of a foreign file is which channel of a rig, and in what unit."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, ValidationError

from daq.config.faults import plain_json, read_tables, read_text, validation_faults
from daq.config.schema import Positive, Section
from daq.errors import ConfigError

SECOND = 1_000_000_000


def _moment(value: str) -> str:
    try:
        datetime.fromisoformat(value or "1970-01-01")
    except ValueError as error:
        raise ValueError('expected a moment like "2012-05-01T10:30:00"') from error
    return value


class ColumnMapping(Section):
    """`[channel.NAME]`: where the samples of a channel of the rig are."""

    source: str  # the column's name in the file; in TDMS "group/channel"
    unit: Literal["V", "mV", "um", "mm", "m"] = "V"  # lengths are displacements towards the probe
    factor: Positive = 1.0  # of the file's values, to make them that unit


class ImportMapping(Section):
    """A whole mapping file."""

    rig: str  # the rig.toml with channels, calibrations, tacho and limits; relative to this file
    rate_hz: Positive | None = None  # left out: as the file says
    started: Annotated[str, AfterValidator(_moment)] = ""  # left out: as the file says, else its last change
    note: str = ""
    channel: Annotated[dict[str, ColumnMapping], Field(min_length=1)]

    @property
    def started_ns(self) -> int | None:
        """When the samples begin, ns since 1970; without a zone it is the computer's own."""
        if not self.started:
            return None
        return round(datetime.fromisoformat(self.started).astimezone(UTC).timestamp() * 1e6) * (SECOND // 1_000_000)


def load_mapping(path: Path) -> tuple[ImportMapping, str]:
    """Return a mapping file and its text; ConfigError tells every fault."""
    text = read_text(path)
    data = read_tables(text, str(path))
    try:
        return ImportMapping.model_validate_json(plain_json(data), strict=True), text
    except ValidationError as error:
        faults = validation_faults(error, ImportMapping, data)
        raise ConfigError(str(path), [fault.text for fault in faults]) from error
