"""The ramp direction from speeds."""

import numpy as np
import pytest

from analysis.signals.ramp import RampDirection, RampStep, RampTracker
from analysis.signals.units import RPM


def steps(*speeds_rpm: float) -> list[RampStep]:
    ramp = RampTracker()
    return [ramp.update(speed * RPM) for speed in speeds_rpm]


def test_reversal_needs_a_change_above_the_speed_fluctuation() -> None:
    found = steps(1000, 1050, 1150, 2000, 3000, 2990, 2950, 2880, 2800, 2850)
    within, furthest, reversal = RampStep.WITHIN, RampStep.FURTHEST, RampStep.REVERSED
    assert found == [
        within,
        within,
        reversal,
        furthest,
        furthest,
        within,
        within,
        reversal,
        furthest,
        within,
    ]


@pytest.mark.parametrize(("last", "direction"), [(29_500, RampDirection.RUN_UP), (29_300, RampDirection.RUN_DOWN)])
def test_two_per_cent_of_a_high_speed_is_fluctuation(last: float, direction: RampDirection) -> None:
    ramp = RampTracker()
    for speed in (1000, 30_000, last):
        ramp.update(speed * RPM)
    assert ramp.direction is direction


def test_constant_speed_does_not_change_the_ramp_direction() -> None:
    air = np.random.default_rng(1).normal(10_000.0, 20.0, 2000)
    up, down = RampTracker(), RampTracker()
    up.update(1000 * RPM)
    for speed in (15_000, 12_000):
        down.update(speed * RPM)
    for speed in air:
        up.update(speed * RPM)
        down.update(speed * RPM)
    assert (up.direction, down.direction) == (RampDirection.RUN_UP, RampDirection.RUN_DOWN)


@pytest.mark.parametrize(("last", "direction"), [(4000, RampDirection.RUN_UP), (2000, RampDirection.RUN_DOWN)])
def test_first_direction_is_that_of_the_first_ramp(last: float, direction: RampDirection) -> None:
    ramp = RampTracker()
    for speed in np.linspace(3000, last, 50):
        ramp.update(speed * RPM)
    assert ramp.direction is direction
