"""Contact force and friction of a wall."""

import math

import numpy as np
import pytest

from model.dynamics.condensed import wall_force
from model.films.lubrication import table_3_1
from model.rotor.supports import Rub

RUB = Rub(station=1, clearance=100e-6, stiffness=1e7, radius=5e-3, friction=0.1)


def force(rub: Rub, position: complex, velocity: complex, speed: float) -> complex:
    """Return the force on the shaft, N; position in m, velocity in m/s, speed in rad/s."""
    return wall_force(complex(position), complex(velocity), speed, rub.sizes)


@pytest.mark.parametrize("position", [0j, 50e-6 + 0j, 99.999e-6j, -100e-6 + 0j])
def test_wall_has_no_force_without_contact(position: complex) -> None:
    assert force(RUB, position, 1 + 1j, 1000.0) == 0


def test_wall_force_points_inwards_in_proportion_to_the_depth() -> None:
    smooth = Rub(1, 100e-6, 1e7, 5e-3)
    for angle in (0.0, 1.0, 4.0):
        outwards = np.exp(1j * angle)
        assert force(smooth, 102e-6 * outwards, 0j, 1000.0) == pytest.approx(-20 * outwards, rel=1e-9)
        assert force(smooth, 104e-6 * outwards, 0j, 1000.0) == pytest.approx(-40 * outwards, rel=1e-9)


def test_friction_acts_against_the_sliding() -> None:
    # the surface moves up on the right and to the right at the bottom
    assert force(RUB, 102e-6, 0j, 1000.0) == pytest.approx(-20 - 2j, rel=1e-6)
    assert force(RUB, -102e-6j, 0j, 1000.0) == pytest.approx(-2 + 20j, rel=1e-6)
    assert force(RUB, 102e-6, 0j, -1000.0) == pytest.approx(-20 + 2j, rel=1e-6)
    assert force(RUB, 102e-6, 0j, 0.0) == pytest.approx(-20, rel=1e-9)
    # reverse speed of the centre above the forward speed of the surface: 5 m/s
    assert force(RUB, 102e-6, -6j, 1000.0) == pytest.approx(-20 + 2j, rel=1e-6)
    assert force(RUB, 102e-6, -5j, 1000.0) == pytest.approx(-20, rel=1e-9)


def test_damping_increases_the_force_on_approach_and_never_pulls() -> None:
    damped = Rub(1, 100e-6, 1e7, 5e-3, damping=2.0)
    assert force(damped, 102e-6, 0.1 + 0j, 0.0) == pytest.approx(-24, rel=1e-9)
    assert force(damped, 102e-6, -0.1 + 0j, 0.0) == pytest.approx(-16, rel=1e-9)
    assert force(damped, 102e-6, -3.0 + 0j, 0.0) == 0


def test_force_is_continuous_at_first_contact() -> None:
    damped = Rub(1, 100e-6, 1e7, 5e-3, 0.3, 5.0)
    assert max(abs(force(damped, 100e-6 + depth, 1 + 0j, 1000.0)) for depth in (-1e-12, 0.0, 1e-12)) < 1e-4


def test_wall_at_the_sum_of_both_clearances() -> None:
    rub = Rub(3, table_3_1().clearance, 1e7, 5e-3, 0.1)
    assert force(rub, 99.9e-6, 0j, 1.0) == 0
    assert force(rub, 100.1e-6, 0j, 1.0) != 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stiffness": 0.0}, "stiffness: 0 N/m"),
        ({"stiffness": math.nan}, "stiffness: nan N/m"),
        ({"clearance": -1e-4}, "clearance: -0.0001 m"),
        ({"radius": 0.0}, "radius: 0 m"),
        ({"friction": -0.1}, "friction: -0.1, expected a finite value, 0 or more"),
        ({"damping": -1.0}, "damping: -1 s/m, expected a finite value, 0 or more"),
    ],
)
def test_invalid_rub_is_refused(changes: dict[str, float], message: str) -> None:
    sizes = {"clearance": 1e-4, "stiffness": 1e7, "radius": 5e-3} | changes
    with pytest.raises(ValueError, match=message):
        Rub(1, **sizes)
