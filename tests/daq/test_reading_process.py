"""Processes that read for the service: what they return, what they raise, and that they end."""

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from daq.service.reading_process import OverdueError, ReadingProcess, ReadingProcesses, ReadingStoppedError
from recordings.errors import DamagedError


@pytest.fixture
def processes() -> Iterator[ReadingProcesses]:
    with ReadingProcesses(1, deadline=20.0) as started:
        yield started


def fail(message: str) -> None:
    raise DamagedError(message)


def test_work_is_done_elsewhere_with_less_priority(processes: ReadingProcesses) -> None:
    assert processes.run(os.getpid) != os.getpid()
    if sys.platform != "win32":
        assert processes.run(os.nice, 0) > os.nice(0)


def test_process_is_the_same_from_one_piece_of_work_to_the_next(processes: ReadingProcesses) -> None:
    assert processes.run(os.getpid) == processes.run(os.getpid)


def test_what_the_work_raises_is_raised_where_it_was_asked_for(processes: ReadingProcesses) -> None:
    with pytest.raises(DamagedError, match=r"r\.mcap"):
        processes.run(fail, "r.mcap: cut")
    assert processes.run(len, "abc") == 3


def test_process_that_goes_away_is_told_and_replaced(processes: ReadingProcesses) -> None:
    with pytest.raises(ReadingStoppedError):
        processes.run(os._exit, 3)
    assert processes.run(len, "abc") == 3


def test_work_that_takes_too_long_is_given_up() -> None:
    with ReadingProcesses(1, deadline=20.0) as processes:
        processes.run(len, "")  # begun, so that the deadline below is the work's alone
        processes._deadline = 0.5
        with pytest.raises(OverdueError, match=r"0\.5 s"):
            processes.run(time.sleep, 60.0)
        assert processes.run(time.sleep, 0.6, deadline=10.0) is None


def count(tell: Callable[[int], None], numbers: int) -> str:
    for number in range(numbers):
        tell(number)
    return "done"


def test_work_tells_how_it_goes() -> None:
    process, told = ReadingProcess(), list[int]()
    assert process.run(count, (3,), 20.0, told.append) == "done"
    assert told == [0, 1, 2]
    process.join()


def chatter(tell: Callable[[int], None]) -> None:
    while True:
        tell(0)
        time.sleep(0.01)


def test_work_that_talks_and_talks_is_given_up_in_time() -> None:
    process = ReadingProcess()
    process.run(count, (1,), 20.0, lambda _: None)
    with pytest.raises(OverdueError):
        process.run(chatter, (), 0.5, lambda _: None)


def test_closing_gives_up_what_is_under_way() -> None:
    processes = ReadingProcesses(1, deadline=60.0)
    processes.run(len, "")
    told: list[str] = []

    def wait() -> None:
        try:
            processes.run(time.sleep, 60.0)
        except ReadingStoppedError as error:
            told.append(str(error))

    threads = [threading.Thread(target=wait) for _ in range(2)]
    for thread in threads:
        thread.start()
    time.sleep(0.5)
    begun = time.monotonic()
    processes.close()
    for thread in threads:
        thread.join(10.0)
    assert time.monotonic() - begun < 5.0
    assert told == ["the service ends"] * 2
