"""Parameter sweeps: the grid of points, the workers that compute them, and their results on disk."""

import itertools
import math
import os
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol, TypeVar
from uuid import uuid4

from daq.errors import RigError, UsageError
from daq.session.processes import WorkerPool, WorkerStoppedError
from model.rotor.parameters import ModelParameters
from model.studies.sweep_quantities import QUANTITIES, SweepPoint, SweepResult, compute_points, variable_names
from recordings.file_operations import atomic_write

SAVE_INTERVAL = 2.0  # s between two parts on disk
MIN_CHUNKS = 200  # of a sweep, for fine-grained progress and resuming
MAX_CHUNK_SIZE = 50  # points
MAX_RETRIES = 5  # of a task whose workers die
NICENESS = 5  # increase, of local processes
CONNECT_TIMEOUT = 10.0  # s
WAIT_INTERVAL = 0.5  # s of one wait: an endless wait blocks Ctrl-C on some platforms
Task = TypeVar("Task")
Result = TypeVar("Result")


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
        if find_spec("pyarrow") is None:
            raise UsageError("sweeps need pyarrow: install the extra, pip install 'rig-service[formats]'")
        self._file, self._results = file, results
        self._parts = file.with_name(file.name + ".parts")

    def load(self, keys: Iterable[str]) -> dict[str, SweepResult]:
        """Return the stored results of these points, from the file and from parts of a stopped sweep."""
        wanted = set(keys)
        files = [self._file] * self._file.exists() + sorted(self._parts.glob("*.parquet"))
        return {outcome.key: outcome for file in files for outcome in self._read(file) if outcome.key in wanted}

    def save_part(self, outcomes: Sequence[SweepResult]) -> None:
        """Write some results as a part."""
        if outcomes:
            self._write({}, outcomes, self._parts / f"{uuid4().hex}.parquet")

    def finish(self, values: Mapping[str, Sequence[float]], outcomes: Sequence[SweepResult]) -> None:
        """Write all values and results in the order of the points, and remove the parts."""
        self._write(values, outcomes, self._file)
        shutil.rmtree(self._parts, ignore_errors=True)

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


class Workers(Protocol):
    """Computes tasks; the results do not depend on where."""

    def run(self, function: Callable[[Task], Result], tasks: Sequence[Task]) -> Iterator[tuple[int, Result]]:
        """Yield each task's index and result as it is done, in any order."""
        ...


class LocalWorkers:
    """A pool of processes on this machine.

    Parameters
    ----------
    count : int, optional
        Number of processes; default: one per usable processor.
    """

    def __init__(self, count: int | None = None) -> None:
        self._count = (usable_processors() if count is None else count) or 1

    def run(self, function: Callable[[Task], Result], tasks: Sequence[Task]) -> Iterator[tuple[int, Result]]:
        """Yield each task's index and result; a task whose process dies is repeated."""
        waiting = iter(enumerate(tasks))
        running: dict[Future[Result], int] = {}
        with ThreadPoolExecutor(self._count) as threads, closing(WorkerPool(self._count, NICENESS)) as workers:
            while True:
                while len(running) < 2 * self._count and (following := next(waiting, None)) is not None:
                    number, task = following
                    running[threads.submit(_run_repeatedly, workers, function, task)] = number
                if not running:
                    return
                done, _ = wait(running, WAIT_INTERVAL, return_when=FIRST_COMPLETED)
                for future in done:
                    yield running.pop(future), future.result()


def _run_repeatedly(workers: WorkerPool, function: Callable[[Task], Result], task: Task) -> Result:
    """Return a task's result; RigError where its process dies again and again."""
    death: WorkerStoppedError | None = None
    for _ in range(1 + MAX_RETRIES):
        try:
            return workers.run(function, task)
        except WorkerStoppedError as error:
            death = error
    message = f"sweep: its processes died {1 + MAX_RETRIES} times without a result; finished points are saved"
    raise RigError(message) from death


