"""The mapping file of an import: which column of a foreign file holds which channel of a rig, in which unit."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from daq.config.schema import Section
from daq.config.toml_files import read_tables, read_text, validated

SECOND = 1_000_000_000  # ns

MAX_RATE = 1e9  # Hz
MAX_FACTOR = 1e12  # larger factors could overflow
YEARS = range(1970, 2200)


def _timestamp(value: str) -> str:
    try:
        is_valid = not value or datetime.fromisoformat(value).year in YEARS
    except ValueError:
        is_valid = False
    if not is_valid:
        raise ValueError('expected a timestamp like "2012-05-01T10:30:00"')
    return value


class ColumnMapping(Section):
    """`[channel.NAME]`: the column that holds the samples of a rig's channel."""

    source: str = Field(
        max_length=200, description='Name of the column in the file; in TDMS "group/channel"', examples=["Kaman 1"]
    )
    unit: Literal["V", "mV", "um", "mm", "m"] = Field(
        "V", description="Unit of its values; lengths are displacements towards the probe", examples=["V"]
    )
    factor: Annotated[float, Field(gt=0, le=MAX_FACTOR)] = Field(
        1.0, description="Factor that converts its values to that unit", examples=[1.0]
    )


class ChannelMapping(Section):
    """The columns of all channels, and data that the foreign file does not contain."""

    rate_hz: Annotated[float, Field(gt=0, le=MAX_RATE)] | None = Field(
        None, description="Sample rate, Hz; default: the rate in the file", examples=[20_000.0]
    )
    started: Annotated[str, AfterValidator(_timestamp)] = Field(
        "",
        description="Time of the first sample, in the computer's time zone if it names none; default: the time in the "
        "file, else the file's modification time",
        examples=["2012-05-01T10:30:00"],
    )
    note: str = Field(
        "", max_length=2000, description="Note; default: the note in the file", examples=["run-up with cold oil"]
    )
    channel: Annotated[dict[str, ColumnMapping], Field(min_length=1)] = Field(
        description="Column of each channel of the rig, by channel name", examples=[{"x": {"source": "Kaman 1"}}]
    )

    @property
    def started_ns(self) -> int | None:
        """Time of the first sample, ns since 1970; None if not given."""
        if not self.started:
            return None
        return round(datetime.fromisoformat(self.started).astimezone(UTC).timestamp() * 1e6) * (SECOND // 1_000_000)


class ImportMapping(ChannelMapping):
    """A mapping file."""

    rig: str  # rig.toml with channels, calibrations, tacho and limits; relative to this file


def load_mapping(path: Path) -> tuple[ImportMapping, str]:
    """Return the content of a mapping file and its text; ConfigError lists all errors."""
    text = read_text(path)
    return validated(ImportMapping, read_tables(text, str(path)), str(path)), text
