"""Messages between a recorded run and its recorder process, and the thread that sends them."""

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
    """A run to record.

    Parameters
    ----------
    rig : Rig
        The rig.
    run : str
        Id of the run.
    started_ns : int
        Wall clock, ns since 1970.
    note, program : str
        The operator's note; name and version of the program.
    path : Path
        The file to create.
    duration : float or None
        Sample time after which to stop, s; None: until it is stopped.
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
    """The device is open and the file is created."""

    header: RunHeader


@dataclass(frozen=True, slots=True)
class RecordingRefused:
    """The recording did not start; nothing was recorded."""

    message: str
    exit_code: int


@dataclass(frozen=True, slots=True)
class AcquisitionEnded:
    """No more samples follow; the recorder still accepts results."""

    ends: tuple[SegmentEnd, ...]


@dataclass(frozen=True, slots=True)
class FileClosed:
    """The file is complete; `message` is the error message, empty for none."""

    message: str


@dataclass(frozen=True, slots=True)
class StopRequest:
    """Request to stop the source."""


@dataclass(frozen=True, slots=True)
class ResultsEnded:
    """No more results follow; the live analysis skipped this number of samples per channel."""

    skipped_samples: int


class MessageSender:
    """Sender of messages to another process, in order, from its own thread: a blocked receiver blocks no caller.

    Parameters
    ----------
    pipe : Connection
        Connection to the other process. When it breaks, queued messages are dropped.
    """

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._messages: SimpleQueue[object] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="message-sender", daemon=True)
        self._thread.start()

    def send(self, message: object) -> None:
        """Queue a message; safe from any thread."""
        self._messages.put(message)

    def close(self, timeout: float) -> bool:
        """Send the queued messages within `timeout` s; return whether the thread has ended."""
        self._messages.put(None)
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while (message := self._messages.get()) is not None:
            try:
                self._pipe.send(message)
            except OSError:
                return
