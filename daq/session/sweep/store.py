"""Results of a sweep on disk: Parquet parts during the sweep, one Parquet file at the end, all written atomically."""

import importlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from uuid import uuid4

from daq.errors import UsageError
from model.studies.sweep_quantities import SweepResult
from recordings.atomic_file import atomic_write


class SweepStore:
    """Results of a sweep by the keys of their points.

    Parameters
    ----------
    file : Path
        File of all results, ``.parquet``; parts are in the folder ``<file>.parts`` until the sweep is complete.
    results : tuple of str
        Names of the result columns.

    Raises
    ------
    UsageError
        pyarrow is missing, or the file name does not end with .parquet.
    """

    def __init__(self, file: Path, results: tuple[str, ...]) -> None:
        if file.suffix.lower() != ".parquet":
            raise UsageError(f"-o {file}: expected a name that ends with .parquet")
        try:
            importlib.import_module("pyarrow")
        except ImportError as error:
            message = "sweeps need pyarrow: install the extra, pip install 'rig-service[formats]'"
            raise UsageError(message) from error
        self._file, self._results = file, results
        self._parts = file.with_name(file.name + ".parts")

    def load(self, keys: Iterable[str]) -> dict[str, SweepResult]:
        """Return the stored results of these points, from the file and from parts of a stopped sweep."""
        wanted, found = set(keys), {}
        parts = sorted(self._parts.glob("*.parquet")) if self._parts.is_dir() else []
        for file in [self._file] * self._file.exists() + parts:
            for outcome in self._read(file):
                if outcome.key in wanted:
                    found[outcome.key] = outcome
        return found

    def save_part(self, outcomes: Sequence[SweepResult]) -> None:
        """Write some results as a part."""
        if outcomes:
            self._write({}, outcomes, self._parts / f"{uuid4().hex}.parquet")

    def finish(self, values: Mapping[str, Sequence[float]], outcomes: Sequence[SweepResult]) -> None:
        """Write all values and results in the order of the points, and remove the parts."""
        self._write(values, outcomes, self._file)
        if self._parts.is_dir():
            for part in self._parts.iterdir():
                part.unlink()
            self._parts.rmdir()

    def _write(self, values: Mapping[str, Sequence[float]], outcomes: Sequence[SweepResult], file: Path) -> None:
        import pyarrow as pa  # noqa: PLC0415  # an extra, slow to import
        from pyarrow import parquet  # noqa: PLC0415  # an extra, slow to import

        columns = {"key": pa.array([one.key for one in outcomes], pa.string())}
        columns |= {name: pa.array(list(column), pa.float64()) for name, column in values.items()}
        for number, name in enumerate(self._results):
            columns[name] = pa.array([one.results[number] for one in outcomes], pa.float64())
        columns["fault"] = pa.array([one.fault for one in outcomes], pa.string())
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            with atomic_write(file) as temporary:
                parquet.write_table(pa.table(columns), temporary)
        except OSError as error:
            raise UsageError(f"{file}: cannot be written ({error.strerror or error})") from error

    def _read(self, file: Path) -> list[SweepResult]:
        from pyarrow import ArrowException, parquet  # noqa: PLC0415  # an extra, slow to import

        try:
            table = parquet.read_table(file)
        except (OSError, ArrowException) as error:
            raise UsageError(f"{file}: no readable Parquet file ({error}); move it away or choose another") from error
        if not {"key", "fault", *self._results} <= set(table.column_names):
            raise UsageError(f"{file}: holds results of another quantity; choose another file")
        columns = [table.column(name).to_pylist() for name in ("key", "fault", *self._results)]
        return [SweepResult(key, tuple(results), fault) for key, fault, *results in zip(*columns, strict=True)]
