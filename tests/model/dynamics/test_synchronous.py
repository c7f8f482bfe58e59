import math
from dataclasses import replace

import numpy as np
import pytest

from model.dynamics.synchronous import synchronous_response
from model.errors import ModelError
from model.rotor.gj90c import gj90c
from model.rotor.parameters import FilmModel, ModelParameters


def test_vectors_are_the_circle_at_the_probe_angles(weightless: ModelParameters) -> None:
    parameters = replace(weightless, probe_angles=(math.radians(45), math.radians(135)))
    response = synchronous_response(parameters, 2000.0)
    assert response.vectors == pytest.approx(response.circle * np.exp(-1j * np.radians([45, 135])), rel=1e-12)
    # a probe 90° further in the direction of rotation lags by a quarter turn
    assert response.vectors[1] == pytest.approx(-1j * response.vectors[0], rel=1e-12)


def test_response_to_small_imbalance_is_linear() -> None:
    small, smaller = (synchronous_response(gj90c(imbalance=u), 900.0).circle for u in (2e-9, 1e-9))
    assert small == pytest.approx(2 * smaller, rel=1e-4)


def test_film_without_cavity_acts_in_small_motion_as_one_of_twice_the_viscosity() -> None:
    full = gj90c(imbalance=1e-9)
    full = replace(full, bearing=replace(full.floating_ring, film_model=FilmModel.FULL_SOMMERFELD))
    found = synchronous_response(full, 900.0)
    expected = synchronous_response(gj90c(imbalance=1e-9, viscosity=0.03), 900.0)
    assert found.circle == pytest.approx(expected.circle, rel=1e-4)
    assert found.growth_rate == pytest.approx(expected.growth_rate, rel=5e-3)


def test_start_from_a_neighbouring_speed_gives_the_same_motion(weightless: ModelParameters) -> None:
    start = synchronous_response(weightless, 2000.0)
    assert synchronous_response(weightless, 2100.0, start).circle == pytest.approx(
        synchronous_response(weightless, 2100.0).circle, rel=1e-6
    )


@pytest.mark.parametrize(("speed", "amplitude"), [(2000.0, 81.13e-6), (6000.0, 277.01e-6)])
def test_response_with_four_modes_equals_another_program(
    weightless: ModelParameters, speed: float, amplitude: float
) -> None:
    # at 6000 rad/s the motion is reached only by continuation in speed; there are several
    assert abs(synchronous_response(weightless, speed, modes=4).circle) == pytest.approx(amplitude, abs=0.005e-6)


def test_six_modes_are_enough(weightless: ModelParameters) -> None:
    for speed in (2000.0, 6000.0):
        six, twelve = (synchronous_response(weightless, speed, modes=modes).circle for modes in (6, 12))
        assert abs(six - twelve) < 5e-4 * abs(twelve)


def test_large_imbalance_is_solved_by_continuation() -> None:
    response = synchronous_response(gj90c(imbalance=1.8e-5), 5000.0)
    assert np.abs(response.journals).max() < 100e-6
    assert np.abs(response.circle) > 50e-6


@pytest.mark.parametrize("speed", [0.0, -10.0, math.nan])
def test_speed_zero_is_refused(speed: float) -> None:
    with pytest.raises(ValueError, match=r"speed: .* rad/s, expected a finite value above 0"):
        synchronous_response(gj90c(), speed)


def test_motion_larger_than_the_clearance_is_an_error() -> None:
    with pytest.raises(ModelError, match=r"synchronous motion at 30000\.0 rad/s: none found within the clearances"):
        synchronous_response(gj90c(imbalance=1.8e-5, viscosity=1e-9), 30000.0)
