import math
from dataclasses import replace

import numpy as np
import pytest

from model.dynamics.motion import ShaftMotion
from model.dynamics.stability import synchronous_orbit
from model.dynamics.synchronous import synchronous_response
from model.errors import ModelError
from model.rotor.gj90c import gj90c
from model.rotor.parameters import ModelParameters


def test_growth_and_order_without_weight_are_those_of_the_rotating_frame(default: ModelParameters) -> None:
    parameters = replace(default, gravity=0.0)
    for speed in (500.0, 1900.0):
        turning = synchronous_response(parameters, speed)
        floquet = synchronous_orbit(parameters, speed)
        assert floquet.growth_rate == pytest.approx(turning.growth_rate, rel=0.02, abs=0.05)
        assert floquet.whirl_order == pytest.approx(turning.whirl_order, abs=0.002)


def test_unstable_orbit_is_periodic(default: ModelParameters) -> None:
    orbit = synchronous_orbit(default, 1900.0)
    assert orbit.growth_rate > 10
    motion = ShaftMotion(default, 1900.0, 1)
    motion.set_initial_state(orbit.initial_state)
    first, second = np.split(motion.integrate_turns(2), 2, axis=1)
    assert np.abs(first - second)[:, 1:].max() < 1e-12  # the state is exact from the first step on


def test_disturbance_grows_at_its_rate(default: ModelParameters) -> None:
    speed = 1900.0
    orbit = synchronous_orbit(default, speed)
    still, disturbed = ShaftMotion(default, speed, 1), ShaftMotion(default, speed, 1)
    still.set_initial_state(orbit.initial_state)
    disturbed.set_initial_state(orbit.initial_state + 1e-9 * orbit.disturbance)
    apart = np.abs(disturbed.integrate_turns(40) - still.integrate_turns(40)).max(axis=0).reshape(40, -1)
    growth = np.log(apart[30:40].max() / apart[5:15].max()) / (25 * 2 * math.pi / speed)
    assert growth == pytest.approx(orbit.growth_rate, rel=0.1)


def test_weight_stabilises_the_shaft_at_low_speed(default: ModelParameters) -> None:
    assert synchronous_orbit(default, 400.0).growth_rate < -1
    assert synchronous_orbit(replace(default, gravity=0.0), 400.0).growth_rate > 0


def test_start_from_a_neighbouring_speed_gives_the_same_orbit(default: ModelParameters) -> None:
    start = synchronous_orbit(default, 1000.0)
    assert synchronous_orbit(default, 1030.0, start).growth_rate == pytest.approx(
        synchronous_orbit(default, 1030.0).growth_rate, abs=0.02
    )


def test_orbit_at_speed_zero_is_refused(default: ModelParameters) -> None:
    with pytest.raises(ValueError, match="speed: 0 rad/s"):
        synchronous_orbit(default, 0.0)


def test_orbit_larger_than_the_clearance_is_an_error() -> None:
    with pytest.raises(ModelError, match=r"synchronous motion at 10\.0 rad/s: none found"):
        synchronous_orbit(gj90c(viscosity=1e-7), 10.0)
