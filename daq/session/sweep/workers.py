"""Who computes a sweep's points: processes of this machine, or a Dask cluster."""

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

RESTARTS = 5  # of broken pools in a sweep, before it is given up
RETRIES = 5  # of a task on a cluster whose workers die
CONNECT_TIME = 10.0  # s
LOOK = 0.5  # s of waiting at a time: a wait without end would not let Ctrl-C through everywhere


class Workers(Protocol):
    """Computes tasks somewhere, each alike wherever that is."""

    def run(self, function: Callable[[Task], Result], tasks: Sequence[Task]) -> Iterator[tuple[int, Result]]:
        """Yield each task's number and result as it is done, in any order."""
        ...


class LocalWorkers:
    """Processes of this machine.

    Parameters
    ----------
    count : int, optional
        How many; one for each processor that may be used where it is not given.
    """

    def __init__(self, count: int | None = None) -> None:
        self._count = (usable_processors() if count is None else count) or 1

    def run(self, function: Callable[[Task], Result], tasks: Sequence[Task]) -> Iterator[tuple[int, Result]]:
        """Yield each task's number and result; a pool whose process dies is replaced."""
        left = dict(enumerate(tasks))
        for _ in range(1 + RESTARTS):
            crew = _Crew()
            executor = ProcessPoolExecutor(self._count, mp_context=crew, initializer=_begin)
            try:
                yield from self._finish(executor, function, left)
            except BrokenProcessPool:
                continue
            finally:
                if left:  # what is under way is not waited for: it may take minutes, or stand still
                    crew.end()
                executor.shutdown(wait=True, cancel_futures=True)
            return
        raise RigError(f"sweep: its processes ended {1 + RESTARTS} times without a result; what is done is kept")

    def _finish(
        self, executor: ProcessPoolExecutor, function: Callable[[Task], Result], left: dict[int, Task]
    ) -> Iterator[tuple[int, Result]]:
        """Yield results and take them from what is left, with no more tasks in the queue than keep it full."""
        waiting = iter(list(left.items()))
        running: dict[Future[Result], int] = {}
        while True:
            while len(running) < 2 * self._count and (following := next(waiting, None)) is not None:
                number, task = following
                running[executor.submit(function, task)] = number
            if not running:
                return
            done, _ = wait(running, LOOK, return_when=FIRST_COMPLETED)
            for future in done:
                number = running.pop(future)
                result = future.result()
                del left[number]
                yield number, result


class _Member(SpawnProcess):
    """A process that is out of reach of the terminal when it is started."""

    def start(self) -> None:
        with terminal_signals_blocked():
            super().start()


class _Crew(SpawnContext):
    """The processes of a pool, so that it can be ended whatever they do."""

    def __init__(self) -> None:
        self._members: list[_Member] = []

    def Process(  # type: ignore[override]  # noqa: N802 - called as the class that stands there otherwise
        self, *arguments: Any, **named: Any
    ) -> _Member:
        """Return a new process."""
        self._members.append(_Member(*arguments, **named))
        return self._members[-1]

    def end(self) -> None:
        """End them all."""
        for member in self._members:
            if member.is_alive():
                end_process(member)


class DaskWorkers:
    """A Dask cluster, whose workers have this package installed.

    Parameters
    ----------
    address : str
        Of its scheduler, as tcp://host:8786.
    connect_time : float
        How long it may take to answer, s.

    Raises
    ------
    UsageError
        Where the extra is not installed or nobody answers at the address.
    """

    def __init__(self, address: str, connect_time: float = CONNECT_TIME) -> None:
        try:
            import distributed  # noqa: PLC0415  # an extra, slow to import
        except ImportError as error:
            message = "a cluster needs Dask: install the extra, pip install 'rig-service[dask]'"
            raise UsageError(message) from error
        try:
            self._client = distributed.Client(address, timeout=connect_time, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise UsageError(
                f"--scheduler {address}: no Dask scheduler answers there ({error}), expected one as tcp://host:8786"
            ) from error
        self._as_completed: Callable[..., Iterator[Any]] = distributed.as_completed
        self._killed = distributed.scheduler.KilledWorker

    def run(self, function: Callable[[Task], Result], tasks: Sequence[Task]) -> Iterator[tuple[int, Result]]:
        """Yield each task's number and result; tasks of a worker that dies are given to another."""
        futures = [self._client.submit(function, task, pure=False, retries=RETRIES) for task in tasks]
        numbers = {future.key: number for number, future in enumerate(futures)}
        try:
            for future in self._as_completed(list(futures), loop=self._client.loop):
                try:
                    result = future.result()
                except self._killed as error:
                    raise RigError(f"sweep: the cluster's workers die of it; what is done is kept ({error})") from error
                yield numbers[future.key], result
                future.release()
        finally:
            self._client.cancel([future for future in futures if not future.done()])

    def close(self) -> None:
        """Leave the cluster."""
        self._client.close()


def usable_processors() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _begin() -> None:
    ignore_terminal_signals()
    lower_priority()
    threading.Thread(target=_leave_with_parent, name="parent", daemon=True).start()


def _leave_with_parent() -> None:
    """End this process when the one that gives it work has gone without a word."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
