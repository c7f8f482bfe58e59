"""Watching a run from the terminal until it ends or is stopped."""

from daq.cli.progress import Console, frame_line
from daq.session.live_update import RunState, Status
from daq.session.run import Outcome, Run
from daq.stop_flag import StopFlag

_LOOK = 0.2  # s
_TROUBLE = frozenset({RunState.DEGRADED, RunState.INTERRUPTED})


def follow(run: Run, stop: StopFlag, console: Console) -> Outcome:
    """Show the run's progress until its end; a set `stop` ends it by hand."""
    asked, telling = False, _Telling(console)
    try:
        while not run.wait(_LOOK):
            frame = run.latest()
            telling.take(frame.status)
            console.progress(frame_line(frame))
            if stop.is_set() and not asked:
                asked = True
                run.stop()
        if stop.is_set() and not asked:  # the recorder was told as well, and was faster
            run.stop()
        console.progress(frame_line(run.latest()))
        console.done()
    finally:  # whatever happens here, the recorder is not left alone with an open file
        outcome = run.close()
    return outcome


class _Telling:
    """Keeps on the terminal what went wrong, when the line of progress has long gone on."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._state = RunState.STARTING
        self._loss = ""

    def take(self, status: Status) -> None:
        """Print a line where trouble begins, and where a segment was lost."""
        if status.last_loss != self._loss:
            self._loss = status.last_loss
            self._console.line(self._loss)
        if status.state is not self._state:
            self._state = status.state
            if status.state in _TROUBLE:
                self._console.line(status.detail)
