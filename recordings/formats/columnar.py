"""Parquet by way of Arrow: units beside the columns, the rest in the schema's metadata."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from recordings.formats.table import Table


def write(path: Path, table: Table) -> None:
    """Write a file."""
    metadata = dict(table.properties)
    if table.rate is not None:
        metadata["rate_hz"] = repr(table.rate)
    if table.started_ns is not None:
        metadata["started_ns"] = str(table.started_ns)
    fields = [pa.field(c.name, pa.from_numpy_dtype(c.values.dtype), metadata={"unit": c.unit}) for c in table.columns]
    schema = pa.schema(fields, metadata=metadata)
    pq.write_table(pa.table([pa.array(c.values) for c in table.columns], schema=schema), path, compression="zstd")
