"""Whether a rig file is good, and what was understood of it."""

from typing import Annotated

from pydantic import Field

from analysis.signals.header import Role
from daq.config.rig import Rig
from daq.errors import ConfigError
from daq.schemas.document import Document
from daq.schemas.units import finite


class CheckedChannelDocument(Document):
    """One input and what is wired to it."""

    name: str = Field(description="The operator's name for it", examples=["x"])
    role: Role = Field(description="What it measures")
    physical: str = Field(description="The card's input", examples=["ai0"])
    calibration: str = Field(description="The calibration file as the rig file names it; empty for the tacho")


class RigCheckDocument(Document):
    """Whether a rig file is good; what was understood is null, and channels are none, where it is not."""

    file: str = Field(description="The rig file")
    is_good: bool = Field(description="Whether there is no fault in it or in a file that it names")
    faults: tuple[str, ...] = Field(description="Every fault, with key, value and what was expected")
    rig: str | None = Field(description="Name of the rig", examples=["gj90c"])
    channels: tuple[CheckedChannelDocument, ...] = Field(description="In the order in which they are sampled")
    sample_rate_hz: float | None = Field(description="Samples per channel and second that the card will do, Hz")
    convert_rate_hz: float | None = Field(description="Clock of the multiplexer to be expected, Hz")
    tacho_reference: str | None = Field(
        description='What speed and phase are taken from: "samples" of the tacho, or a "counter" that stamps its edges'
    )
    counter_resolution_ns: float | None = Field(description="Of the stamps, ns; null where no counter stamps")
    disk_bytes_per_hour: Annotated[int, Field(ge=0)] | None = Field(
        description="What a run takes at most, bytes an hour"
    )


def faulty_document(error: ConfigError) -> RigCheckDocument:
    """Return the faults of a rig file as a document."""
    return RigCheckDocument(
        file=error.file,
        is_good=False,
        faults=tuple(error.faults),
        rig=None,
        channels=(),
        sample_rate_hz=None,
        convert_rate_hz=None,
        tacho_reference=None,
        counter_resolution_ns=None,
        disk_bytes_per_hour=None,
    )


def good_document(rig: Rig, *, rate: float, convert_rate: float, disk_rate: float) -> RigCheckDocument:
    """Return what was understood of a rig file as a document; rates in Hz, the disk's in bytes a second."""
    return RigCheckDocument(
        file=str(rig.path),
        is_good=True,
        faults=(),
        rig=rig.config.rig,
        channels=tuple(
            CheckedChannelDocument(
                name=channel.name, role=channel.role, physical=channel.physical, calibration=channel.calibration
            )
            for channel in rig.config.channel
        ),
        sample_rate_hz=finite(rate),
        convert_rate_hz=finite(convert_rate),
        tacho_reference=rig.tacho.reference,
        counter_resolution_ns=None if rig.tacho.counter is None else finite(1e9 / rig.tacho.counter.timebase),
        disk_bytes_per_hour=round(disk_rate * 3600),
    )
