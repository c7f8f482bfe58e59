"""Ramp direction of a run, run-up or run-down, from shaft speeds in the order of time."""

from enum import StrEnum

import numpy as np

from analysis.signals.units import RPM

MIN_REVERSAL = 100.0 * RPM  # rad/s: a smaller change back is speed fluctuation
MIN_REVERSAL_FRACTION = 0.02  # of the speed, where that is more


class RampDirection(StrEnum):
    """Direction in which the speed changes."""

    RUN_UP = "run-up"
    RUN_DOWN = "run-down"


class RampStep(StrEnum):
    """A speed compared with those before it."""

    FURTHEST = "furthest"  # the furthest so far in the present direction
    WITHIN = "within"  # not so far: speed fluctuation, or the beginning of a reversal
    REVERSED = "reversed"  # so far back that the direction has reversed, at the furthest speed before


class RampTracker:
    """Tracks the ramp direction of a run.

    At constant speed the direction of the ramp before it stays. A run that starts at constant speed is a run-up.
    """

    def __init__(self) -> None:
        self._low = self._high = np.nan  # since the last reversal
        self._direction: RampDirection | None = None

    @property
    def direction(self) -> RampDirection:
        """Present ramp direction."""
        return self._direction or RampDirection.RUN_UP

    def update(self, speed: float) -> RampStep:
        """Add a speed, rad/s, finite; return how it compares with those before."""
        if np.isnan(self._low):
            self._low = self._high = speed
        rises, falls = speed > self._high, speed < self._low
        self._low, self._high = min(self._low, speed), max(self._high, speed)
        step = max(MIN_REVERSAL, MIN_REVERSAL_FRACTION * speed)
        if self._direction is not RampDirection.RUN_DOWN and self._high - speed > step:
            return self._reverse(RampDirection.RUN_DOWN, speed)
        if self._direction is not RampDirection.RUN_UP and speed - self._low > step:
            return self._reverse(RampDirection.RUN_UP, speed)
        is_furthest = rises if self._direction is RampDirection.RUN_UP else falls and self._direction is not None
        return RampStep.FURTHEST if is_furthest else RampStep.WITHIN

    def _reverse(self, direction: RampDirection, speed: float) -> RampStep:
        self._direction = direction
        self._low = self._high = speed
        return RampStep.REVERSED
