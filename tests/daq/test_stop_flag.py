"""A stop flag that is set at any time during a wait."""

import sys
import threading
from types import FrameType
from typing import Any

import pytest

from daq.stop_flag import StopFlag


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
