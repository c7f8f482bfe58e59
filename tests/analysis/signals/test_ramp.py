"""Run-up and run-down, told from speeds as they come."""

import numpy as np
import pytest

from analysis.signals.ramp import RPM, RampDirection, RampStep, RampTracker


def steps(*speeds_rpm: float) -> list[RampStep]:
    ramp = RampTracker()
    return [ramp.update(speed * RPM) for speed in speeds_rpm]


def test_a_turn_is_told_once_the_speed_has_gone_back_by_more_than_it_wanders() -> None:
    told = steps(1000, 1050, 1150, 2000, 3000, 2990, 2950, 2880, 2800, 2850)
    back, onward, turned = RampStep.WITHIN, RampStep.FURTHEST, RampStep.REVERSED
    assert told == [back, back, turned, onward, onward, back, back, turned, onward, back]


@pytest.mark.parametrize(("last", "direction"), [(29_500, RampDirection.RUN_UP), (29_300, RampDirection.RUN_DOWN)])
def test_two_per_cent_of_a_high_speed_are_wandering(last: float, direction: RampDirection) -> None:
    ramp = RampTracker()
    for speed in (1000, 30_000, last):
        ramp.update(speed * RPM)
    assert ramp.direction is direction


def test_a_held_speed_keeps_the_direction_in_which_it_was_reached() -> None:
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
def test_a_run_has_the_direction_in_which_it_leaves_its_first_speed(last: float, direction: RampDirection) -> None:
    ramp = RampTracker()
    for speed in np.linspace(3000, last, 50):
        ramp.update(speed * RPM)
    assert ramp.direction is direction
