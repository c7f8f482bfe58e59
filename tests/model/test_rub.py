"""The wall that is touched pushes back and rubs."""

import math

import numpy as np
import pytest

from model.lubrication import table_3_1
from model.rub import Rub

RUB = Rub(stiffness=1e7, friction=0.1, clearance=100e-6)


@pytest.mark.parametrize("position", [0j, 50e-6 + 0j, 99.999e-6j, -100e-6 + 0j])
def test_wall_does_nothing_before_it_is_touched(position: complex) -> None:
    assert complex(RUB.force(position, 1000.0)) == 0


def test_wall_pushes_inwards_in_proportion_to_the_depth() -> None:
    smooth = Rub(1e7, 0.0, 100e-6)
    for angle in (0.0, 1.0, 4.0):
        outwards = np.exp(1j * angle)
        assert complex(smooth.force(102e-6 * outwards, 1000.0)) == pytest.approx(-20 * outwards, rel=1e-9)
        assert complex(smooth.force(104e-6 * outwards, 1000.0)) == pytest.approx(-40 * outwards, rel=1e-9)


def test_friction_acts_against_the_rotation() -> None:
    on_the_right = complex(RUB.force(102e-6, 1000.0))  # the surface moves up
    assert on_the_right == pytest.approx(-20 - 2j, rel=1e-9)
    at_the_bottom = complex(RUB.force(-102e-6j, 1000.0))  # the surface moves to the right
    assert at_the_bottom == pytest.approx(-2 + 20j, rel=1e-9)
    assert complex(RUB.force(102e-6, -1000.0)) == pytest.approx(-20 + 2j, rel=1e-9)
    assert complex(RUB.force(102e-6, 0.0)) == pytest.approx(-20, rel=1e-9)


def test_force_is_continuous_where_contact_begins() -> None:
    depths = np.array([-1e-12, 0.0, 1e-12])
    assert np.max(np.abs(RUB.force(100e-6 + depths, 1.0))) < 2e-5


def test_many_positions_are_taken_at_once() -> None:
    positions = np.array([[0j, 102e-6], [102e-6j, 50e-6]])
    force = RUB.force(positions, 1000.0)
    assert force.shape == (2, 2)
    assert force[0, 1] == complex(RUB.force(102e-6, 1000.0))
    assert force[1, 1] == 0


def test_wall_of_a_floating_ring_bearing_is_where_both_films_are_closed() -> None:
    rub = Rub(1e7, 0.1, table_3_1().clearance)
    assert complex(rub.force(99.9e-6, 1.0)) == 0
    assert complex(rub.force(100.1e-6, 1.0)) != 0


@pytest.mark.parametrize(
    ("stiffness", "friction", "clearance", "message"),
    [
        (0.0, 0.1, 1e-4, "stiffness: 0 N/m"),
        (1e7, -0.1, 1e-4, "friction: -0.1, expected a finite value, 0 or more"),
        (1e7, 0.1, -1e-4, "clearance: -0.0001 m"),
        (math.nan, 0.1, 1e-4, "stiffness: nan N/m"),
    ],
)
def test_rub_names_a_value_that_makes_no_sense(
    stiffness: float, friction: float, clearance: float, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        Rub(stiffness, friction, clearance)
