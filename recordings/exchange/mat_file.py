"""MATLAB .mat files up to version 7.2: one variable per column, structures for units and properties."""

from pathlib import Path

import numpy as np
from scipy.io import loadmat, savemat

from recordings.errors import ForeignFormatError
from recordings.exchange.table import Column, Table
from recordings.progress import Progress

UNITS, PROPERTIES = "units", "properties"
RATES = ("rate_hz", "fs", "Fs")


def read(path: Path) -> Table:
    """Return the table of a file: each numeric vector is a column, each column of a matrix one, as "name:1"."""
    with path.open("rb") as file:
        if file.read(128).startswith(b"MATLAB 7.3"):
            raise ForeignFormatError("is of version 7.3, expected up to 7.2; save it with -v7")
    variables = loadmat(path)
    units = _texts(variables.get(UNITS))
    found: dict[str, np.ndarray[tuple[int, ...], np.dtype[np.float64]]] = {}
    for name, value in variables.items():
        if name.startswith("__") or not np.issubdtype(value.dtype, np.number) or value.size < 2 or value.ndim != 2:
            continue
        if 1 in value.shape:
            found[name] = value.ravel().astype(np.float64)
        else:
            found |= {f"{name}:{k}": value[:, k - 1].astype(np.float64) for k in range(1, value.shape[1] + 1)}
    longest = max((len(values) for values in found.values()), default=0)
    columns = [Column(name, units.get(name, ""), values) for name, values in found.items() if len(values) == longest]
    rates = [float(variables[name].item()) for name in RATES if name in variables and variables[name].size == 1]
    properties = _texts(variables.get(PROPERTIES))
    started_ns = int(properties["started_ns"]) if "started_ns" in properties else None
    return Table(tuple(columns), rates[0] if rates else None, started_ns, properties)


def write(path: Path, table: Table, on_progress: Progress) -> None:
    """Write a table to a new file."""
    properties = dict(table.properties)
    if table.started_ns is not None:
        properties["started_ns"] = str(table.started_ns)
    variables: dict[str, object] = {column.name: column.values for column in table.columns}
    variables[UNITS] = {column.name: column.unit for column in table.columns}
    variables[PROPERTIES] = properties
    if table.rate is not None:
        variables["rate_hz"] = table.rate
    savemat(path, variables, appendmat=False, do_compression=True, oned_as="column")
    on_progress(1.0)


def _texts(record: object) -> dict[str, str]:
    """Return a MATLAB structure of strings as a dict."""
    if not isinstance(record, np.ndarray) or record.dtype.names is None:
        return {}
    return {name: "".join(record[name].item().ravel().tolist()) for name in record.dtype.names}
