"""Integration in time against an explicit solver, and stability eigenvalues against transients."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from model.dynamics.modal_system import ModalSystem
from model.dynamics.motion import ShaftMotion
from model.dynamics.stability import SynchronousOrbit, synchronous_orbit
from model.rotor.gj90c import gj90c
from model.rotor.parameters import ModelParameters
from model.studies.onset import stability
from tests.model.dynamics.equations import at_rest, compiled_rates, numpy_rates

FloatArray = NDArray[np.float64]

TURNS = 320


def explicit(parameters: ModelParameters, speed: float, times: FloatArray) -> FloatArray:
    """Motion at the probes from rest in the bearing centre, by an explicit method of order 8 with tight tolerance."""
    span = (0.0, float(times[-1]))
    rates = compiled_rates(parameters, speed)
    solution = solve_ivp(rates, span, at_rest(), "DOP853", times, rtol=1e-9, atol=1e-14)
    assert solution.success
    modal = np.ascontiguousarray(solution.y.T).view(np.complex128)[:, :6]
    path = modal @ ModalSystem.from_parameters(parameters).shaft.probe
    return np.stack((path.real, path.imag))


def apart(parameters: ModelParameters, orbit: SynchronousOrbit, turns: int) -> FloatArray:
    """Largest distance of a disturbed motion from the synchronous one in each turn, m."""
    still, disturbed = (ShaftMotion(parameters, orbit.speed, 1) for _ in range(2))
    still.set_initial_state(orbit.initial_state)
    disturbed.set_initial_state(orbit.initial_state + 1e-10 * orbit.disturbance)
    return np.asarray(
        np.abs(disturbed.integrate_turns(turns) - still.integrate_turns(turns))
        .max(axis=0)
        .reshape(turns, -1)
        .max(axis=1)
    )


def test_compiled_and_numpy_equations_are_equal() -> None:
    state = 1e-6 * np.random.default_rng(7).standard_normal(at_rest().size)
    compiled, plain = (make(gj90c(), 1100.0)(0.3, state) for make in (compiled_rates, numpy_rates))
    assert compiled == pytest.approx(plain, rel=1e-9)


@pytest.mark.parametrize(("speed", "imbalance"), [(1100.0, 5e-7), (1900.0, 5e-7), (1500.0, 2e-6)])
def test_motion_equals_explicit_integration_over_ten_turns(speed: float, imbalance: float) -> None:
    parameters, steps = gj90c(imbalance=imbalance), 128
    step = 2 * math.pi / (speed * steps)
    angle = speed * step * np.arange(1, 10 * steps + 1, dtype=np.float64)
    path = ShaftMotion(parameters, speed, 0).advance(angle, np.full(angle.size, speed), step)
    expected = explicit(parameters, speed, step * np.arange(1, angle.size + 1, dtype=np.float64))
    assert np.ptp(expected, axis=1).min() > 10e-6
    assert np.abs(path - expected).max() < 0.05e-6


@pytest.mark.parametrize("speed", [600.0, 1000.0, 1500.0, 1900.0])
def test_growth_rate_is_that_of_a_transient(speed: float) -> None:
    orbit = synchronous_orbit(gj90c(), speed)
    size = apart(gj90c(), orbit, TURNS)
    turns = np.arange(TURNS)
    small = (turns >= 20) & (
        np.maximum.accumulate(size) < 1e-7
    )  # the first turns contain other modes; large disturbances are nonlinear
    assert small.sum() > 60
    per_turn = np.polyfit(turns[small], np.log(size[small]), 1)[0]
    assert per_turn * speed / (2 * math.pi) == pytest.approx(orbit.growth_rate, rel=0.05)


def test_onset_by_eigenvalue_lies_between_a_transient_that_decays_and_one_that_grows() -> None:
    (band,) = stability(gj90c(), np.array([700.0, 900.0]), precision=0.5).bands
    assert band.start == pytest.approx(800, abs=2)  # 7,640 r/min
    for speed, sign in ((band.start - 10, -1), (band.start + 10, 1)):
        size = apart(gj90c(), synchronous_orbit(gj90c(), speed), TURNS)
        half = TURNS // 2
        change = math.log(size[-32:].max() / size[half : half + 32].max())
        assert sign * change > 0.01
