"""What stays on the terminal of a run that is followed."""

import io
from dataclasses import replace

from daq.cli.output.progress import Console
from daq.cli.recording import follow
from daq.session.live_update import LiveUpdate, RunState, Status
from daq.session.run import RunOutcome
from daq.stop_flag import StopFlag
from tests.daq.support.live_updates import make_live_updates

FRAME = make_live_updates(1)[0]


class Played:
    """A run that shows one status after the other, and ends with the last."""

    def __init__(self, *statuses: Status) -> None:
        self._statuses = [*statuses, statuses[-1]]
        self.stopped = 0

    def latest(self) -> LiveUpdate:
        return replace(FRAME, status=self._statuses.pop(0) if len(self._statuses) > 1 else self._statuses[0])

    def wait(self, timeout: float) -> bool:
        return len(self._statuses) == 1

    def stop(self) -> None:
        self.stopped += 1

    def close(self) -> RunOutcome:
        return RunOutcome((), is_stopped_by_user=self.stopped > 0)


def followed(*statuses: Status) -> list[str]:
    stream = io.StringIO()
    follow(Played(*statuses), StopFlag(), Console(stream))  # type: ignore[arg-type] # all that is used of a run
    return [line for line in stream.getvalue().splitlines() if not line[:2].isdigit()]  # but for the progress


def test_each_trouble_and_loss_is_a_line_that_stays() -> None:
    good = Status(RunState.RECORDING)
    filling = Status(RunState.DEGRADED, detail="5 s wait in the card's buffer")
    lost = Status(RunState.RECORDING, last_loss="segment 0 ended after 7 samples: overrun")
    silent = replace(lost, state=RunState.INTERRUPTED, detail="no samples for 2 s")
    again = replace(silent, last_loss="segment 1 ended after 9 samples: unplugged")
    told = followed(
        good, filling, filling, lost, lost, silent, replace(silent, detail="no samples for 3 s"), again, lost
    )
    assert told[:4] == [filling.detail, lost.last_loss, silent.detail, again.last_loss]
    assert followed(good, good) == []


def test_stop_is_asked_for_once() -> None:
    run = Played(*[Status(RunState.RECORDING)] * 4)
    stop = StopFlag()
    stop.set()
    assert follow(run, stop, Console(io.StringIO())).is_stopped_by_user  # type: ignore[arg-type] # all that is used of a run
    assert run.stopped == 1
