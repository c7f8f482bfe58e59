"""What the watching process and its recorder say to one another, over an anonymous pipe.

What is said to another process without waiting for it to listen.
"""

import threading
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue

from analysis.signals.blocks import SegmentEnd
from analysis.signals.header import RunHeader
from daq.config.rig import Rig


@dataclass(frozen=True, slots=True)
class RecordingRequest:
    """What is to be recorded.

    Parameters
    ----------
    rig : Rig
        The rig.
    run : str
        Id of the run.
    started_ns : int
        Wall clock, ns since 1970.
    note, program : str
        The operator's words; name and version of the program.
    path : Path
        The file to be made.
    duration : float or None
        Sample time after which to stop, s.
    """

    rig: Rig
    run: str
    started_ns: int
    note: str
    program: str
    path: Path
    duration: float | None


@dataclass(frozen=True, slots=True)
class DeviceOpened:
    """The device delivers and the file is there."""

    header: RunHeader


@dataclass(frozen=True, slots=True)
class RecordingRefused:
    """Nothing was recorded."""

    message: str
    exit_code: int


@dataclass(frozen=True, slots=True)
class AcquisitionEnded:
    """The samples have ended; results may still be sent."""

    ends: tuple[SegmentEnd, ...]


@dataclass(frozen=True, slots=True)
class FileClosed:
    """The file is finished; `message` says what went wrong, if anything did."""

    message: str


@dataclass(frozen=True, slots=True)
class StopRequest:
    """Stop the source."""


@dataclass(frozen=True, slots=True)
class ResultsEnded:
    """No more results will come; so many samples were skipped by the live analysis."""

    skipped_samples: int


class MessageSender:
    """Sends messages in their order from a thread of its own: a process that is stuck holds up nobody else.

    Parameters
    ----------
    pipe : Connection
        The way to the other process. Where it is gone, what is still to be sent is dropped.
    """

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._messages: SimpleQueue[object] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="outbox", daemon=True)
        self._thread.start()

    def send(self, message: object) -> None:
        """Send a message, soon; from any thread."""
        self._messages.put(message)

    def close(self, timeout: float) -> bool:
        """Send what is left, for `timeout` s at most; return whether the thread has ended."""
        self._messages.put(None)
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while (message := self._messages.get()) is not None:
            try:
                self._pipe.send(message)
            except OSError:
                return
