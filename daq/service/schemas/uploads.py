"""Schemas of uploaded files and their columns."""

import math
from datetime import UTC, datetime

from pydantic import Field

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
