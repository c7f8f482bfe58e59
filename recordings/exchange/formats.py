"""Reading and writing tables in other formats, chosen by the suffix of the file.

The library of a format is imported only when the format is used; those that only some need are the extra ``formats``.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from recordings.errors import ForeignFormatError
from recordings.exchange.array_formats import read_mat, write_hdf5, write_mat, write_parquet
from recordings.exchange.measurement_formats import read_tdms, read_uff, read_wav, write_tdms, write_uff
from recordings.exchange.table import Table
from recordings.exchange.text_formats import read_csv, read_lvm, write_csv
from recordings.file_operations import Progress, atomic_write, ignore_progress

Function = TypeVar("Function")

IMPORT_FORMATS: Mapping[str, Callable[[Path], Table]] = {
    ".tdms": read_tdms,
    ".lvm": read_lvm,
    ".csv": read_csv,
    ".mat": read_mat,
    ".uff": read_uff,
    ".unv": read_uff,
    ".wav": read_wav,
}
EXPORT_FORMATS: Mapping[str, Callable[[Path, Table, Progress], None]] = {
    ".csv": write_csv,
    ".parquet": write_parquet,
    ".h5": write_hdf5,
    ".hdf5": write_hdf5,
    ".tdms": write_tdms,
    ".mat": write_mat,
    ".uff": write_uff,
    ".unv": write_uff,
}


def read_table(path: Path) -> Table:
    """Return the table in a file, whose suffix sets the format.

    Raises
    ------
    ForeignFormatError
        If the format is unknown, its library is missing, or the file is invalid. Any other exception is a defect of
        the reader: `library_errors` encloses the calls of the libraries only.
    """
    read = _function(path, IMPORT_FORMATS)
    try:
        table = read(path)
    except ForeignFormatError as error:
        raise ForeignFormatError(f"{path}: {error}") from error
    except ModuleNotFoundError as error:
        raise _missing_library(path, error) from error
    except OSError as error:
        raise ForeignFormatError(f"{path}: cannot be read: {error.strerror or error}") from error
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
    write = _function(path, EXPORT_FORMATS)
    if path.exists():
        raise ForeignFormatError(f"{path}: exists already; files are never overwritten")
    try:
        with atomic_write(path) as temporary:
            write(temporary, table, on_progress)
    except ModuleNotFoundError as error:
        raise _missing_library(path, error) from error
    except OSError as error:
        raise ForeignFormatError(f"{path}: cannot be written: {error.strerror or error}") from error


def _function(path: Path, formats: Mapping[str, Function]) -> Function:
    """Return the function for a file's suffix."""
    function = formats.get(path.suffix.lower())
    if function is None:
        raise ForeignFormatError(f"{path}: suffix {path.suffix!r}, expected one of {', '.join(formats)}")
    return function


def _missing_library(path: Path, error: ModuleNotFoundError) -> ForeignFormatError:
    install = "install the extra: pip install 'rig-service[formats]'"
    return ForeignFormatError(f"{path}: the library {error.name} is missing; {install}")
