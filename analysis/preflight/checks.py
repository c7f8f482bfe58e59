"""From where on a check of the wiring warns or fails, where that is a matter of the rig and not of physics.

What a check before a run says: good or not, what was seen, what was expected, and what to do.
"""

from dataclasses import dataclass
from enum import StrEnum


class Verdict(StrEnum):
    """How a check came out."""

    GOOD = "PASS"
    WARN = "WARN"  # a run is possible, but something should be known or put right
    FAIL = "FAIL"  # what would be recorded could not be trusted


class Finding(StrEnum):
    """What is wrong, for programs; people read the check's advice."""

    OPEN = "open"  # nothing is connected to the input
    GAP_CLOSED = "gap closed"
    GAP_WIDE = "gap too wide"
    CLIPPED = "clipped"  # the voltage left the card's range
    REVERSED = "reversed"  # the two wires of an input are exchanged
    BRIDGED = "bridged"  # two inputs see one sensor
    PROBES_EXCHANGED = "probes exchanged"
    TACHO_EXCHANGED = "tacho exchanged"  # with a probe
    BEYOND_CALIBRATION = "beyond calibration"
    HUM = "mains hum"
    INCONCLUSIVE = "cannot be told"  # what the check needs was not there
    SILENT = "tacho silent"
    STILL = "no pulses"
    LEVELS = "levels"  # the tacho's levels and its switching levels do not fit
    NOISE = "noise"
    DUTY = "mark"  # light and dark do not share the turn as configured
    SCATTER = "scatter"
    SPEED = "speed limit"
    MISSING = "device missing"
    DRIVER = "driver missing or too old"
    DRIVER_WARNING = "driver remarks something"
    REFUSED = "settings refused"
    BUSY = "device busy"
    SELF_TEST = "self-test"
    SIMULATED = "simulated"
    SERIAL = "serial number"
    COUNT = "sample count"
    BACKLOG = "backlog"
    RATE = "rate"
    CALIBRATION = "calibration"
    DISK = "disk"


@dataclass(frozen=True, slots=True)
class Check:
    """One line of the table that an operator reads before a run.

    Parameters
    ----------
    name : str
        What was looked at, as "probe x gap".
    verdict : Verdict
        How it came out.
    value : str
        What was seen, with its unit.
    limit : str
        What was expected, with its unit.
    advice : str
        What it means at the bench and what to do; empty where there is nothing to do.
    finding : Finding or None
        What is wrong; None exactly where the check passed.
    """

    name: str
    verdict: Verdict
    value: str
    limit: str
    advice: str = ""
    finding: Finding | None = None

    def __post_init__(self) -> None:
        if (self.verdict is Verdict.GOOD) != (self.finding is None):
            raise ValueError(f"check {self.name!r}: {self.verdict} with {self.finding}, expected a finding unless good")

    @classmethod
    def passed(cls, name: str, value: str, limit: str) -> "Check":
        """Return a check that is good."""
        return cls(name, Verdict.GOOD, value, limit)

    @classmethod
    def warned(cls, name: str, finding: Finding, value: str, limit: str, advice: str) -> "Check":
        """Return a check whose outcome should be known."""
        return cls(name, Verdict.WARN, value, limit, advice, finding)

    @classmethod
    def failed(cls, name: str, finding: Finding, value: str, limit: str, advice: str) -> "Check":
        """Return a check that stands against a run."""
        return cls(name, Verdict.FAIL, value, limit, advice, finding)


def worst_verdict(checks: tuple[Check, ...]) -> Verdict:
    """Return the worst verdict among checks; good where there are none."""
    order = list(Verdict)
    return max((check.verdict for check in checks), key=order.index, default=Verdict.GOOD)


MICRO = 1e-6


@dataclass(frozen=True, slots=True)
class WiringLimits:
    """What is still good at a rig.

    Parameters
    ----------
    hum_warn, hum_fail : float
        Mains hum of a probe, m peak: above the first it is said, above the second it stands against a run.
    tacho_scatter : float
        Scatter of the tacho's periods about their slow course, relative.
    mark_tolerance : float
        How far the mark may be from its stated part of the turn: response and sensitivity shift light against dark.

    Raises
    ------
    ValueError
        A limit is negative, or hum fails before it warns.
    """

    hum_warn: float = 1.0 * MICRO
    hum_fail: float = 5.0 * MICRO
    tacho_scatter: float = 0.05
    mark_tolerance: float = 0.15

    def __post_init__(self) -> None:
        if not 0.0 <= self.hum_warn <= self.hum_fail:
            raise ValueError(
                f"hum_warn, hum_fail: {self.hum_warn}, {self.hum_fail} m, expected 0 <= hum_warn <= hum_fail"
            )
        if not (self.tacho_scatter > 0.0 and 0.0 < self.mark_tolerance < 1.0):
            raise ValueError(
                f"tacho_scatter, mark_tolerance: {self.tacho_scatter}, {self.mark_tolerance}, expected more than 0, "
                "the second less than 1"
            )
