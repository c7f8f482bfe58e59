"""Import request: rig, column mapping and calibrations, validated as strictly as the configuration files."""

import json
from collections.abc import Callable
from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, Field, ValidationError
from pydantic_core import ErrorDetails

from daq.config.calibration import CalibrationRecord
from daq.config.import_mapping import ChannelMapping
from daq.schemas.runs import RunId
from daq.schemas.units import Schema


def validate_as_file(model: type[BaseModel]) -> Callable[[object], object]:
    """Return a validator that treats a value as the content of a file; its ValueError names every error."""

    def validate(value: object) -> object:
        try:
            return model.model_validate_json(json.dumps(value), strict=True)
        except ValidationError as error:
            raise ValueError("; ".join(map(_error_text, error.errors()))) from error

    return validate


def _error_text(fault: ErrorDetails) -> str:
    return f"{'.'.join(map(str, fault['loc']))}: {fault['msg'].removeprefix('Value error, ')}"


MAX_TOML_LENGTH = 200_000  # characters


class RigFromRun(Schema):
    """The rig of a recorded run: channels, calibrations, tacho and limits at the time of recording."""

    source: Literal["run"]
    run: RunId


class RigFromToml(Schema):
    """A rig as TOML text; files that the text names are not read."""

    source: Literal["toml"]
    toml: str = Field(description="Content of a rig.toml", max_length=MAX_TOML_LENGTH, examples=['rig = "gj90c"\n…'])
    calibrations: dict[str, Annotated[CalibrationRecord, BeforeValidator(validate_as_file(CalibrationRecord))]] = Field(
        default_factory=dict,
        description="By name of the probe's channel, each with the content of a calibration file; they replace the "
        "files that the text names",
        examples=[{}],
    )


class ImportRequest(Schema):
    """Import an uploaded file as a run, as `rig import` does; the result is the run."""

    kind: Literal["import"]
    upload: str = Field(description="Id of the upload", max_length=200, examples=["5d41402abc4b2a76"])
    rig: Annotated[RigFromRun | RigFromToml, Field(discriminator="source")] = Field(
        description="The rig that the channels belong to",
        examples=[{"source": "run", "run": "2026-11-24T09-12-07-gj90c"}],
    )
    mapping: Annotated[ChannelMapping, BeforeValidator(validate_as_file(ChannelMapping))] = Field(
        description="Columns of the channels: the content of a mapping file of `rig import`",
        examples=[{"channel": {"x": {"source": "Kaman 1", "unit": "V"}}}],
    )
