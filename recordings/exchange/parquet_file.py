"""Parquet, written with Arrow: units in the fields' metadata, properties in the schema's metadata."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from recordings.exchange.table import Table
from recordings.progress import Progress

ROWS_PER_WRITE = 500_000


def write(path: Path, table: Table, on_progress: Progress) -> None:
    """Write a table to a new file."""
    metadata = dict(table.properties)
    if table.rate is not None:
        metadata["rate_hz"] = repr(table.rate)
    if table.started_ns is not None:
        metadata["started_ns"] = str(table.started_ns)
    rows = [pa.array(c.values) for c in table.columns]
    fields = [pa.field(c.name, row.type, metadata={"unit": c.unit}) for c, row in zip(table.columns, rows, strict=True)]
    arrow_table = pa.table(rows, schema=pa.schema(fields, metadata=metadata))
    with pq.ParquetWriter(path, arrow_table.schema, compression="zstd") as writer:
        for first in range(0, max(table.n_rows, 1), ROWS_PER_WRITE):
            writer.write_table(arrow_table.slice(first, ROWS_PER_WRITE))
            on_progress(min(1.0, (first + ROWS_PER_WRITE) / max(table.n_rows, 1)))
