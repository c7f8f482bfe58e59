"""The wall that is touched pushes back and rubs."""

import math

import numpy as np
import pytest

from model.dynamics.forces import wall_force
from model.films.lubrication import table_3_1
from model.rotor.rub import Rub

RUB = Rub(station=1, clearance=100e-6, stiffness=1e7, radius=5e-3, friction=0.1)


def force(rub: Rub, position: complex, velocity: complex, speed: float) -> complex:
    """Return the force on the shaft, N; position in m, velocity in m/s, speed in rad/s."""
    return wall_force(complex(position), complex(velocity), speed, rub.sizes)


@pytest.mark.parametrize("position", [0j, 50e-6 + 0j, 99.999e-6j, -100e-6 + 0j])
def test_wall_does_nothing_before_it_is_touched(position: complex) -> None:
    assert force(RUB, position, 1 + 1j, 1000.0) == 0


def test_wall_pushes_inwards_in_proportion_to_the_depth() -> None:
    smooth = Rub(1, 100e-6, 1e7, 5e-3)
    for angle in (0.0, 1.0, 4.0):
        outwards = np.exp(1j * angle)
        assert force(smooth, 102e-6 * outwards, 0j, 1000.0) == pytest.approx(-20 * outwards, rel=1e-9)
        assert force(smooth, 104e-6 * outwards, 0j, 1000.0) == pytest.approx(-40 * outwards, rel=1e-9)


def test_friction_acts_against_the_sliding() -> None:
    # the surface on the right moves up, at the bottom to the right
    assert force(RUB, 102e-6, 0j, 1000.0) == pytest.approx(-20 - 2j, rel=1e-6)
    assert force(RUB, -102e-6j, 0j, 1000.0) == pytest.approx(-2 + 20j, rel=1e-6)
    assert force(RUB, 102e-6, 0j, -1000.0) == pytest.approx(-20 + 2j, rel=1e-6)
    assert force(RUB, 102e-6, 0j, 0.0) == pytest.approx(-20, rel=1e-9)
    # a centre that goes backwards faster than the surface goes forwards: 5 m/s
    assert force(RUB, 102e-6, -6j, 1000.0) == pytest.approx(-20 + 2j, rel=1e-6)
    assert force(RUB, 102e-6, -5j, 1000.0) == pytest.approx(-20, rel=1e-9)


def test_damping_adds_on_the_way_in_and_never_pulls_on_the_way_out() -> None:
    damped = Rub(1, 100e-6, 1e7, 5e-3, damping=2.0)
    assert force(damped, 102e-6, 0.1 + 0j, 0.0) == pytest.approx(-24, rel=1e-9)
    assert force(damped, 102e-6, -0.1 + 0j, 0.0) == pytest.approx(-16, rel=1e-9)
    assert force(damped, 102e-6, -3.0 + 0j, 0.0) == 0


def test_force_is_continuous_where_contact_begins() -> None:
    damped = Rub(1, 100e-6, 1e7, 5e-3, 0.3, 5.0)
    assert max(abs(force(damped, 100e-6 + depth, 1 + 0j, 1000.0)) for depth in (-1e-12, 0.0, 1e-12)) < 1e-4


def test_wall_of_a_floating_ring_bearing_is_where_both_films_are_closed() -> None:
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
def test_rub_names_a_value_that_makes_no_sense(changes: dict[str, float], message: str) -> None:
    sizes = {"clearance": 1e-4, "stiffness": 1e7, "radius": 5e-3} | changes
    with pytest.raises(ValueError, match=message):
        Rub(1, **sizes)
