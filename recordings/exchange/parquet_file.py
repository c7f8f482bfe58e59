"""Parquet by way of Arrow: units beside the columns, the rest in the schema's metadata."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from recordings.exchange.table import Table
from recordings.progress import Progress

PIECE = 500_000  # rows that are written at a time


def write(path: Path, table: Table, on_progress: Progress) -> None:
    """Write a file."""
    metadata = dict(table.properties)
    if table.rate is not None:
        metadata["rate_hz"] = repr(table.rate)
    if table.started_ns is not None:
        metadata["started_ns"] = str(table.started_ns)
    rows = [pa.array(c.values) for c in table.columns]
    fields = [pa.field(c.name, row.type, metadata={"unit": c.unit}) for c, row in zip(table.columns, rows, strict=True)]
    made = pa.table(rows, schema=pa.schema(fields, metadata=metadata))
    with pq.ParquetWriter(path, made.schema, compression="zstd") as writer:
        for first in range(0, max(table.n_rows, 1), PIECE):
            writer.write_table(made.slice(first, PIECE))
            on_progress(min(1.0, (first + PIECE) / max(table.n_rows, 1)))
