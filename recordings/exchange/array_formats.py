"""Formats of numerical programs: MATLAB, read and written; HDF5 and Parquet, written only."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recordings.errors import ForeignFormatError
from recordings.exchange.table import Column, Table, library_errors
from recordings.file_operations import Progress

UNITS, PROPERTIES = "units", "properties"
RATES = ("rate_hz", "fs", "Fs")
PARQUET_ROWS_PER_WRITE = 500_000


def read_mat(path: Path) -> Table:
    """Return the table of a MATLAB file up to version 7.2.

    Each numeric vector is a column, each column of a matrix one, as "name:1"; structures hold units and properties.
    scipy's reader may end the process at a damaged file without compression (invalid memory access): the service
    therefore reads files of other programs in worker processes only.
    """
    from scipy.io import loadmat  # noqa: PLC0415 - slow to import

    with path.open("rb") as file:
        if file.read(128).startswith(b"MATLAB 7.3"):
            raise ForeignFormatError("is of version 7.3, expected up to 7.2; save it with -v7")
    with library_errors(path):
        variables = loadmat(path)
    units = _texts(variables.get(UNITS))
    arrays: dict[str, NDArray[np.float64]] = {}
    for name, value in variables.items():
        if name.startswith("__") or not _is_numeric(value) or value.size < 2 or value.ndim != 2:
            continue
        if 1 in value.shape:
            arrays[name] = value.ravel().astype(np.float64)
        else:
            arrays |= {f"{name}:{k}": column.astype(np.float64) for k, column in enumerate(value.T, 1)}
    longest = max((len(values) for values in arrays.values()), default=0)
    columns = [Column(name, units.get(name, ""), values) for name, values in arrays.items() if len(values) == longest]
    scalars = (variables[name] for name in RATES if _is_numeric(variables.get(name)) and variables[name].size == 1)
    rates = (float(np.real(scalar.item())) for scalar in scalars)
    return Table.from_properties(columns, _texts(variables.get(PROPERTIES)), next(rates, None))


def write_mat(path: Path, table: Table, on_progress: Progress) -> None:
    """Write a MATLAB file, one variable per column."""
    from scipy.io import savemat  # noqa: PLC0415 - slow to import

    variables: dict[str, object] = {column.name: column.values for column in table.columns}
    variables[UNITS] = {column.name: column.unit for column in table.columns}
    variables[PROPERTIES] = table.all_properties()
    if table.rate is not None:
        variables["rate_hz"] = table.rate
    savemat(path, variables, appendmat=False, do_compression=True, oned_as="column")
    on_progress(1.0)


def _is_numeric(value: object) -> bool:
    return isinstance(value, np.ndarray) and np.issubdtype(value.dtype, np.number)


def _texts(record: object) -> dict[str, str]:
    """Return a MATLAB structure of strings as a dict."""
    if not isinstance(record, np.ndarray) or record.dtype.names is None or record.size != 1:
        return {}
    return {name: "".join(map(str, np.ravel(record[name].item()))) for name in record.dtype.names}


def write_hdf5(path: Path, table: Table, on_progress: Progress) -> None:
    """Write an HDF5 file: a data set per column with its unit as attribute; properties are attributes of the file."""
    import h5py  # noqa: PLC0415 - an extra

    attributes: dict[str, object] = {"rate_hz": table.rate, "started_ns": table.started_ns}
    with h5py.File(path, "x") as file:
        for name, value in (dict(table.properties) | attributes).items():
            if value is not None:
                file.attrs[name] = value
        for number, column in enumerate(table.columns, 1):
            data = file.create_dataset(column.name, data=column.values, compression="gzip", shuffle=True)
            data.attrs["unit"] = column.unit
            on_progress(number / len(table.columns))


def write_parquet(path: Path, table: Table, on_progress: Progress) -> None:
    """Write a Parquet file: units in the metadata of the fields, properties in the metadata of the schema."""
    import pyarrow as pa  # noqa: PLC0415 - an extra
    from pyarrow import parquet  # noqa: PLC0415

    rows = [pa.array(column.values) for column in table.columns]
    fields = [pa.field(c.name, row.type, metadata={"unit": c.unit}) for c, row in zip(table.columns, rows, strict=True)]
    arrow_table = pa.table(rows, schema=pa.schema(fields, metadata=table.all_properties()))
    with parquet.ParquetWriter(path, arrow_table.schema, compression="zstd") as writer:
        for first in range(0, max(table.n_rows, 1), PARQUET_ROWS_PER_WRITE):
            writer.write_table(arrow_table.slice(first, PARQUET_ROWS_PER_WRITE))
            on_progress(min(1.0, (first + PARQUET_ROWS_PER_WRITE) / max(table.n_rows, 1)))
