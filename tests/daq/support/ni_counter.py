"""What NI-DAQmx keeps behind a task with a counter: the count that a clock raises and every edge at a line latches."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tests.daq.support.ni_errors import DriverError

CLOCKS = {"80MHzTimebase": 80e6, "20MHzTimebase": 20e6, "100kHzTimebase": 100e3}
DIGITAL_EDGE, RISING, FALLING = 10150, 10280, 10171

Counts = NDArray[np.uint32]


@dataclass
class NiCounter:
    """One counter; what is set is checked when it is committed, as the real driver does."""

    name: str  # "Dev1/ctr0"
    clock_edge: int
    initial: int
    clock: str = ""
    line: str = ""
    line_edge: int = 0
    arm: dict[int, int | str] = field(default_factory=dict)  # by attribute
    is_started: bool = False
    latched: list[int] = field(default_factory=list)  # ticks since the samples began, never wrapped
    position: int = 0  # stamps handed to reads
    replied: int = 0  # of those, whose reader was still there

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
        """Return what could be read of so many counts and the status: 0, or -200284 where there are fewer."""
        if not self.is_started:
            raise DriverError(-200983)
        if len(self.latched) - self.position > buffer:
            raise DriverError(-200279)
        got = self.latched[self.position : self.position + n]
        self.position += len(got)
        counts = (np.array(got, dtype=np.int64) + self.initial) % (1 << 32)
        return counts.astype(np.uint32), 0 if len(got) == n else -200284
