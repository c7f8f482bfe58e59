"""Workers that compute the points of a sweep: local processes or a Dask cluster."""

import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import parent_process
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any, Protocol, TypeVar

from daq.errors import RigError, UsageError
from daq.session.processes import end_process, ignore_terminal_signals, lower_priority, terminal_signals_blocked

Task = TypeVar("Task")
Result = TypeVar("Result")

MAX_RESTARTS = 5  # of broken process pools in a sweep
MAX_RETRIES = 5  # of a task on a cluster whose workers die
CONNECT_TIMEOUT = 10.0  # s
WAIT_INTERVAL = 0.5  # s of one wait: an endless wait blocks Ctrl-C on some platforms


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
        """Yield each task's index and result; a pool is replaced when one of its processes dies."""
        left = dict(enumerate(tasks))
        for _ in range(1 + MAX_RESTARTS):
            pool_context = _PoolContext()
            executor = ProcessPoolExecutor(self._count, mp_context=pool_context, initializer=_start_worker)
            try:
                yield from self._submit_and_collect(executor, function, left)
            except BrokenProcessPool:
                continue
            finally:
                if left:  # running tasks are not waited for: they may take minutes, or hang
                    pool_context.end()
                executor.shutdown(wait=True, cancel_futures=True)
            return
        raise RigError(
            f"sweep: its processes died {1 + MAX_RESTARTS} times without a result; finished points are saved"
        )

    def _submit_and_collect(
        self, executor: ProcessPoolExecutor, function: Callable[[Task], Result], left: dict[int, Task]
    ) -> Iterator[tuple[int, Result]]:
        """Yield results and remove them from `left`; submit only as many tasks as keep the processes busy."""
        waiting = iter(list(left.items()))
        running: dict[Future[Result], int] = {}
        while True:
            while len(running) < 2 * self._count and (following := next(waiting, None)) is not None:
                number, task = following
                running[executor.submit(function, task)] = number
            if not running:
                return
            done, _ = wait(running, WAIT_INTERVAL, return_when=FIRST_COMPLETED)
            for future in done:
                number = running.pop(future)
                result = future.result()
                del left[number]
                yield number, result


class _PoolProcess(SpawnProcess):
    """A process started with terminal signals blocked."""

    def start(self) -> None:
        with terminal_signals_blocked():
            super().start()


class _PoolContext(SpawnContext):
    """A spawn context that records its processes, so that a pool can be terminated."""

    def __init__(self) -> None:
        self._processes: list[_PoolProcess] = []

    def Process(  # type: ignore[override]  # noqa: N802 - the name of the class attribute that it replaces
        self, *arguments: Any, **named: Any
    ) -> _PoolProcess:
        """Return a new process and record it."""
        self._processes.append(_PoolProcess(*arguments, **named))
        return self._processes[-1]

    def end(self) -> None:
        """Terminate all processes."""
        for process in self._processes:
            if process.is_alive():
                end_process(process)


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


def _start_worker() -> None:
    ignore_terminal_signals()
    lower_priority()
    threading.Thread(target=_exit_with_parent, name="parent", daemon=True).start()


def _exit_with_parent() -> None:
    """End this process when its parent has died."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