class DaskWorkers:
    """A Dask cluster, whose workers have this package installed.

    Parameters
    ----------
    address : str
        Address of its scheduler, such as tcp://host:8786.
    connect_timeout : float
        Time for the connection, s.

    Raises
    ------
    UsageError
        The extra is not installed, or there is no scheduler at the address.
    """

    def __init__(self, address: str, connect_timeout: float = CONNECT_TIMEOUT) -> None:
        try:
            import distributed  # noqa: PLC0415  # an extra, slow to import
        except ImportError as error:
            message = "a cluster needs Dask: install the extra, pip install 'rig-service[dask]'"
            raise UsageError(message) from error
        try:
            self._client = distributed.Client(address, timeout=connect_timeout, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise UsageError(
                f"--scheduler {address}: no Dask scheduler answers there ({error}), expected an address such as tcp://host:8786"
            ) from error
        self._as_completed: Callable[..., Iterator[Any]] = distributed.as_completed
        self._killed = distributed.scheduler.KilledWorker

    def run(self, function: Callable[[Task], Result], tasks: Sequence[Task]) -> Iterator[tuple[int, Result]]:
        """Yield each task's index and result; tasks of a worker that dies are repeated by another."""
        futures = [self._client.submit(function, task, pure=False, retries=MAX_RETRIES) for task in tasks]
        numbers = {future.key: number for number, future in enumerate(futures)}
        try:
            for future in self._as_completed(list(futures), loop=self._client.loop):
                try:
                    result = future.result()
                except self._killed as error:
                    raise RigError(
                        f"sweep: a task kills the cluster's workers; finished points are saved ({error})"
                    ) from error
                yield numbers[future.key], result
                future.release()
        finally:
            self._client.cancel([future for future in futures if not future.done()])

    def close(self) -> None:
        """Disconnect from the cluster."""
        self._client.close()


def usable_processors() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def grid(
    parameters: ModelParameters, quantity: str, vary: Mapping[str, Sequence[float]], max_points: int = 10_000_000
) -> list[SweepPoint]:
    """Return the points of all combinations of parameter values, the last name varying fastest.

    Parameters
    ----------
    parameters : ModelParameters
        The fixed parameters.
    quantity : str
        A key of `QUANTITIES`.
    vary : mapping of str to sequence of float
        Values of each varied parameter, by name.
    max_points : int
        Maximum number of points.

    Raises
    ------
    ParameterError
        The quantity is unknown, or the rotor lacks the films for it.
    UsageError
        A name is unknown, or there are too many points.
    """
    names = variable_names(quantity, parameters)
    for name in vary:
        if name not in names:
            raise UsageError(f"vary {name}: unknown, expected one of {', '.join(names)}")
    count = math.prod(map(len, vary.values()))
    if count > max_points:
        raise UsageError(f"sweep: {count:,} points, expected at most {max_points:,}")
    combinations = itertools.product(*([(name, float(value)) for value in values] for name, values in vary.items()))
    return [SweepPoint(parameters, quantity, combination) for combination in combinations]


def run_sweep(
    points: Sequence[SweepPoint], workers: Workers, file: Path, on_progress: Callable[[int, int], None]
) -> list[SweepResult]:
    """Compute the points of a sweep that are not stored yet, and write all results.

    Parameters
    ----------
    points : sequence of SweepPoint
        At least one; all of one quantity, with the same names varied.
    workers : Workers
        Local processes or a cluster.
    file : Path
        ``.parquet``; results in it, or in parts of a stopped sweep next to it, are not computed again.
    on_progress : callable
        Receives the number of points done and the total.

    Returns
    -------
    list of SweepResult
        In the order of the points.
    """
    store = SweepStore(file, QUANTITIES[points[0].quantity].results)
    keys = [point.key() for point in points]
    found = store.load(keys)
    missing = list({key: point for key, point in zip(keys, points, strict=True) if key not in found}.values())
    size = max(1, min(MAX_CHUNK_SIZE, len(missing) // MIN_CHUNKS))
    chunks = [tuple(missing[first : first + size]) for first in range(0, len(missing), size)]
    fresh: list[SweepResult] = []
    saved_at = time.monotonic()
    on_progress(len(found), len(points))
    try:
        for _, outcomes in workers.run(compute_points, chunks):
            fresh += outcomes
            found |= {outcome.key: outcome for outcome in outcomes}
            on_progress(len(found), len(points))
            if time.monotonic() - saved_at >= SAVE_INTERVAL:
                store.save_part(fresh)
                fresh, saved_at = [], time.monotonic()
    finally:
        store.save_part(fresh)
    ordered = [found[key] for key in keys]
    values = {name: [dict(point.values)[name] for point in points] for name, _ in points[0].values}
    store.finish(values, ordered)
    return ordered
