"""Files of other programs that were sent in, and what is in them."""

import math
from datetime import UTC, datetime

from pydantic import Field

from daq.schemas.units import Schema, utc_time
from daq.service.uploads import Upload
from recordings.exchange.table import Column, Table

UPLOADS = "/api/v1/uploads"


class UploadSchema(Schema):
    """A file that was sent in; an order of kind `import` makes it into a run."""

    upload: str = Field(description="Its id", examples=["5d41402abc4b2a76"])
    name: str = Field(description="What it is called", examples=["run-up.tdms"])
    size_bytes: int = Field(description="Its size, bytes", ge=0, examples=[48_000_000])
    uploaded_at: datetime = Field(description="When it was there, UTC", examples=["2026-11-24T10:00:00Z"])
    expires_at: datetime = Field(description="When it is deleted, UTC", examples=["2026-11-24T11:00:00Z"])
    columns: str = Field(description="Address of what is in it", examples=[f"{UPLOADS}/5d41402abc4b2a76/columns"])


class UploadListSchema(Schema):
    """All files that were sent in."""

    uploads: tuple[UploadSchema, ...] = Field(description="The one sent last first")


class ColumnSchema(Schema):
    """A column of numbers."""

    name: str = Field(description="As a mapping names it", examples=["group/Kaman 1"])
    unit: str = Field(description="As the file says it; empty where it does not", examples=["V"])
    lowest: float | None = Field(description="Its smallest number, in that unit; null: not finite", examples=[-1.25])
    highest: float | None = Field(description="Its largest number, in that unit; null: not finite", examples=[1.31])


class ColumnsSchema(Schema):
    """What is in a file of another program."""

    name: str = Field(description="What the file is called", examples=["run-up.tdms"])
    rows: int = Field(description="Numbers in each column", ge=0, examples=[2_000_000])
    rate_hz: float | None = Field(description="Rows a second, Hz; null: the file does not tell", examples=[20_000.0])
    started_at: datetime | None = Field(
        description="Wall clock at the first row, UTC; null: the file does not tell", examples=["2012-05-01T08:30:00Z"]
    )
    columns: tuple[ColumnSchema, ...] = Field(description="In the file's order")


def upload_schema(upload: Upload) -> UploadSchema:
    """Return an upload as a document."""
    return UploadSchema(
        upload=upload.id,
        name=upload.name,
        size_bytes=upload.size,
        uploaded_at=datetime.fromtimestamp(upload.uploaded, UTC),
        expires_at=datetime.fromtimestamp(upload.expires, UTC),
        columns=f"{UPLOADS}/{upload.id}/columns",
    )


def columns_schema(name: str, table: Table) -> ColumnsSchema:
    """Return what is in a file of a name."""
    return ColumnsSchema(
        name=name,
        rows=table.n_rows,
        rate_hz=table.rate,
        started_at=None if table.started_ns is None else utc_time(table.started_ns),
        columns=tuple(map(_column, table.columns)),
    )


def _column(column: Column) -> ColumnSchema:
    ends = float(column.values.min()), float(column.values.max())
    lowest, highest = (end if math.isfinite(end) else None for end in ends)
    return ColumnSchema(name=column.name, unit=column.unit, lowest=lowest, highest=highest)
