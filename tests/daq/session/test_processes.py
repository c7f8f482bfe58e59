"""Worker processes: results, exceptions, time limits and shutdown."""

import gc
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from multiprocessing.connection import Connection

import psutil
import pytest

from daq.errors import ConfigError, DeviceError, DeviceFault
from daq.reports.errors import translated_errors
from daq.session.processes import WorkerPool, WorkerProcess, WorkerStoppedError, WorkerTimeoutError
from model.rotor.tables import TableError
from recordings.errors import DamagedError

PATIENCE = 60.0  # s: a process starts
NICENESS = 7


def wait_until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.fixture
def processes() -> Iterator[WorkerPool]:
    with closing(WorkerPool(1, NICENESS, time_limit=PATIENCE)) as started:
        yield started


def fail(message: str) -> None:
    raise DamagedError(message)


def test_function_runs_in_another_process_with_lower_priority(processes: WorkerPool) -> None:
    assert processes.run(os.getpid) != os.getpid()
    if sys.platform != "win32":
        assert processes.run(os.nice, 0) == os.nice(0) + NICENESS


def test_process_is_reused_for_the_next_function(processes: WorkerPool) -> None:
    assert processes.run(os.getpid) == processes.run(os.getpid)


def test_exception_is_raised_in_the_caller(processes: WorkerPool) -> None:
    with pytest.raises(DamagedError, match=r"r\.mcap"):
        processes.run(fail, "r.mcap: cut")
    assert processes.run(len, "abc") == 3


class UnpicklableError(Exception):
    """Exception that cannot be unpickled: its constructor takes two arguments."""

    def __init__(self, file: str, line: int) -> None:
        super().__init__(f"{file}: line {line}")


def wrong_configuration() -> None:
    raise ConfigError("rig.toml", ["one", "two"])


def wrong_rotor() -> None:
    raise TableError(["one", "two"])


def wrong_device() -> None:
    raise DeviceError(DeviceFault.BUSY, "Dev1 is in use", -50103)


def unpicklable_error() -> None:
    raise UnpicklableError("rig.toml", 7)


@pytest.mark.parametrize(
    ("work", "error", "words"),
    [
        (wrong_configuration, ConfigError, "rig.toml: 2 errors\n  one\n  two"),
        (wrong_rotor, TableError, "one; two"),
        (wrong_device, DeviceError, "Dev1 is in use (driver code -50103)"),
        (unpicklable_error, RuntimeError, "UnpicklableError: rig.toml: line 7"),
    ],
)
def test_error_keeps_its_type_and_text(
    processes: WorkerPool, work: Callable[[], None], error: type[Exception], words: str
) -> None:
    with pytest.raises(error) as raised:
        processes.run(work)
    assert str(raised.value) == words


def defective() -> None:
    with translated_errors("run r"):
        raise ValueError("a defect")


def test_defect_keeps_its_type_and_the_traceback_of_the_worker(processes: WorkerPool) -> None:
    with pytest.raises(ValueError, match="a defect") as raised:
        processes.run(defective)
    assert "in defective" in "".join(raised.value.__notes__)


def test_dead_process_is_reported_and_replaced(processes: WorkerPool) -> None:
    with pytest.raises(WorkerStoppedError):
        processes.run(os._exit, 3)
    assert processes.run(len, "abc") == 3


def test_function_is_cancelled_at_its_time_limit() -> None:
    with closing(WorkerPool(1, NICENESS, time_limit=PATIENCE)) as processes:
        processes.run(len, "")  # starts the process, which the time limit below excludes
        processes._time_limit = 0.5
        with pytest.raises(WorkerTimeoutError, match=r"0\.5 s"):
            processes.run(time.sleep, 60.0)
        assert processes.run(time.sleep, 0.6, time_limit=PATIENCE) is None


def count(report: Callable[[int], None], numbers: int) -> str:
    for number in range(numbers):
        report(number)
    return "done"


def test_function_reports_progress() -> None:
    process, progress = WorkerProcess(NICENESS), list[int]()
    assert process.run(count, 3, time_limit=PATIENCE, on_progress=progress.append) == "done"
    assert progress == [0, 1, 2]
    process.close()


def report_continually(report: Callable[[int], None]) -> None:
    while True:
        report(0)
        time.sleep(0.01)


def test_time_limit_holds_while_progress_arrives_continually() -> None:
    process = WorkerProcess(NICENESS)
    process.run(count, 1, on_progress=lambda _: None)
    with pytest.raises(WorkerTimeoutError):
        process.run(report_continually, time_limit=0.5, on_progress=lambda _: None)


def test_close_cancels_running_functions() -> None:
    processes = WorkerPool(1, NICENESS, time_limit=60.0)
    processes.run(len, "")
    progress: list[str] = []

    def wait() -> None:
        try:
            processes.run(time.sleep, 60.0)
        except WorkerStoppedError as error:
            progress.append(str(error))

    threads = [threading.Thread(target=wait) for _ in range(2)]
    for thread in threads:
        thread.start()
    wait_until(processes._idle.empty)
    processes.close()
    for thread in threads:
        thread.join(PATIENCE)
    assert progress == ["the program is shutting down"] * 2


def fail_when_terminated() -> None:
    try:
        time.sleep(60.0)
    except SystemExit as error:  # as numba does while it compiles
        raise ValueError("half done") from error


@pytest.mark.skipif(sys.platform == "win32", reason="no such signal there")
def test_function_that_swallows_its_termination_exceeds_its_time_limit() -> None:
    process = WorkerProcess(NICENESS)
    process.run(len, "")
    with pytest.raises(WorkerTimeoutError):
        process.run(fail_when_terminated, time_limit=0.5)
    assert process.run(len, "abc") == 3
    process.close()


def hang() -> None:
    os.kill(os.getpid(), signal.SIGSTOP)


def hang_in_the_middle_of_a_message() -> None:
    (pipe,) = (one for one in gc.get_objects() if isinstance(one, Connection))
    os.write(pipe.fileno(), (1 << 20).to_bytes(4, "big") + bytes(1000))
    hang()


@pytest.mark.skipif(sys.platform == "win32", reason="no such signal there")
def test_hung_process_is_killed_at_its_time_limit() -> None:
    process = WorkerProcess(NICENESS)
    process.run(len, "")
    child = process._process
    assert child is not None
    with pytest.raises(WorkerTimeoutError):
        process.run(hang, time_limit=0.1)
    assert not child.is_alive()
    with pytest.raises(WorkerTimeoutError):
        process.run(hang_in_the_middle_of_a_message, time_limit=5.0)
    process.close()


@pytest.mark.skipif(sys.platform == "win32", reason="no such signal there")
def test_close_kills_a_process_that_hangs_in_the_middle_of_a_message() -> None:
    processes = WorkerPool(1, NICENESS, time_limit=PATIENCE)
    progress: list[str] = []

    def wait() -> None:
        try:
            processes.run(hang_in_the_middle_of_a_message)
        except WorkerStoppedError as error:
            progress.append(str(error))

    thread = threading.Thread(target=wait)
    thread.start()
    (process,) = processes._workers
    wait_until(lambda: process._process is not None and psutil.Process(process._process.pid).status() == "stopped")
    child = process._process
    assert child is not None
    processes.close()
    thread.join(PATIENCE)
    assert len(progress) == 1  # the death of the process or the shutdown, whichever the waiting thread notices first
    assert not child.is_alive()
