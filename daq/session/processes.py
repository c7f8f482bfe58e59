"""Child processes with low priority that Ctrl-C does not end, and workers that run one function at a time in one."""

import ctypes
import multiprocessing
import os
import pickle
import queue
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from enum import Enum
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import TypeVar

from daq.errors import RigError

ResultT = TypeVar("ResultT")
UNLIMITED = threading.TIMEOUT_MAX  # s
JOIN_TIMEOUT = 2.0  # s that a process has to end by itself
SHUTTING_DOWN = "the program is shutting down"
_BELOW_NORMAL_PRIORITY_CLASS = 0x4000  # of the Windows API
# The terminal sends these to all its processes. SIGHUP: POSIX only; SIGBREAK: Windows only.
_TERMINAL_SIGNALS = ("SIGINT", "SIGHUP", "SIGBREAK")


def lower_priority(steps: int) -> None:
    """Lower the priority of this process.

    Parameters
    ----------
    steps : int
        Increase of the niceness, 1 to 19. Windows has a single step.
    """
    if sys.platform == "win32":
        kernel = ctypes.windll.kernel32
        kernel.SetPriorityClass(kernel.GetCurrentProcess(), _BELOW_NORMAL_PRIORITY_CLASS)
    else:
        os.nice(steps)


@contextmanager
def terminal_signals_blocked() -> Iterator[None]:
    """Block terminal signals in processes started here until they call `ignore_terminal_signals`.

    Without this, Ctrl-C ends a process that is still importing with a traceback. On Windows it does.
    """
    if sys.platform == "win32":
        yield
        return
    from multiprocessing.resource_tracker import ensure_running  # noqa: PLC0415 - POSIX only

    blocked = {getattr(signal, name) for name in _TERMINAL_SIGNALS if hasattr(signal, name)}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, blocked)
    try:
        ensure_running()  # otherwise the first process start runs it, and it unblocks the signals
        signal.pthread_sigmask(signal.SIG_BLOCK, blocked)
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def ignore_terminal_signals() -> None:
    """Ignore Ctrl-C and a closed terminal in this process: the parent decides what they mean."""
    for name in _TERMINAL_SIGNALS:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)


def end_process(process: BaseProcess) -> None:
    """Terminate a started process and join it; kill it where it does not end, for example because it is suspended."""
    process.terminate()
    process.join(JOIN_TIMEOUT)
    if process.is_alive():
        process.kill()
        process.join(JOIN_TIMEOUT)


class WorkerStoppedError(RigError):
    """The function did not finish: time limit exceeded, worker process died, or program shutting down."""


class WorkerTimeoutError(WorkerStoppedError):
    """The function exceeded its time limit."""


class _MessageType(Enum):
    """Type of a message from a worker process."""

    PROGRESS = "progress"
    DONE = "done"
    FAILED = "failed"


