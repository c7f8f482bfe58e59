"""Schemas of uploaded files and their columns, and the request to import one as a run."""

import json
import math
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, Field, ValidationError
from pydantic_core import ErrorDetails

from daq.config.calibration import CalibrationRecord
from daq.config.import_mapping import ChannelMapping
from daq.schemas.runs import RunId
from daq.schemas.units import Schema, utc_time
from daq.service.uploads import Upload
from recordings.exchange.table import Column, Table

UPLOADS_URL = "/api/v1/uploads"


class UploadSchema(Schema):
    """An uploaded file; a job of kind `import` converts it into a run."""

    upload: str = Field(description="Its id", examples=["5d41402abc4b2a76"])
    name: str = Field(description="Its file name", examples=["run-up.tdms"])
    size_bytes: int = Field(description="Its size, bytes", ge=0, examples=[48_000_000])
    uploaded_at: datetime = Field(description="Time of the complete upload, UTC", examples=["2026-11-24T10:00:00Z"])
    expires_at: datetime = Field(description="Time of its deletion, UTC", examples=["2026-11-24T11:00:00Z"])
    columns: str = Field(description="URL of its columns", examples=[f"{UPLOADS_URL}/5d41402abc4b2a76/columns"])


class UploadListSchema(Schema):
    """All uploaded files."""

    uploads: tuple[UploadSchema, ...] = Field(description="Newest first")


class ColumnSchema(Schema):
    """A numeric column."""

    name: str = Field(description="Its name, for use in a mapping", examples=["group/Kaman 1"])
    unit: str = Field(description="Unit from the file; empty if it gives none", examples=["V"])
    lowest: float | None = Field(description="Minimum, in that unit; null: not finite", examples=[-1.25])
    highest: float | None = Field(description="Maximum, in that unit; null: not finite", examples=[1.31])


class ColumnsSchema(Schema):
    """Content of an uploaded file."""

    name: str = Field(description="File name", examples=["run-up.tdms"])
    rows: int = Field(description="Numbers in each column", ge=0, examples=[2_000_000])
    rate_hz: float | None = Field(description="Sampling rate, Hz; null: not in the file", examples=[20_000.0])
    started_at: datetime | None = Field(
        description="Wall clock at the first row, UTC; null: not in the file", examples=["2012-05-01T08:30:00Z"]
    )
    columns: tuple[ColumnSchema, ...] = Field(description="In the order of the file")


def upload_schema(upload: Upload) -> UploadSchema:
    """Return the schema of an upload."""
    return UploadSchema(
        upload=upload.id,
        name=upload.name,
        size_bytes=upload.size,
        uploaded_at=datetime.fromtimestamp(upload.uploaded, UTC),
        expires_at=datetime.fromtimestamp(upload.expires, UTC),
        columns=f"{UPLOADS_URL}/{upload.id}/columns",
    )


def columns_schema(name: str, table: Table) -> ColumnsSchema:
    """Return the schema of a table from the named file."""
    return ColumnsSchema(
        name=name,
        rows=table.n_rows,
        rate_hz=table.rate,
        started_at=None if table.started_ns is None else utc_time(table.started_ns),
        columns=tuple(map(_column_schema, table.columns)),
    )


def _column_schema(column: Column) -> ColumnSchema:
    extremes = float(column.values.min()), float(column.values.max())
    lowest, highest = (extreme if math.isfinite(extreme) else None for extreme in extremes)
    return ColumnSchema(name=column.name, unit=column.unit, lowest=lowest, highest=highest)


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
