"""Run-up and run-down, told from speeds as they come."""

import numpy as np
import pytest

from analysis.signals.ramp import RPM, Course, Direction, Step


def steps(*speeds_rpm: float) -> list[Step]:
    course = Course()
    return [course.update(speed * RPM) for speed in speeds_rpm]


def test_a_turn_is_told_once_the_speed_has_gone_back_by_more_than_it_wanders() -> None:
    told = steps(1000, 1050, 1150, 2000, 3000, 2990, 2950, 2880, 2800, 2850)
    back, onward, turned = Step.BACK, Step.ONWARD, Step.TURNED
    assert told == [back, back, turned, onward, onward, back, back, turned, onward, back]


@pytest.mark.parametrize(("last", "direction"), [(29_500, Direction.UP), (29_300, Direction.DOWN)])
def test_two_per_cent_of_a_high_speed_are_wandering(last: float, direction: Direction) -> None:
    course = Course()
    for speed in (1000, 30_000, last):
        course.update(speed * RPM)
    assert course.direction is direction


def test_a_held_speed_keeps_the_direction_in_which_it_was_reached() -> None:
    air = np.random.default_rng(1).normal(10_000.0, 20.0, 2000)
    up, down = Course(), Course()
    up.update(1000 * RPM)
    for speed in (15_000, 12_000):
        down.update(speed * RPM)
    for speed in air:
        up.update(speed * RPM)
        down.update(speed * RPM)
    assert (up.direction, down.direction) == (Direction.UP, Direction.DOWN)


@pytest.mark.parametrize(("last", "direction"), [(4000, Direction.UP), (2000, Direction.DOWN)])
def test_a_run_has_the_direction_in_which_it_leaves_its_first_speed(last: float, direction: Direction) -> None:
    course = Course()
    for speed in np.linspace(3000, last, 50):
        course.update(speed * RPM)
    assert course.direction is direction
