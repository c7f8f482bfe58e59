"""Watching a run from the terminal until it ends or is stopped."""

from threading import Event

from daq.cli.console import Console, frame_line
from daq.session.run import Outcome, Run

_LOOK = 0.2  # s


def follow(run: Run, stop: Event, console: Console) -> Outcome:
    """Show the run's progress until its end; a set `stop` ends it by hand."""
    asked, told = False, ""
    try:
        while not run.wait(_LOOK):
            frame = run.latest()
            if frame.status.last_loss != told:
                told = frame.status.last_loss
                console.line(told)
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
