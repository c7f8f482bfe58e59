"""Whether the tacho's counter can be what rig.toml says: lines, timebases and the room in 32 bits."""

from collections.abc import Iterator

from daq.config.messages import Fault
from daq.config.schema import Backend, RigConfig

TIMEBASES = {80e6: "80MHzTimebase", 20e6: "20MHzTimebase", 100e3: "100kHzTimebase"}
"""Rates, Hz, and the driver's names of the clocks that an M Series card can count."""
COUNTERS = ("ctr0", "ctr1")
LINES = 16  # PFI0 to PFI15
WRAP = 1 << 32  # ticks after which a count begins again
SLACK = 10.0  # s that must be left of a wrap, for a stamp that comes late and a block that is long
LOW_LEVEL, HIGH_LEVEL = 0.8, 2.2  # V: below and above, a line of the card is sure to see its level


def counter_faults(config: RigConfig) -> Iterator[Fault]:
    """Return what is wrong with the counter of a configuration."""
    section, timing = config.tacho.counter, config.timing
    if section is None:
        return
    key = "tacho.counter"
    if section.counter not in COUNTERS:
        yield _fault(f"{key}.counter", f'"{section.counter}"', f"{' or '.join(COUNTERS)}, the counters of the card")
    if int(section.terminal.removeprefix("PFI")) >= LINES:
        yield _fault(f"{key}.terminal", f'"{section.terminal}"', f"PFI0 to PFI{LINES - 1}, the lines of the card")
    if section.timebase_hz not in TIMEBASES:
        expected = f"one of the card's clocks, {', '.join(f'{rate:.0f}' for rate in TIMEBASES)}"
        yield _fault(f"{key}.timebase_hz", f"{section.timebase_hz:g}", expected)
        return
    longest = WRAP / section.timebase_hz - SLACK
    if timing.buffer_s > longest:
        expected = f"at most {longest:.1f}: a count of 32 bits begins again every {WRAP / section.timebase_hz:.1f} s"
        yield _fault("timing.buffer_s", f"{timing.buffer_s:g}", expected, f"{key}.timebase_hz")
    bench = config.simulation
    if config.device.backend is Backend.SIMULATED and not (
        bench.tacho_low_v <= LOW_LEVEL and bench.tacho_high_v >= HIGH_LEVEL
    ):
        expected = f"at least {HIGH_LEVEL:g}, and tacho_low_v at most {LOW_LEVEL:g}: the levels of {section.terminal}"
        yield _fault("simulation.tacho_high_v", f"{bench.tacho_high_v:g}", expected, "simulation.tacho_low_v", key)


def _fault(key: str, value: str, expected: str, *others: str) -> Fault:
    return Fault((key, *others), f"{key} = {value}: expected {expected}")
