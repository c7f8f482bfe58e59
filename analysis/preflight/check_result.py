"""Result of a preflight check: verdict, measured value, limit and advice; and the configurable limits of the checks."""

from dataclasses import dataclass, replace
from enum import StrEnum

from analysis.signals.units import MICROMETRE


class Verdict(StrEnum):
    """Verdict of a check."""

    GOOD = "PASS"
    WARN = "WARN"  # a run is possible, but read the advice
    FAIL = "FAIL"  # blocks a run: the recorded data would be invalid


class Finding(StrEnum):
    """Machine-readable reason of a check that did not pass; the advice is for people."""

    OPEN = "open"  # nothing is connected to the input
    INTERMITTENT = "intermittent"  # contact is lost for short intervals
    GAP_CLOSED = "gap closed"
    GAP_WIDE = "gap too wide"
    CLIPPED = "clipped"  # the voltage exceeds the range of the card
    REVERSED = "reversed"  # the two wires of an input are exchanged
    BRIDGED = "bridged"  # two inputs have the same signal
    PROBES_EXCHANGED = "probes exchanged"
    TACHO_EXCHANGED = "tacho exchanged"  # with a probe
    BEYOND_CALIBRATION = "beyond calibration"
    HUM = "mains hum"
    INCONCLUSIVE = "inconclusive"  # the signal does not allow the check
    SILENT = "tacho silent"
    STILL = "no pulses"
    LEVELS = "levels"  # the switching levels do not suit the levels of the tacho
    NOISE = "noise"
    DUTY = "duty cycle"  # differs from the configured mark fraction
    SCATTER = "scatter"
    SPEED = "speed limit"
    MISSING = "device missing"
    DRIVER = "driver missing or too old"
    DRIVER_WARNING = "driver warning"
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
    """Result of one preflight check; passed unless `warn` or `fail` says otherwise.

    Parameters
    ----------
    name : str
        Checked quantity, as "probe x gap".
    value : str
        Measured value, with its unit.
    limit : str
        Expected value, with its unit.
    verdict : Verdict
        Passed, warning or failed.
    finding : Finding or None
        Reason; None exactly where the check passed.
    advice : str
        Meaning at the bench and what to do; empty for a passed check.
    """

    name: str
    value: str
    limit: str
    verdict: Verdict = Verdict.GOOD
    finding: Finding | None = None
    advice: str = ""

    def __post_init__(self) -> None:
        if (self.verdict is Verdict.GOOD) != (self.finding is None):
            raise ValueError(f"check {self.name!r}: {self.verdict} with {self.finding}, expected a finding unless good")

    def warn(self, finding: Finding, advice: str) -> "Check":
        """Return the check with a warning."""
        return replace(self, verdict=Verdict.WARN, finding=finding, advice=advice)

    def fail(self, finding: Finding, advice: str) -> "Check":
        """Return the check as failed, which blocks a run."""
        return replace(self, verdict=Verdict.FAIL, finding=finding, advice=advice)


def worst_verdict(checks: tuple[Check, ...]) -> Verdict:
    """Return the worst verdict of checks; good without checks."""
    order = list(Verdict)
    return max((check.verdict for check in checks), key=order.index, default=Verdict.GOOD)


@dataclass(frozen=True, slots=True)
class WiringLimits:
    """Limits of the wiring checks.

    Parameters
    ----------
    hum_warn, hum_fail : float
        Mains hum of a probe, m peak, above which its check warns and fails.
    tacho_scatter : float
        Relative scatter of the tacho periods about their trend, above which the check warns.
    mark_tolerance : float
        Allowed deviation of the duty cycle from the configured mark fraction: sensor response and sensitivity shift it.

    Raises
    ------
    ValueError
        A limit is negative, or hum fails before it warns.
    """

    hum_warn: float = 1.0 * MICROMETRE
    hum_fail: float = 5.0 * MICROMETRE
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
