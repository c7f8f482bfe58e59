"""A latched alarm with hysteresis and delay: it comes when a limit is held, and goes when somebody has seen it."""

import math
from dataclasses import dataclass

from analysis.run import Limits, Severity

HYSTERESIS = 0.05  # of the limit, by which the vibration must fall before the present verdict falls
DELAY = 1.0  # s that a limit must be passed, as monitors have it (API 670 asks 1 s to 3 s for radial vibration)


@dataclass(frozen=True, slots=True)
class AlarmState:
    """What an alarm says.

    Parameters
    ----------
    now : Severity
        Verdict on the vibration of the moment, with hysteresis.
    latched : Severity
        The worst verdict since somebody acknowledged.
    since : float
        Time at which the latched verdict came, s; NaN while normal.
    largest : float
        Largest vibration since, m peak-to-peak.
    """

    now: Severity
    latched: Severity
    since: float
    largest: float


class LatchedAlarm:
    """Watches an overall vibration against its limits.

    Parameters
    ----------
    limits : Limits
        Alarm and danger, m peak-to-peak.
    hysteresis : float
        Part of a limit by which the vibration must fall below it before the verdict does, 0 to below 1.
    delay : float
        Time that a limit must be passed without a break before the verdict rises, s.
    """

    def __init__(self, limits: Limits, hysteresis: float = HYSTERESIS, delay: float = DELAY) -> None:
        if not 0.0 <= hysteresis < 1.0 or not delay >= 0.0:
            raise ValueError(f"hysteresis, delay: {hysteresis} and {delay} s, expected 0 to below 1 and 0 or more")
        self._limits = {Severity.ALARM: limits.peak_to_peak_alarm, Severity.DANGER: limits.peak_to_peak_danger}
        self._hysteresis, self._delay = hysteresis, delay
        self._passed: dict[Severity, float] = {}  # since when each limit has been passed, s
        self._now = self._latched = Severity.NORMAL
        self._since = math.nan
        self._largest = 0.0

    def update(self, peak_to_peak: float, time: float) -> AlarmState:
        """Take an overall vibration, m peak-to-peak, at a time, s, rising; NaN, not known, changes nothing."""
        now = Severity.NORMAL
        for severity, limit in self._limits.items():
            held = self._now.rank >= severity.rank
            bar = limit * (1.0 - self._hysteresis) if held else limit
            if math.isnan(peak_to_peak):
                now = severity if held else now
            elif peak_to_peak >= bar:
                began = self._passed.setdefault(severity, time)
                if held or time - began >= self._delay:
                    now = severity
            else:
                self._passed.pop(severity, None)
        self._now = now
        if now.rank > self._latched.rank:
            self._latched, self._since = now, time
        self._largest = max(self._largest, peak_to_peak)
        return self.state

    @property
    def state(self) -> AlarmState:
        """What the alarm says."""
        return AlarmState(self._now, self._latched, self._since, self._largest)

    def acknowledge(self, time: float) -> AlarmState:
        """Somebody has seen it, at a time, s: what is latched falls to the verdict of the moment."""
        self._latched = self._now
        self._since = time if self._now is not Severity.NORMAL else math.nan
        self._largest = 0.0
        return self.state
