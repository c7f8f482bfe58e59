"""Stop requests at any time, and a recorder that ignores them."""

import os
import signal
import sys
import threading
from collections.abc import Callable
from multiprocessing import get_context
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from daq.config.rig import Rig
from daq.session.recording.messages import MessageSender
from daq.session.recording.recorded_run import RecordedRun
from daq.stop_flag import StopFlag
from recordings.mcap.reader import RunReader
from tests.daq.support.recording import NoModel, recording_request

RigFactory = Callable[..., Rig]

LONG = {"profile": [{"time_s": 0, "speed_rpm": 6000}, {"time_s": 60, "speed_rpm": 6000}], "pace": "real time"}
POSIX = pytest.mark.skipif(sys.platform == "win32", reason="signals that freeze a process, of POSIX")


class Interrupted(threading.Thread):
    """A thread that waits for a flag, which a trace function sets before the n-th instruction of the wait."""

    def __init__(self, n: int) -> None:
        super().__init__(daemon=True)
        self._left = n
        self._flag = StopFlag()
        self.was_interrupted = self.was_set = False

    def run(self) -> None:
        sys.settrace(self._trace)
        self.was_set = self._flag.wait(0.001)
        sys.settrace(None)

    def _trace(self, frame: FrameType, event: str, _argument: Any) -> Any:  # as `sys.settrace` has it
        frame.f_trace_opcodes = True
        if event == "opcode" and not self.was_interrupted:
            self._left -= 1
            if self._left < 0:
                self.was_interrupted = True
                self._flag.set()
        return self._trace


def test_stop_may_be_requested_between_any_two_instructions_of_a_wait() -> None:
    for n in range(1000):
        waiting = Interrupted(n)
        waiting.start()
        waiting.join(10)
        assert not waiting.is_alive(), f"hangs where it is interrupted at instruction {n}"
        if not waiting.was_interrupted:
            assert n > 20
            return
    pytest.fail("the wait has no end")


def test_wait_ends_as_soon_as_the_flag_is_set() -> None:
    flag = StopFlag()
    assert not flag.wait(0.0)
    threading.Timer(0.1, flag.set).start()
    assert flag.wait(60.0)


@POSIX
def test_recorder_that_ignores_the_stop_is_killed_and_its_file_is_readable(rig: RigFactory, tmp_path: Path) -> None:
    run = RecordedRun(recording_request(rig(simulation=LONG), tmp_path), NoModel(), stop_deadline=0.5)
    while run.latest().status.samples < 30_000:
        assert not run.wait(0.05)
    os.kill(run._process.pid or 0, signal.SIGSTOP)
    run.stop()
    assert run.wait(60)
    outcome = run.close()
    assert outcome.exit_code == 5
    assert (
        outcome.message == "the recorder did not stop within 0.5 s and was killed; its file holds all flushed samples"
    )
    with RunReader(run.path) as reader:
        assert not reader.is_complete
        assert reader.n_samples >= 20_000


def test_messages_do_not_block_the_sender_and_stay_in_order() -> None:
    here, there = get_context("spawn").Pipe()
    outbox = MessageSender(here)
    sent = [b"%d" % k + b" " * 10_000 for k in range(100)]  # more than a pipe holds
    for message in sent:
        outbox.send(message)
    assert not outbox.close(0.01)
    assert [there.recv() for _ in sent] == sent
    assert outbox.close(60)
    there.close()
    here.close()


def test_messages_to_an_ended_process_are_dropped() -> None:
    here, there = get_context("spawn").Pipe()
    there.close()
    outbox = MessageSender(here)
    outbox.send("to nobody")
    assert outbox.close(60)
    here.close()
