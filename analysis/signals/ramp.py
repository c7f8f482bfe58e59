"""Which way the speed goes: a run-up or a run-down, told from speeds as they come."""

from enum import StrEnum

import numpy as np

RPM = 2.0 * np.pi / 60.0
TURN = 100.0 * RPM  # rad/s: going back by more is a turn, by less the air's wandering
TURN_PART = 0.02  # of the speed, where that is more


class Direction(StrEnum):
    """Which way the speed goes."""

    UP = "run-up"
    DOWN = "run-down"


class Step(StrEnum):
    """What a speed is to those before it."""

    ONWARD = "onward"  # the furthest so far in the present direction
    BACK = "back"  # not so far: wandering, or the beginning of a turn
    TURNED = "turned"  # so far back that the direction has turned, at the furthest speed before


class Course:
    """Follows the direction of a run.

    A run that holds its speed keeps the direction in which it came there; a run that began with it is a run-up.
    """

    def __init__(self) -> None:
        self._low = self._high = np.nan  # since the last turn
        self._direction: Direction | None = None

    @property
    def direction(self) -> Direction:
        """The present one."""
        return self._direction or Direction.UP

    def update(self, speed: float) -> Step:
        """Take a speed, rad/s, finite; return what it is to those before."""
        if np.isnan(self._low):
            self._low = self._high = speed
        rises, falls = speed > self._high, speed < self._low
        self._low, self._high = min(self._low, speed), max(self._high, speed)
        step = max(TURN, TURN_PART * speed)
        if self._direction is not Direction.DOWN and self._high - speed > step:
            return self._turn(Direction.DOWN, speed)
        if self._direction is not Direction.UP and speed - self._low > step:
            return self._turn(Direction.UP, speed)
        onward = rises if self._direction is Direction.UP else falls and self._direction is Direction.DOWN
        return Step.ONWARD if onward else Step.BACK

    def _turn(self, direction: Direction, speed: float) -> Step:
        self._direction = direction
        self._low = self._high = speed
        return Step.TURNED
