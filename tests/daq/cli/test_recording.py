"""What `follow` prints on the terminal while a run goes on."""

import io
from dataclasses import replace

from daq.cli.recording import follow
from daq.cli.terminal import TerminalOutput
from daq.session.live_update import LiveUpdate, RunState, Status
from daq.session.run import RunOutcome
from daq.stop_flag import StopFlag
from tests.daq.support.live_updates import make_live_updates

UPDATE = make_live_updates(1)[0]


class ScriptedRun:
    """A run that reports these statuses in turn and ends with the last."""

    def __init__(self, *statuses: Status) -> None:
        self._statuses = [*statuses, statuses[-1]]
        self.stopped = 0

    def latest(self) -> LiveUpdate:
        return replace(UPDATE, status=self._statuses.pop(0) if len(self._statuses) > 1 else self._statuses[0])

    def wait(self, timeout: float) -> bool:
        return len(self._statuses) == 1

    def stop(self) -> None:
        self.stopped += 1

    def close(self) -> RunOutcome:
        return RunOutcome((), is_stopped_by_user=self.stopped > 0)


def followed(*statuses: Status) -> list[str]:
    stream = io.StringIO()
    follow(ScriptedRun(*statuses), StopFlag(), TerminalOutput(stream))  # type: ignore[arg-type] # has the methods of a run that are used
    return [line for line in stream.getvalue().splitlines() if not line[:2].isdigit()]  # without the progress lines


def test_each_loss_and_degraded_state_prints_one_line() -> None:
    good = Status(RunState.RECORDING)
    filling = Status(RunState.DEGRADED, detail="the card's buffer of 8 s holds 5 s")
    lost = Status(RunState.RECORDING, last_loss="segment 0 ended after 7 samples: overrun")
    silent = replace(lost, state=RunState.INTERRUPTED, detail="no samples for 2 s")
    again = replace(silent, last_loss="segment 1 ended after 9 samples: unplugged")
    lines = followed(
        good, filling, filling, lost, lost, silent, replace(silent, detail="no samples for 3 s"), again, lost
    )
    assert lines[:4] == [filling.detail, lost.last_loss, silent.detail, again.last_loss]
    assert followed(good, good) == []


def test_stop_is_sent_once() -> None:
    run = ScriptedRun(*[Status(RunState.RECORDING)] * 4)
    stop = StopFlag()
    stop.set()
    assert follow(run, stop, TerminalOutput(io.StringIO())).is_stopped_by_user  # type: ignore[arg-type] # has the methods of a run that are used
    assert run.stopped == 1
