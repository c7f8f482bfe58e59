"""Processes of low priority that read recordings: what a request costs is never paid by the process that acquires."""

import multiprocessing
import pickle
import queue
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from enum import Enum
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from types import TracebackType
from typing import Any, Self, TypeVar

from daq.errors import ServiceError
from daq.session.processes import JOIN_TIMEOUT, end_process, leave_signals_to_parent, lower_priority, start_process

T = TypeVar("T")
DEADLINE = 30.0  # s that one piece of work may take
STEPS = 15  # of priority below the acquisition and the live view
LOOK = 0.2  # s between two looks at whether the process is to end
MESSAGE = 30.0  # s that a message may take once it has begun to come; one that takes longer stands still


class WorkerStoppedError(ServiceError):
    """The work was not finished: it took too long, its process went away, or the service ends."""


class WorkerTimeoutError(WorkerStoppedError):
    """The work took too long."""


class _Word(Enum):
    """What a message from the process is."""

    TOLD = "told"
    DONE = "done"
    FAILED = "failed"


class WorkerProcess:
    """One process that does one piece of work at a time; started when first needed, and again where it went away."""

    def __init__(self) -> None:
        self._pipe: Connection | None = None
        self._process: BaseProcess | None = None
        self._ending = threading.Event()

    def run(
        self,
        work: Callable[..., T],
        arguments: tuple[object, ...],
        deadline: float,
        told: Callable[[Any], None] | None = None,
    ) -> T:
        """Return what ``work`` returns there, within ``deadline`` s; what it raises is raised here.

        With ``told``, its first argument there is a callable that takes words on how it goes; they are told here.
        """
        pipe = self._started()
        until = time.monotonic() + deadline
        try:
            pipe.send((work, arguments, told is not None))
            while True:
                self._await(pipe, until, deadline)
                word, content = self._received(pipe)
                if word is not _Word.TOLD:
                    break
                if told is not None:
                    told(content)
        except (OSError, EOFError) as error:
            self._kill()
            raise WorkerStoppedError(f"the reading process went away: {error}") from error
        if word is _Word.FAILED:
            raise content
        done: T = content
        return done

    def _await(self, pipe: Connection, until: float, deadline: float) -> None:
        """Return when there is a message."""
        is_there = False
        while not is_there:
            is_there = pipe.poll(LOOK)
            if self._ending.is_set():
                self._kill()
                raise WorkerStoppedError("the service ends")
            if time.monotonic() > until:
                self._kill()
                raise WorkerTimeoutError(f"not done after {deadline:g} s")

    def _received(self, pipe: Connection) -> tuple[_Word, Any]:
        """Return the message that is there; EOFError or OSError where it stops in its midst."""
        watch = threading.Timer(MESSAGE, self.kill)
        watch.daemon = True
        watch.start()
        try:
            message: tuple[_Word, Any] = pipe.recv()
        finally:
            watch.cancel()
        return message

    def cancel(self) -> None:
        """Give up what is under way; nothing is begun any more."""
        self._ending.set()

    def kill(self) -> None:
        """End the process by force, from any thread; who waits for what it does is told that it went away."""
        process = self._process
        if process is not None:
            process.kill()

    def join(self) -> None:
        """End the process."""
        self._kill()

    def _started(self) -> Connection:
        if self._ending.is_set():
            raise WorkerStoppedError("the service ends")
        if self._pipe is None or self._process is None or not self._process.is_alive():
            self._kill()
            context = multiprocessing.get_context("spawn")  # the same on every platform, and safe beside threads
            pipe, there = context.Pipe()
            process = context.Process(target=_serve, args=(there,), name="rig-reader", daemon=True)
            with there:
                start_process(process)
            self._pipe, self._process = pipe, process
        return self._pipe

    def _kill(self) -> None:
        if self._pipe is not None:
            self._pipe.close()
        if self._process is not None:
            end_process(self._process)
        self._pipe = self._process = None


class WorkerPool:
    """A fixed number of reading processes; who finds them all busy waits.

    Parameters
    ----------
    count : int
        How many.
    deadline : float
        How long one piece of work may take, s.
    """

    def __init__(self, count: int = 1, deadline: float = DEADLINE) -> None:
        self._all = [WorkerProcess() for _ in range(count)]
        self._deadline = deadline
        self._free: queue.SimpleQueue[WorkerProcess] = queue.SimpleQueue()
        for process in self._all:
            self._free.put(process)

    def run(self, work: Callable[..., T], *arguments: object, deadline: float | None = None) -> T:
        """Return what ``work``, a function of a module, returns for ``arguments``, done in one of the processes.

        Parameters
        ----------
        work, *arguments : callable, object
            What is to be done.
        deadline : float or None
            How long it may take, s, where that is another time.

        Raises
        ------
        WorkerStoppedError
            It was not finished.
        """
        process = self._free.get()
        try:
            return process.run(work, arguments, self._deadline if deadline is None else deadline)
        finally:
            self._free.put(process)

    def close(self) -> None:
        """Give up what is under way and end them all."""
        for process in self._all:
            process.cancel()
        ended = self._returned(len(self._all))
        for process in self._all:
            if process not in ended:  # it stands still in the midst of a message
                process.kill()
        for process in ended + self._returned(len(self._all) - len(ended)):
            process.join()
            self._free.put(process)  # whoever waits for it is told that the service ends

    def _returned(self, count: int) -> list[WorkerProcess]:
        """Return the processes that are free in time."""
        free = []
        for _ in range(count):
            with suppress(queue.Empty):
                free.append(self._free.get(timeout=JOIN_TIMEOUT))
        return free

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.close()


def _serve(pipe: Connection) -> None:
    """Do what is asked for until nobody asks any more; the entry point of the process."""
    leave_signals_to_parent()
    lower_priority(STEPS)

    def tell(words: object) -> None:
        pipe.send((_Word.TOLD, words))

    while True:
        try:
            work, arguments, tells = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            answer = (_Word.DONE, work(*((tell,) if tells else ()), *arguments))
        except Exception as error:  # noqa: BLE001 - whatever it is, it is raised where it was asked for
            answer = (_Word.FAILED, _sendable(error))
        try:
            pipe.send(answer)
        except (EOFError, OSError):
            return


def _sendable(error: Exception) -> Exception:
    """Return an error, or what tells of it where it cannot be sent to another process."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301 - what was made here
    except Exception:  # noqa: BLE001 - errors of libraries, in whatever way they cannot be sent
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
