"""Reading and writing tables in other formats, one module for each format.

A format's library is imported only when the format is used; the libraries are the extra ``formats``.
"""

import logging
from importlib import import_module
from pathlib import Path
from typing import Any

from recordings.atomic_file import atomic_write
from recordings.errors import ForeignFormatError
from recordings.exchange.table import Column, Table
from recordings.progress import Progress, ignore_progress

logger = logging.getLogger(__name__)

__all__ = ["EXPORT_FORMATS", "IMPORT_FORMATS", "Column", "Table", "read_table", "write_table"]

IMPORT_FORMATS = {
    ".tdms": "tdms",
    ".lvm": "lvm",
    ".csv": "csv",
    ".mat": "mat",
    ".uff": "uff",
    ".unv": "uff",
    ".wav": "wav",
}
EXPORT_FORMATS = {
    ".csv": "csv",
    ".parquet": "parquet",
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".tdms": "tdms",
    ".mat": "mat",
    ".uff": "uff",
    ".unv": "uff",
}


def read_table(path: Path) -> Table:
    """Return the table in a file, whose suffix sets the format.

    Raises
    ------
    ForeignFormatError
        If the format is unknown, its library is missing, or the file is invalid.
    """
    module = _module(path, IMPORT_FORMATS)
    try:
        table: Table = module.read(path)
    except ForeignFormatError as error:
        raise ForeignFormatError(f"{path}: {error}") from error
    except OSError as error:
        raise ForeignFormatError(f"{path}: cannot be read: {error.strerror or error}") from error
    except Exception as error:  # the libraries raise all kinds of errors for a damaged file
        logger.info("%s cannot be read", path, exc_info=True)  # the traceback may show a defect of the reader
        kind = path.suffix.lower().removeprefix(".")
        raise ForeignFormatError(f"{path}: is not a {kind} file that can be read: {error}") from error
    if table.n_rows == 0:
        raise ForeignFormatError(f"{path}: has no columns of numbers")
    return table


def write_table(path: Path, table: Table, on_progress: Progress = ignore_progress) -> None:
    """Write a table to a new file, whose suffix sets the format.

    ``on_progress`` is called with the fraction written, 0 to 1, as finely as the format's library allows.

    Raises
    ------
    ForeignFormatError
        If the format is unknown, its library is missing, or the file exists or cannot be written.
    """
    module = _module(path, EXPORT_FORMATS)
    if path.exists():
        raise ForeignFormatError(f"{path}: exists already; files are never overwritten")
    try:
        with atomic_write(path) as temporary:
            module.write(temporary, table, on_progress)
    except OSError as error:
        raise ForeignFormatError(f"{path}: cannot be written: {error.strerror or error}") from error


def _module(path: Path, formats: dict[str, str]) -> Any:
    name = formats.get(path.suffix.lower())
    if name is None:
        raise ForeignFormatError(f"{path}: suffix {path.suffix!r}, expected one of {', '.join(formats)}")
    try:
        return import_module(f"recordings.exchange.{name}_file")
    except ModuleNotFoundError as error:
        raise ForeignFormatError(
            f"{path}: the library {error.name} is missing; install the extra: pip install 'rig-service[formats]'"
        ) from error
