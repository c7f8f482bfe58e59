"""Low-priority worker processes that read recordings, so that requests cost the acquiring process no time."""

import multiprocessing
import pickle
import queue
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from enum import Enum
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from types import TracebackType
from typing import Any, Self, TypeVar

from daq.errors import ServiceError
from daq.session.processes import JOIN_TIMEOUT, end_process, leave_signals_to_parent, lower_priority, start_process

ResultT = TypeVar("ResultT")
TIME_LIMIT = 30.0  # s for one function call
NICE_INCREMENT = 15  # of priority below the acquisition and the live view
POLL_INTERVAL = 0.2  # s between two checks for cancellation
MESSAGE_TIMEOUT = (
    30.0  # s for the rest of a message once it has started to arrive; after that the worker counts as hung
)


class WorkerStoppedError(ServiceError):
    """The function did not finish: time limit exceeded, worker process died, or service shutting down."""


class WorkerTimeoutError(WorkerStoppedError):
    """The function exceeded its time limit."""


class _MessageType(Enum):
    """Type of a message from a worker process."""

    PROGRESS = "progress"
    DONE = "done"
    FAILED = "failed"


class WorkerProcess:
    """One process that runs one function at a time; started on first use, and restarted if it has died."""

    def __init__(self) -> None:
        self._pipe: Connection | None = None
        self._process: BaseProcess | None = None
        self._is_cancelled = threading.Event()

    def run(
        self,
        function: Callable[..., ResultT],
        arguments: tuple[object, ...],
        time_limit: float,
        on_progress: Callable[[Any], None] | None = None,
    ) -> ResultT:
        """Return the result of ``function``, run in the process within ``time_limit`` s; re-raise its exception.

        With ``on_progress``, the function's first argument is a callable; what it is called with is passed on here.
        """
        pipe = self._ensure_started()
        end_time = time.monotonic() + time_limit
        with self._stopped_on_pipe_errors():
            pipe.send((function, arguments, on_progress is not None))
        while True:
            with self._stopped_on_pipe_errors():
                self._wait_for_message(pipe, end_time, time_limit)
                message_type, content = self._receive(pipe)
            if message_type is not _MessageType.PROGRESS:
                break
            if on_progress is not None:
                on_progress(content)
        if message_type is _MessageType.FAILED:
            raise content
        done: ResultT = content
        return done

    @contextmanager
    def _stopped_on_pipe_errors(self) -> Iterator[None]:
        """Stop the process and raise WorkerStoppedError where the pipe to it fails."""
        try:
            yield
        except (OSError, EOFError) as error:
            self.stop()
            raise WorkerStoppedError(f"the worker process died: {error}") from error

    def _wait_for_message(self, pipe: Connection, end_time: float, time_limit: float) -> None:
        """Wait until a message arrives."""
        is_there = False
        while not is_there:
            is_there = pipe.poll(POLL_INTERVAL)
            if self._is_cancelled.is_set():
                self.stop()
                raise WorkerStoppedError("the service is shutting down")
            if time.monotonic() > end_time:
                self.stop()
                raise WorkerTimeoutError(f"not done after {time_limit:g} s")

    def _receive(self, pipe: Connection) -> tuple[_MessageType, Any]:
        """Return the arriving message; EOFError or OSError if it stops half way."""
        watch = threading.Timer(MESSAGE_TIMEOUT, self.kill)
        watch.daemon = True
        watch.start()
        try:
            message: tuple[_MessageType, Any] = pipe.recv()
        finally:
            watch.cancel()
        return message

    def cancel(self) -> None:
        """Cancel the running function and refuse further ones."""
        self._is_cancelled.set()

    def kill(self) -> None:
        """Kill the process, from any thread; a waiting `run` raises WorkerStoppedError."""
        process = self._process
        if process is not None:
            process.kill()

    def _ensure_started(self) -> Connection:
        if self._is_cancelled.is_set():
            raise WorkerStoppedError("the service is shutting down")
        if self._pipe is None or self._process is None or not self._process.is_alive():
            self.stop()
            context = multiprocessing.get_context("spawn")  # the same on every platform, and safe beside threads
            pipe, child_pipe = context.Pipe()
            process = context.Process(target=_run_worker, args=(child_pipe,), name="rig-worker", daemon=True)
            with child_pipe:
                start_process(process)
            self._pipe, self._process = pipe, process
        return self._pipe

    def stop(self) -> None:
        """Stop the process."""
        if self._pipe is not None:
            self._pipe.close()
        if self._process is not None:
            end_process(self._process)
        self._pipe = self._process = None


class WorkerPool:
    """A fixed number of worker processes; callers wait for an idle one.

    Parameters
    ----------
    count : int
        Number of processes.
    time_limit : float
        Time limit of one function call, s.
    """

    def __init__(self, count: int = 1, time_limit: float = TIME_LIMIT) -> None:
        self._workers = [WorkerProcess() for _ in range(count)]
        self._time_limit = time_limit
        self._idle: queue.SimpleQueue[WorkerProcess] = queue.SimpleQueue()
        for process in self._workers:
            self._idle.put(process)

    def run(self, function: Callable[..., ResultT], *arguments: object, time_limit: float | None = None) -> ResultT:
        """Return the result of ``function``, a module-level function, run in one of the processes.

        Parameters
        ----------
        function, *arguments : callable, object
            The function and its arguments.
        time_limit : float or None
            Time limit, s; None for that of the pool.

        Raises
        ------
        WorkerStoppedError
            The function did not finish.
        """
        process = self._idle.get()
        try:
            return process.run(function, arguments, self._time_limit if time_limit is None else time_limit)
        finally:
            self._idle.put(process)

    def close(self) -> None:
        """Cancel running functions and stop all processes."""
        for process in self._workers:
            process.cancel()
        finished = self._collect_idle(len(self._workers))
        for process in self._workers:
            if process not in finished:  # it hangs in the middle of a message
                process.kill()
        for process in finished + self._collect_idle(len(self._workers) - len(finished)):
            process.stop()
            self._idle.put(process)  # a caller that waits for it then raises WorkerStoppedError

    def _collect_idle(self, count: int) -> list[WorkerProcess]:
        """Return the processes that become idle within JOIN_TIMEOUT."""
        free = []
        for _ in range(count):
            with suppress(queue.Empty):
                free.append(self._idle.get(timeout=JOIN_TIMEOUT))
        return free

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.close()


def _run_worker(pipe: Connection) -> None:
    """Run received functions until the pipe closes: the entry point of a worker process."""
    leave_signals_to_parent()
    lower_priority(NICE_INCREMENT)

    def report_progress(progress: object) -> None:
        pipe.send((_MessageType.PROGRESS, progress))

    while True:
        try:
            function, arguments, reports_progress = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            message = (_MessageType.DONE, function(*((report_progress,) if reports_progress else ()), *arguments))
        except Exception as error:  # noqa: BLE001 - re-raised in the calling process
            message = (_MessageType.FAILED, _picklable_with_traceback(error))
        try:
            pipe.send(message)
        except (EOFError, OSError):
            return


def _picklable_with_traceback(error: Exception) -> Exception:
    """Return an error, or a RuntimeError with its text if it cannot be pickled; a note holds the traceback.

    Pickling drops the traceback, without which the log of a defect does not show where it is.
    """
    lines = "".join(traceback.format_exception(error))
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301 - pickled in the same line
    except Exception:  # noqa: BLE001 - pickling errors of foreign exceptions are of any type
        error = RuntimeError(f"{type(error).__name__}: {error}")
    error.add_note(f"In the worker process:\n{lines}")
    return error
