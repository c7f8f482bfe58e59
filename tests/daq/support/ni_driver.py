"""A stand-in for NI-DAQmx, as a client sees it: reservation, ring buffer, sample clock and counter."""

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

CLOCKS = {"80MHzTimebase": 80e6, "20MHzTimebase": 20e6, "100kHzTimebase": 100e3}
DIGITAL_EDGE, RISING, FALLING = 10150, 10280, 10171

Codes = NDArray[np.int16]
Counts = NDArray[np.uint32]


class DriverError(Exception):
    """An error of the stand-in driver, with its NI-DAQmx code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"the driver's text of {code},\nover two lines")
        self.code = code


@dataclass
class NiCounter:
    """A counter; its settings are checked when it is committed, as by the real driver."""

    name: str  # "Dev1/ctr0"
    clock_edge: int
    initial: int
    clock: str = ""
    line: str = ""
    line_edge: int = 0
    arm: dict[int, int | str] = field(default_factory=dict)  # by attribute
    is_started: bool = False
    latched: list[int] = field(default_factory=list)  # ticks since the samples started, not wrapped
    position: int = 0  # stamps returned by reads
    replied: int = 0  # stamps returned by reads whose client was still connected

    def check(self) -> None:
        device, _, counter = self.name.partition("/")
        if counter not in {"ctr0", "ctr1"}:
            raise DriverError(-200170)
        if self.clock not in {f"/{device}/{clock}" for clock in CLOCKS}:
            raise DriverError(-89136)
        if self.line not in {f"/{device}/PFI{number}" for number in range(16)}:
            raise DriverError(-89120)
        armed_by = {0x1414: DIGITAL_EDGE, 0x1417: f"/{device}/ai/StartTrigger", 0x1415: RISING}
        if (self.clock_edge, self.arm) != (RISING, armed_by) or self.line_edge not in {RISING, FALLING}:
            raise DriverError(-200077)

    def start(self) -> None:
        self.is_started = True
        self.latched, self.position, self.replied = [], 0, 0

    def take(self, n: int, buffer: int) -> tuple[Counts, int]:
        """Return up to n counts and the status: 0, or -200284 if there are fewer."""
        if not self.is_started:
            raise DriverError(-200983)
        if len(self.latched) - self.position > buffer:
            raise DriverError(-200279)
        got = self.latched[self.position : self.position + n]
        self.position += len(got)
        counts = (np.array(got, dtype=np.int64) + self.initial) % (1 << 32)
        return counts.astype(np.uint32), 0 if len(got) == n else -200284


class PlayedCard(Protocol):
    """The card whose samples the driver returns: `daq.drivers.simulation.card.SimulatedCard`, or one of a test."""

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
    """The sample counts of one start; they remain when its task is cleared."""

    position: int = 0  # samples returned by reads
    acquired: int = 0
    replied: int = 0  # samples returned by reads whose client was still connected


@dataclass
class NiTask:
    counter: NiCounter | None = None  # instead of analog inputs
    channels: list[NiChannel] = field(default_factory=list)
    rate: float = 0.0
    continuous: bool = False
    buffer: int = 0
    committed: bool = False
    card: PlayedCard | None = None  # while it runs
    started: float = 0.0
    count: NiStart = field(default_factory=NiStart)
    armed: list[NiCounter] = field(default_factory=list)  # counters started by its start


class NiDriver:
    """A driver with one USB-6251, which replays a new card at every start.

    Parameters
    ----------
    make_card : callable
        Creates the card.
    real_time : bool
        Whether samples arrive in real time; otherwise as soon as they are read.
    """

    def __init__(self, make_card: Callable[[], PlayedCard], *, real_time: bool = False) -> None:
        self.make_card = make_card
        self._next: PlayedCard | None = make_card()
        self.acquisition = self._next.acquisition
        self.scaling = [channel.scaling for channel in self.acquisition.channels]
        self.real_time = real_time
        self.devices = {"Dev1": ("USB-6251", 0x1A2B3C), "Dev2": ("PCI-6221", 0xBEEF)}
        self.passes_self_test = True
        self.driver_version = (24, 5, 1)
        self.self_calibrated: dt.date | None = dt.date(2026, 11, 2)
        self.held_elsewhere = False  # by another program on the machine
        self.counter_held_elsewhere = False
        self.ahead = 0  # samples that the card has acquired in addition to its clock's
        self.late: deque[int] = deque()  # samples that arrive before the time-outs of the next reads
        self.warning = 0  # status of successful reads
        self.miscount = 0  # error of the driver's position
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
        """Let the card acquire more samples than its clock's, as if the reader had stalled."""
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
            raise DriverError(-200279)  # the real driver repeats the error that ended the acquisition

    def read(self, task: NiTask, n: int, timeout: float) -> tuple[Codes, int]:
        """Return the codes read and the status: 0, or -200284 after a time-out."""
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
        """Return up to n counts and the status, without waiting."""
        if task.counter is None:
            raise DriverError(-200077)
        for other in others:
            if task.counter in other.armed and other.card is not None:
                self.count(other)
        return task.counter.take(n, task.buffer)

    def count(self, task: NiTask, wanted: int = 0) -> int:
        """Acquire the samples up to now, and return how many have been acquired."""
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
        if not self.passes_self_test:
            raise DriverError(-201003)
