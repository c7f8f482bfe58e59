"""Another program's file that is to become a run: of which rig, and which columns are which channels.

Content of files as a part of a document, taken as strictly as the files are: a text is no number.
"""

import json
from collections.abc import Callable
from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, Field, ValidationError
from pydantic_core import ErrorDetails

from daq.config.calibration import CalibrationRecord
from daq.config.import_mapping import ChannelMapping
from daq.schemas.runs import RunId
from daq.schemas.units import Schema


def as_a_file(model: type[BaseModel]) -> Callable[[object], object]:
    """Return what takes a value as a file of this model is read; ValueError tells every fault."""

    def taken(value: object) -> object:
        try:
            return model.model_validate_json(json.dumps(value), strict=True)
        except ValidationError as error:
            raise ValueError("; ".join(map(_said, error.errors()))) from error

    return taken


def _said(fault: ErrorDetails) -> str:
    return f"{'.'.join(map(str, fault['loc']))}: {fault['msg'].removeprefix('Value error, ')}"


MOST_TOML = 200_000  # letters


class RigFromRun(Schema):
    """The rig of a run: its channels, calibrations, tacho and limits as they were then."""

    source: Literal["run"]
    run: RunId


class RigFromToml(Schema):
    """A rig in words: no file that the text names is read."""

    source: Literal["toml"]
    toml: str = Field(description="Content of a rig.toml", max_length=MOST_TOML, examples=['rig = "gj90c"\n…'])
    calibrations: dict[str, Annotated[CalibrationRecord, BeforeValidator(as_a_file(CalibrationRecord))]] = Field(
        default_factory=dict,
        description="By the name of the probe's channel, each in the form of a calibration file, in place of the files "
        "that the text names",
        examples=[{}],
    )


class ImportRequest(Schema):
    """Make a file that was sent in to `/api/v1/uploads` into a run, as `rig import` does; the result tells which."""

    kind: Literal["import"]
    upload: str = Field(description="Id of the upload", max_length=200, examples=["5d41402abc4b2a76"])
    rig: Annotated[RigFromRun | RigFromToml, Field(discriminator="source")] = Field(
        description="Whose channels they are", examples=[{"source": "run", "run": "2026-11-24T09-12-07-gj90c"}]
    )
    mapping: Annotated[ChannelMapping, BeforeValidator(as_a_file(ChannelMapping))] = Field(
        description="Which columns are which channels: what a mapping file of `rig import` says",
        examples=[{"channel": {"x": {"source": "Kaman 1", "unit": "V"}}}],
    )
