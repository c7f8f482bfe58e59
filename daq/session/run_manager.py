"""The run manager: starts runs of the service, one at a time, and joins each before the next."""

import threading
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Self

from analysis.signals.header import RunHeader
from daq.config.rig import Rig
from daq.errors import RigError, UsageError
from daq.session.run import Run

StartRun = Callable[[Rig, str, float | None], Run]
"""Starts a run of a rig with a note and a duration, s, or None; raises RigError where it cannot."""


class RunInProgressError(RigError):
    """A run is in progress, or is being started."""


class RunManager:
    """Owner of at most one run.

    Parameters
    ----------
    rigs : mapping of str to Rig
        The rigs that a request may choose, by name.
    start_run : callable
        Starts a run, see `StartRun`.
    """

    def __init__(self, rigs: Mapping[str, Rig], start_run: StartRun) -> None:
        self._rigs = dict(rigs)
        self._start_run = start_run
        self._changing = threading.Lock()
        self._run: Run | None = None
        self._is_closed = False

    @property
    def rigs(self) -> tuple[str, ...]:
        """Names of the rigs that a request may choose."""
        return tuple(self._rigs)

    @property
    def run(self) -> Run | None:
        """The current run, or the last one; None before the first."""
        return self._run

    def start(self, rig: str, note: str, duration: float | None) -> RunHeader:
        """Start a run and return its header as soon as the device delivers samples.

        Parameters
        ----------
        rig : str
            One of `rigs`.
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
        if rig not in self._rigs:
            raise UsageError(f"rig: {rig!r}, expected one of {', '.join(self._rigs)}")
        if not self._changing.acquire(blocking=False):
            raise RunInProgressError("another run is being started")
        try:
            if self._is_closed:
                raise RunInProgressError("the service is shutting down")
            if self._run is not None:
                if not self._run.wait(0.0):
                    raise RunInProgressError(f"run {self._run.header.run} is in progress")
                self._run.close()
            self._run = self._start_run(self._rigs[rig], note, duration)
            return self._run.header
        finally:
            self._changing.release()

    def close(self) -> None:
        """End the current run and join it; no further run can be started."""
        with self._changing:
            self._is_closed = True
            if self._run is not None:
                self._run.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.close()
