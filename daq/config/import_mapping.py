"""The mapping file of an import: which column of a foreign file is which channel of a rig, and in what unit."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, ValidationError

from daq.config.schema import Section
from daq.config.toml_files import plain_json, read_tables, read_text, validation_faults
from daq.errors import ConfigError

SECOND = 1_000_000_000


FASTEST = 1e9  # Hz
LARGEST = 1e12  # of a factor: values beyond would not stay finite
YEARS = range(1970, 2200)


def _moment(value: str) -> str:
    try:
        is_known = not value or datetime.fromisoformat(value).year in YEARS
    except ValueError:
        is_known = False
    if not is_known:
        raise ValueError('expected a moment like "2012-05-01T10:30:00"')
    return value


class ColumnMapping(Section):
    """`[channel.NAME]`: where the samples of a channel of the rig are."""

    source: str = Field(
        max_length=200, description='The column\'s name in the file; in TDMS "group/channel"', examples=["Kaman 1"]
    )
    unit: Literal["V", "mV", "um", "mm", "m"] = Field(
        "V", description="Of its values; lengths are displacements towards the probe", examples=["V"]
    )
    factor: Annotated[float, Field(gt=0, le=LARGEST)] = Field(
        1.0, description="Of its values, to make them that unit", examples=[1.0]
    )


class ChannelMapping(Section):
    """Which columns are which channels, and what the file does not tell of them."""

    rate_hz: Annotated[float, Field(gt=0, le=FASTEST)] | None = Field(
        None, description="Samples a second, Hz; left out: as the file says", examples=[20_000.0]
    )
    started: Annotated[str, AfterValidator(_moment)] = Field(
        "",
        description="When the samples begin, by the computer's own clock where it names no zone; left out: as the file "
        "says, else its last change",
        examples=["2012-05-01T10:30:00"],
    )
    note: str = Field(
        "", max_length=2000, description="The operator's words; left out: the file's", examples=["run-up with cold oil"]
    )
    channel: Annotated[dict[str, ColumnMapping], Field(min_length=1)] = Field(
        description="By the name of the rig's channel; all of them", examples=[{"x": {"source": "Kaman 1"}}]
    )

    @property
    def started_ns(self) -> int | None:
        """When the samples begin, ns since 1970; without a zone it is the computer's own."""
        if not self.started:
            return None
        return round(datetime.fromisoformat(self.started).astimezone(UTC).timestamp() * 1e6) * (SECOND // 1_000_000)


class ImportMapping(ChannelMapping):
    """A whole mapping file."""

    rig: str  # the rig.toml with channels, calibrations, tacho and limits; relative to this file


def load_mapping(path: Path) -> tuple[ImportMapping, str]:
    """Return a mapping file and its text; ConfigError tells every fault."""
    text = read_text(path)
    data = read_tables(text, str(path))
    try:
        return ImportMapping.model_validate_json(plain_json(data), strict=True), text
    except ValidationError as error:
        faults = validation_faults(error, ImportMapping, data)
        raise ConfigError(str(path), [fault.text for fault in faults]) from error