class WorkerProcess:
    """A low-priority process that runs one function at a time; started on first use, and again after it has ended.

    Parameters
    ----------
    niceness : int
        Increase of the niceness of the process.

    Notes
    -----
    No library has it all: `concurrent.futures` and loky cannot end a single call, `anyio.to_process` needs an event
    loop and leaves Ctrl-C to the worker, pebble has another licence (LGPL); none of them reports progress, or ends a
    worker that is computing when its parent is killed.
    """

    def __init__(self, niceness: int) -> None:
        self._niceness = niceness
        self._changing = threading.Lock()
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None
        self._is_closed = False

    def run(
        self,
        function: Callable[..., ResultT],
        *arguments: object,
        time_limit: float = UNLIMITED,
        on_progress: Callable[..., None] | None = None,
    ) -> ResultT:
        """Return the result of a module-level function, run in the process; re-raise its exception.

        Parameters
        ----------
        function, *arguments : callable, object
            The function and its arguments; all can be pickled.
        time_limit : float
            Time limit, s; the process is ended after it.
        on_progress : callable or None
            Receives what the function reports, whose first argument is then a callable that sends its arguments here.

        Raises
        ------
        WorkerStoppedError
            The function did not finish.
        """
        pipe = self._started()
        expired = threading.Event()

        def expire() -> None:
            expired.set()
            self.kill()

        timer = threading.Timer(time_limit, expire)  # also where the process stops in the middle of a message
        timer.daemon = True
        timer.start()
        death: Exception | None = None
        try:
            pipe.send((function, arguments, on_progress is not None))
            message_type, content = pipe.recv()
            while message_type is _MessageType.PROGRESS and on_progress is not None:
                on_progress(*content)
                message_type, content = pipe.recv()
        except (OSError, EOFError) as error:
            self.kill()  # it may be about to end
            death = error
        finally:
            timer.cancel()
        # In these cases also a message that did arrive is worthless: compilers swallow the exit that SIGTERM requests.
        if expired.is_set():
            raise WorkerTimeoutError(f"not done after {time_limit:g} s") from death
        if self._is_closed:
            raise WorkerStoppedError(SHUTTING_DOWN) from death
        if death is not None:
            raise WorkerStoppedError("the worker process died") from death
        if message_type is _MessageType.FAILED:
            raise content
        result: ResultT = content
        return result

    def _started(self) -> Connection:
        """Return the pipe to the process, which is started unless it runs."""
        with self._changing:
            if self._is_closed:
                raise WorkerStoppedError(SHUTTING_DOWN)
            if self._pipe is None or self._process is None or not self._process.is_alive():
                context = multiprocessing.get_context("spawn")  # the same on every platform, and safe beside threads
                self._pipe, theirs = context.Pipe()
                process = context.Process(target=_work, args=(theirs, self._niceness), name="rig-worker", daemon=True)
                with theirs, terminal_signals_blocked():
                    process.start()
                self._process = process
            return self._pipe

    def kill(self) -> None:
        """End the process, from any thread; a function that it runs raises WorkerStoppedError in `run`."""
        with self._changing:
            if self._process is not None:
                end_process(self._process)
                self._process = None

    def close(self) -> None:
        """End the process and refuse further functions."""
        self._is_closed = True
        self.kill()


class WorkerPool:
    """A fixed number of worker processes; callers wait for an idle one. Close it.

    Parameters
    ----------
    count, niceness : int
        Number of processes, and the increase of their niceness.
    time_limit : float
        Time limit of one function call, s.
    """

    def __init__(self, count: int, niceness: int, time_limit: float = UNLIMITED) -> None:
        self._workers = [WorkerProcess(niceness) for _ in range(count)]
        self._time_limit = time_limit
        self._idle: queue.SimpleQueue[WorkerProcess] = queue.SimpleQueue()
        for worker in self._workers:
            self._idle.put(worker)

    def run(self, function: Callable[..., ResultT], *arguments: object, time_limit: float | None = None) -> ResultT:
        """Return the result of ``function``, run in one of the processes, as `WorkerProcess.run` does.

        Parameters
        ----------
        function, *arguments : callable, object
            The function and its arguments.
        time_limit : float or None
            Time limit, s; None for that of the pool.
        """
        worker = self._idle.get()
        try:
            return worker.run(function, *arguments, time_limit=self._time_limit if time_limit is None else time_limit)
        finally:
            self._idle.put(worker)

    def close(self) -> None:
        """End all processes and refuse further functions."""
        with ThreadPoolExecutor(len(self._workers)) as threads:  # each may take seconds
            threads.map(WorkerProcess.close, self._workers)


def _work(pipe: Connection, niceness: int) -> None:
    """Run received functions until the pipe closes: the entry point of a worker process."""
    ignore_terminal_signals()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # cleans up
    lower_priority(niceness)
    threading.Thread(target=_exit_with_parent, name="parent", daemon=True).start()

    def report_progress(*progress: object) -> None:
        pipe.send((_MessageType.PROGRESS, progress))

    with suppress(EOFError, OSError):
        while True:
            function, arguments, reports_progress = pipe.recv()
            try:
                message = (_MessageType.DONE, function(*((report_progress,) if reports_progress else ()), *arguments))
            except Exception as error:  # noqa: BLE001 - re-raised in the calling process
                message = (_MessageType.FAILED, _picklable_with_traceback(error))
            pipe.send(message)


def _exit_with_parent() -> None:
    """End this process when its parent has died."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


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
