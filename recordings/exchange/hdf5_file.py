"""HDF5: one data set per column with its unit as attribute, properties as attributes of the file."""

from pathlib import Path

import h5py

from recordings.exchange.table import Table
from recordings.progress import Progress


def write(path: Path, table: Table, on_progress: Progress) -> None:
    """Write a table to a new file."""
    with h5py.File(path, "x") as file:
        for name, value in table.properties.items():
            file.attrs[name] = value
        if table.rate is not None:
            file.attrs["rate_hz"] = table.rate
        if table.started_ns is not None:
            file.attrs["started_ns"] = table.started_ns
        for number, column in enumerate(table.columns, 1):
            data = file.create_dataset(column.name, data=column.values, compression="gzip", shuffle=True)
            data.attrs["unit"] = column.unit
            on_progress(number / len(table.columns))
