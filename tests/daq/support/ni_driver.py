"""What NI-DAQmx keeps behind a task with analog inputs, as far as a client sees it: reservation, ring buffer, clock."""

import datetime as dt
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import Acquisition
from tests.daq.support.ni_counter import Counts, NiCounter
from tests.daq.support.ni_errors import DriverError

Codes = NDArray[np.int16]


class PlayedCard(Protocol):
    """What the driver digitises: `daq.drivers.simulation.card.SimulatedCard`, or a few lines of a test's own."""

    @property
    def acquisition(self) -> Acquisition: ...

    @property
    def n_samples(self) -> int: ...

    def next_codes(self, n: int) -> Codes: ...

    def ticks(self, first: int, stop: int) -> NDArray[np.int64]: ...


@dataclass
class NiChannel:
    name: str
    physical: str
    high: float
    terminal: int


@dataclass
class NiStart:
    """What became of one start: kept when its task is gone."""

    position: int = 0  # samples handed to reads
    acquired: int = 0
    replied: int = 0  # of the samples handed to reads, those whose reader was still there


@dataclass
class NiTask:
    counter: NiCounter | None = None  # in place of analog inputs
    channels: list[NiChannel] = field(default_factory=list)
    rate: float = 0.0
    continuous: bool = False
    buffer: int = 0
    committed: bool = False
    card: PlayedCard | None = None  # while it runs
    started: float = 0.0
    count: NiStart = field(default_factory=NiStart)
    armed: list[NiCounter] = field(default_factory=list)  # counters that its start has begun


class NiDriver:
    """One USB-6251 that plays a card, anew at every start.

    Parameters
    ----------
    make_card : callable
        Makes the card to play.
    real_time : bool
        Whether samples come as time goes, or as soon as they are asked for.
    """

    def __init__(self, make_card: Callable[[], PlayedCard], *, real_time: bool = False) -> None:
        self.make_card = make_card
        self._next: PlayedCard | None = make_card()
        self.acquisition = self._next.acquisition
        self.scaling = [channel.scaling for channel in self.acquisition.channels]
        self.real_time = real_time
        self.devices = {"Dev1": ("USB-6251", 0x1A2B3C), "Dev2": ("PCI-6221", 0xBEEF)}
        self.answers_tests = True
        self.driver_version = (24, 5, 1)
        self.self_calibrated: dt.date | None = dt.date(2026, 11, 2)
        self.held_elsewhere = False  # by another program on the machine
        self.counter_held_elsewhere = False
        self.ahead = 0  # samples that the card is ahead of what its clock says
        self.late: deque[int] = deque()  # samples that do come within the time-outs of the next reads
        self.warning = 0  # status of reads with which nothing is wrong
        self.miscount = 0  # by which the driver's position is off
        self.starts: list[NiStart] = []
        self.lock = threading.RLock()

    def commit(self, task: NiTask, others: list[NiTask]) -> None:
        if task.counter is not None:
            task.counter.check()
            names = [other.counter.name for other in others if other.counter is not None and other.committed]
            if self.counter_held_elsewhere or task.counter.name in names:
                raise DriverError(-50103)
            task.committed = True
            return
        if task.rate * len(task.channels) > 1e6:
            raise DriverError(-200077)
        if self.held_elsewhere or any(other.committed and other.counter is None for other in others):
            raise DriverError(-50103)
        task.committed = True

    def add_channel(self, task: NiTask, channel: NiChannel) -> None:
        device, _, line = channel.physical.partition("/")
        if device not in self.devices:
            raise DriverError(-200220)
        if line not in {f"ai{number}" for number in range(8)}:
            raise DriverError(-200170)
        task.channels.append(channel)

    def stall(self, samples: int) -> None:
        """Let the card take so many samples more than its clock says, as where the reader has been away."""
        self.ahead += samples

    def start(self, task: NiTask, others: list[NiTask]) -> None:
        if not task.committed:
            self.commit(task, others)
        if task.counter is not None:
            task.counter.start()
            return
        task.armed = [other.counter for other in others if other.counter is not None and other.counter.is_started]
        task.card, self._next = self._next or self.make_card(), None
        task.started = time.monotonic()
        self.ahead = 0
        task.count = NiStart()
        self.starts.append(task.count)

    def stop(self, task: NiTask) -> None:
        if task.counter is not None:
            task.counter.is_started = False
            return
        overrun = task.card is not None and task.count.acquired - task.count.position > task.buffer
        task.card = None
        if overrun:
            raise DriverError(-200279)  # the real one says once more what ended the acquisition

    def read(self, task: NiTask, n: int, timeout: float) -> tuple[Codes, int]:
        """Return what could be read and the status: 0, or -200284 where the time-out came first."""
        card = task.card
        if card is None:
            raise DriverError(-200983)
        coming = self.late.popleft() if self.late else n
        wanted = min(task.count.position + coming, card.n_samples)
        if self.real_time:
            due = task.started + max(0, wanted - self.ahead) / self.acquisition.rate
            time.sleep(max(0.0, min(timeout, due - time.monotonic())))
        self.count(task, wanted)
        if task.count.acquired - task.count.position > task.buffer:
            raise DriverError(-200279)
        got = min(coming, task.count.acquired - task.count.position)
        codes = card.next_codes(got)
        task.count.position += got
        return codes, self.warning if got == n else -200284

    def read_counter(self, task: NiTask, n: int, others: list[NiTask]) -> tuple[Counts, int]:
        """Return what could be read of so many counts and the status, without waiting."""
        if task.counter is None:
            raise DriverError(-200077)
        for other in others:
            if task.counter in other.armed and other.card is not None:
                self.count(other)
        return task.counter.take(n, task.buffer)

    def count(self, task: NiTask, wanted: int = 0) -> int:
        """Let the card take samples up to now, and return how many it has taken."""
        if task.card is None:
            raise DriverError(-200983)
        clock = (time.monotonic() - task.started) * self.acquisition.rate if self.real_time else wanted
        before = task.count.acquired
        task.count.acquired = max(before, min(int(clock) + self.ahead, task.card.n_samples))
        for counter in task.armed if task.count.acquired > before else ():
            counter.latched += task.card.ticks(before, task.count.acquired).tolist()
        return task.count.acquired

    def self_test(self, device: str) -> None:
        if device not in self.devices:
            raise DriverError(-200220)
        if not self.answers_tests:
            raise DriverError(-201003)
