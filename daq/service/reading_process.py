"""Processes of low priority that read recordings: what a request costs is never paid by the process that acquires."""

import multiprocessing
import queue
import signal
import threading
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from types import TracebackType
from typing import Self, TypeVar

from daq.errors import ServiceError
from daq.session.priority import give_way

T = TypeVar("T")
DEADLINE = 300.0  # s that one piece of work may take
STEPS = 15  # of priority below the acquisition and the live view
LOOK = 0.2  # s between two looks at whether the process is to end
JOIN_TIME = 2.0  # s


class ReadingStoppedError(ServiceError):
    """The work was not finished: it took too long, its process went away, or the service ends."""


class ReadingProcess:
    """One process that does one piece of work at a time; started when first needed, and again where it went away."""

    def __init__(self) -> None:
        self._pipe: Connection | None = None
        self._process: BaseProcess | None = None
        self._ending = threading.Event()

    def run(self, work: Callable[..., T], arguments: tuple[object, ...], deadline: float) -> T:
        """Return what ``work`` returns there, within ``deadline`` s; what it raises is raised here."""
        pipe = self._started()
        try:
            pipe.send((work, arguments))
            self._await(pipe, deadline)
            is_well, result = pipe.recv()
        except (OSError, EOFError) as error:
            self._kill()
            raise ReadingStoppedError(f"the reading process went away: {error}") from error
        if not is_well:
            raise result
        done: T = result
        return done

    def _await(self, pipe: Connection, deadline: float) -> None:
        waited = 0.0
        while not pipe.poll(LOOK):
            waited += LOOK
            if self._ending.is_set() or waited > deadline:
                self._kill()
                raise ReadingStoppedError(
                    "the service ends" if self._ending.is_set() else f"not done after {deadline:g} s"
                )

    def end(self) -> None:
        """Give up what is under way; nothing is begun any more."""
        self._ending.set()

    def join(self) -> None:
        """End the process."""
        self._kill()

    def _started(self) -> Connection:
        if self._ending.is_set():
            raise ReadingStoppedError("the service ends")
        if self._pipe is None or self._process is None or not self._process.is_alive():
            self._kill()
            context = multiprocessing.get_context("spawn")  # the same on every platform, and safe beside threads
            self._pipe, there = context.Pipe()
            self._process = context.Process(target=_serve, args=(there,), name="rig-reader", daemon=True)
            self._process.start()
            there.close()
        return self._pipe

    def _kill(self) -> None:
        if self._pipe is not None:
            self._pipe.close()
        if self._process is not None:
            self._process.terminate()
            self._process.join(JOIN_TIME)
        self._pipe = self._process = None


class ReadingProcesses:
    """A fixed number of reading processes; who finds them all busy waits.

    Parameters
    ----------
    count : int
        How many.
    deadline : float
        How long one piece of work may take, s.
    """

    def __init__(self, count: int = 1, deadline: float = DEADLINE) -> None:
        self._all = [ReadingProcess() for _ in range(count)]
        self._deadline = deadline
        self._free: queue.SimpleQueue[ReadingProcess] = queue.SimpleQueue()
        for process in self._all:
            self._free.put(process)

    def run(self, work: Callable[..., T], *arguments: object) -> T:
        """Return what ``work``, a function of a module, returns for ``arguments``, done in one of the processes.

        Raises
        ------
        ReadingStoppedError
            It was not finished.
        """
        process = self._free.get()
        try:
            return process.run(work, arguments, self._deadline)
        finally:
            self._free.put(process)

    def close(self) -> None:
        """Give up what is under way and end them all."""
        for process in self._all:
            process.end()
        ended = []
        for _ in self._all:
            with suppress(queue.Empty):  # one that does not come back ends with the program
                ended.append(self._free.get(timeout=JOIN_TIME))
        for process in ended:
            process.join()
            self._free.put(process)  # whoever waits for it is told that the service ends

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.close()


def _serve(pipe: Connection) -> None:
    """Do what is asked for until nobody asks any more; the entry point of the process."""
    for name in ("SIGINT", "SIGHUP", "SIGBREAK"):  # the asking process decides; SIGHUP: POSIX only, SIGBREAK: Windows
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    give_way(STEPS)
    while True:
        try:
            work, arguments = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            answer = (True, work(*arguments))
        except Exception as error:  # noqa: BLE001 - whatever it is, it is raised where it was asked for
            answer = (False, error)
        try:
            pipe.send(answer)
        except (EOFError, OSError):
            return
