"""A run in progress, recorded or replayed: its interfaces, its outcome, and the manager that starts one at a time."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from analysis.live.alarms import Alarm
from analysis.signals.blocks import EndReason, SegmentEnd
from analysis.signals.header import RunHeader
from daq.config.rig import Rig
from daq.errors import RigError, UsageError
from daq.session.live_update import LiveUpdate


@dataclass(frozen=True, slots=True)
class RunOutcome:
    """How a run ended.

    Parameters
    ----------
    ends : tuple of SegmentEnd
        Ends of its segments.
    message : str
        Error message for the operator; empty for none.
    is_stopped_by_user : bool
        Whether the user stopped it.
    skipped : int
        Samples per channel that the live analysis skipped.
    """

    ends: tuple[SegmentEnd, ...]
    message: str = ""
    is_stopped_by_user: bool = False
    skipped: int = 0

    @property
    def exit_code(self) -> int:
        """0 success, 3 device failed, 5 data lost (file usable), 130 stopped by the user (file complete)."""
        reasons = {end.reason for end in self.ends}
        if not self.ends or self.message or any(not end.is_gap_free for end in self.ends):
            return 5
        if reasons & {EndReason.UNPLUGGED, EndReason.DEVICE_ERROR}:
            return 3
        return 130 if self.is_stopped_by_user else 0


class Run(Protocol):
    """A run in progress, recorded or replayed, as the view and the service see it."""

    @property
    def header(self) -> RunHeader:
        """The run's header."""
        ...

    def latest(self) -> LiveUpdate:
        """Return the current live update."""
        ...

    def acknowledge(self) -> tuple[Alarm, ...]:
        """Acknowledge the alarms so far; return those that were new."""
        ...

    def stop(self) -> None:
        """Request the end, as the user does."""
        ...

    def wait(self, timeout: float) -> bool:
        """Wait up to `timeout` s for the end; return whether the run has ended."""
        ...

    def close(self) -> RunOutcome:
        """End the run, join its threads and processes, and return the outcome."""
        ...


StartRun = Callable[[Rig, str, float | None], Run]
"""Starts a run of a rig with a note and a duration, s, or None; raises RigError where it cannot."""


class RunInProgressError(RigError):
    """A run is in progress, or is being started."""


class RunManager:
    """Owner of at most one run.

    Parameters
    ----------
    rig : Rig
        The rig.
    start_run : callable
        Starts a run, see `StartRun`.

    Attributes
    ----------
    run : Run or None
        The current run, or the last one; None before the first.
    """

    def __init__(self, rig: Rig, start_run: StartRun) -> None:
        self._rig = rig
        self._start_run = start_run
        self._changing = threading.Lock()
        self.run: Run | None = None
        self._is_closed = False

    def start(self, rig: str | None, note: str, duration: float | None) -> RunHeader:
        """Start a run and return its header as soon as the device delivers samples.

        Parameters
        ----------
        rig : str or None
            Name of the rig; None does not check it.
        note : str
            The operator's note.
        duration : float or None
            Sample time after which the run ends, s; None: until it is stopped.

        Raises
        ------
        RunInProgressError
            A run is in progress or being started, or the service is shutting down.
        RigError
            The run cannot be started.
        """
        name = self._rig.config.rig
        if rig not in {name, None}:
            raise UsageError(f"rig: {rig!r}, expected {name}")
        if not self._changing.acquire(blocking=False):
            raise RunInProgressError("another run is being started")
        try:
            if self._is_closed:
                raise RunInProgressError("the service is shutting down")
            if self.run is not None:
                if not self.run.wait(0.0):
                    raise RunInProgressError(f"run {self.run.header.run} is in progress")
                self.run.close()
            self.run = self._start_run(self._rig, note, duration)
            return self.run.header
        finally:
            self._changing.release()

    def close(self) -> None:
        """End the current run and join it; no further run can be started."""
        with self._changing:
            self._is_closed = True
            if self.run is not None:
                self.run.close()
