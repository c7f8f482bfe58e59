"""Runs that are started from elsewhere than a command of their own: one at a time, each joined before the next."""

import threading
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Self

from analysis.signals.header import RunHeader
from daq.config.rig import Rig
from daq.errors import RigError, UsageError
from daq.session.run import Run

Begin = Callable[[Rig, str, float | None], Run]


class RunInProgressError(RigError):
    """A run is under way already."""


class RunManager:
    """Owns at most one run.

    Parameters
    ----------
    rigs : mapping of str to Rig
        The rigs that may be chosen, by name.
    begin : callable
        Begins a run with a rig, a note and a length, s, or none; RigError where it cannot.
    """

    def __init__(self, rigs: Mapping[str, Rig], begin: Begin) -> None:
        self._rigs = dict(rigs)
        self._begin = begin
        self._changing = threading.Lock()
        self._run: Run | None = None
        self._is_closed = False

    @property
    def rigs(self) -> tuple[str, ...]:
        """Names of the rigs that may be chosen."""
        return tuple(self._rigs)

    @property
    def run(self) -> Run | None:
        """The run under way, or the last one; None before the first."""
        return self._run

    def start(self, rig: str, note: str, duration: float | None) -> RunHeader:
        """Begin a run and return its header once samples come.

        Parameters
        ----------
        rig : str
            One of `rigs`.
        note : str
            The operator's words.
        duration : float or None
            Sample time after which it ends by itself, s.

        Raises
        ------
        RunInProgressError
            A run is under way, or being started or ended.
        RigError
            It cannot be started.
        """
        if rig not in self._rigs:
            raise UsageError(f"rig: {rig!r}, expected one of {', '.join(self._rigs)}")
        if not self._changing.acquire(blocking=False):
            raise RunInProgressError("a run is being started already")
        try:
            if self._is_closed:
                raise RunInProgressError("the service ends")
            if self._run is not None:
                if not self._run.wait(0.0):
                    raise RunInProgressError(f"run {self._run.header.run} is under way")
                self._run.close()
            self._run = self._begin(self._rigs[rig], note, duration)
            return self._run.header
        finally:
            self._changing.release()

    def close(self) -> None:
        """End the run under way and join it; none can be started any more."""
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
