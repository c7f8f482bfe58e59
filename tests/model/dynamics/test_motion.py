import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from model.dynamics.modal_system import ModalSystem
from model.dynamics.motion import ShaftMotion
from model.dynamics.stability import synchronous_orbit
from model.dynamics.synchronous import synchronous_response
from model.errors import WallContactError
from model.films.film import bearing_films
from model.linear.modes import free_modes
from model.rotor.gj90c import gj90c
from model.rotor.parameters import FilmModel, Imbalance, ModelParameters

FloatArray = NDArray[np.float64]


def turning(speed: float, turns: float, steps: int) -> tuple[FloatArray, FloatArray, float]:
    """Angle, speed and step of a constant speed from theta = 0."""
    step = 2 * math.pi / (speed * steps)
    angle = speed * step * np.arange(1, round(turns * steps) + 1, dtype=np.float64)
    return angle, np.full(angle.size, speed), step


def written_out(parameters: ModelParameters, speed: float, times: FloatArray) -> FloatArray:
    """Motion from rest in the centre: independent equations from the matrices, integrated by SciPy."""
    rotor, bearing = parameters.rotor, parameters.floating_ring
    shapes = free_modes(rotor, 6).shapes
    M, J, K = rotor.mass_matrix(), rotor.gyroscopic_matrix(), rotor.stiffness_matrix()
    K = shapes.T @ K @ shapes
    G = shapes.T @ J @ shapes
    assert shapes.T @ M @ shapes == pytest.approx(np.eye(6), abs=1e-9)
    films, journals = bearing_films(bearing), list(rotor.journals)
    weight = -1j * parameters.gravity * np.diag(M) * np.tile([1.0, 0.0], rotor.stations)

    def rates(time: float, flat: FloatArray) -> FloatArray:
        state = flat.view(np.complex128)
        q, z_r, v, v_r = state[:6], state[6:8], state[8:14], state[14:16]
        z_j, v_j = (shapes @ q)[journals], (shapes @ v)[journals]
        force = weight.copy()
        for one in parameters.imbalances:
            place = rotor.displacement(one.station)
            force[place] += one.magnitude * speed**2 * np.exp(1j * (speed * time + one.phase))
        ring = np.empty(2, np.complex128)
        for b in range(2):
            inner = films.inner.force(z_j[b] - z_r[b], v_j[b] - v_r[b], films.inner_speed * speed)
            outer = films.outer.force(z_r[b], v_r[b], films.outer_speed * speed)
            force[journals[b]] += inner
            ring[b] = (outer - inner) / bearing.ring_mass - 1j * parameters.gravity
        bend = shapes.T @ force + 1j * speed * G @ v - K @ q
        return np.concatenate((v, v_r, bend, ring)).view(np.float64)

    span = (0.0, float(times[-1]))
    solution = solve_ivp(rates, span, np.zeros(32), "LSODA", times, rtol=1e-9, atol=1e-13)
    assert solution.success
    q = np.ascontiguousarray(solution.y.T).view(np.complex128)[:, :6]
    path = q @ shapes[rotor.displacement(parameters.probe_station)]
    return np.stack((path.real, path.imag))


@pytest.mark.parametrize("model", list(FilmModel))
def test_motion_equals_the_solution_of_scipy(default: ModelParameters, model: FilmModel) -> None:
    imbalances = Imbalance(5, 8e-7, 0.4), Imbalance(2, 3e-7, -2.0)
    parameters = replace(default, bearing=replace(default.floating_ring, film_model=model), imbalances=imbalances)
    speed = 1100.0
    angle, speeds, step = turning(speed, 5, 128)
    path = ShaftMotion(parameters, speed, 0).advance(angle, speeds, step)
    expected = written_out(parameters, speed, step * np.arange(1, angle.size + 1, dtype=np.float64))
    assert np.ptp(expected) > 20e-6
    assert np.abs(path - expected).max() < 0.05e-6


def test_error_is_second_order_in_the_step(default: ModelParameters) -> None:
    # From a smooth state: the first steps from rest are a shock.
    def after_two_turns(steps: int) -> FloatArray:
        motion = ShaftMotion(default, 1100.0, 40)
        angle, speeds, step = turning(1100.0, 2, steps)
        return motion.advance(angle, speeds, step)[:, steps - 1 :: steps]

    paths = [after_two_turns(steps) for steps in (64, 128, 256, 512)]
    errors = [float(np.abs(a - b).max()) for a, b in itertools.pairwise(paths)]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert orders == pytest.approx([2, 2], abs=0.25)


@pytest.mark.parametrize("speed", [2000.0, 4000.0])
def test_stable_motion_is_the_synchronous_one(weightless: ModelParameters, speed: float) -> None:
    response = synchronous_response(weightless, speed)
    assert response.growth_rate < 0
    motion = ShaftMotion(weightless, speed, 250)
    motion.integrate_turns(10, 256)
    path = motion.integrate_turns(2, 256)
    theta = 2 * math.pi * np.arange(512) / 256
    circle = complex(np.mean((path[0] + 1j * path[1]) * np.exp(-1j * theta)))
    assert abs(circle - response.circle) < 1e-3 * abs(response.circle)


def test_motion_does_not_depend_on_the_division_into_calls(default: ModelParameters) -> None:
    step, n = 2e-5, 1500
    speed = 800 + 400 * np.sin(np.linspace(0, 3, n))
    angle = np.cumsum(speed) * step
    whole = ShaftMotion(default, 800.0, 20).advance(angle, speed, step)
    for cut in (1, 7, 400):
        motion = ShaftMotion(default, 800.0, 20)
        parts = [motion.advance(angle[k : k + cut], speed[k : k + cut], step) for k in range(0, n, cut)]
        assert np.array_equal(np.concatenate(parts, axis=1), whole)


def test_coarse_steps_are_divided_internally(default: ModelParameters) -> None:
    coarse_angle, coarse_speed, coarse_step = turning(1100.0, 3, 16)
    fine_angle, fine_speed, fine_step = turning(1100.0, 3, 64)
    coarse = ShaftMotion(default, 1100.0, 20).advance(coarse_angle, coarse_speed, coarse_step)
    fine = ShaftMotion(default, 1100.0, 20).advance(fine_angle, fine_speed, fine_step)
    assert np.abs(coarse - fine[:, 3::4]).max() < 1e-9


def test_settled_motion_is_periodic(default: ModelParameters) -> None:
    first, second = np.split(ShaftMotion(default, 300.0, 150).integrate_turns(2), 2, axis=1)
    assert np.abs(first - second).max() < 0.02 * np.ptp(first)


def test_motion_starts_at_the_given_angle(default: ModelParameters) -> None:
    straight = ShaftMotion(default, 500.0, 100)
    turned = ShaftMotion(default, 500.0, 100, angle=2.0)
    angle, speeds, step = turning(500.0, 1, 64)
    late = turned.advance(2.0 + angle, speeds, step)
    # theta = 2 rad comes 2 rad later: compare 1X
    early = straight.advance(angle, speeds, step)
    first = np.mean(early[0] * np.exp(-1j * angle))
    second = np.mean(late[0] * np.exp(-1j * (2.0 + angle)))
    assert second == pytest.approx(first, rel=0.02)


def test_phase_of_the_imbalance_rotates_the_synchronous_motion(default: ModelParameters) -> None:
    ahead = replace(default, imbalances=(Imbalance(5, 5e-7, 1.0),))
    mark = synchronous_response(default, 600.0)
    assert synchronous_response(ahead, 600.0).vectors == pytest.approx(mark.vectors * np.exp(1j), rel=1e-6)


def test_standing_shaft_sinks_until_the_film_is_squeezed(default: ModelParameters) -> None:
    motion = ShaftMotion(default, 0.0, 5)
    deep = motion.displacement[1]
    motion.advance(np.zeros(50), np.zeros(50), 2e-3)
    assert -100e-6 < motion.displacement[1] < deep < 0


def test_change_of_speed_preserves_the_position(default: ModelParameters) -> None:
    motion = ShaftMotion(default, 500.0, 50)
    before = motion.displacement
    motion.change_speed(520.0)
    assert motion.speed == 520.0
    assert np.array_equal(motion.displacement, before)
    assert np.abs(motion.integrate_turns(4)).max() < 100e-6


def test_wall_contact_error_names_film_and_speed() -> None:
    dry = gj90c(viscosity=1e-10)
    with pytest.raises(WallContactError, match=r"eccentricity: the ring reached .* µm of the outer .* at 10\.0 rad/s"):
        ShaftMotion(dry, 10.0)


@pytest.mark.parametrize(
    ("ring", "film"), [(81e-6, "inner"), (1.0, "inner"), (79.9999e-6, "inner")], ids=["beyond", "far beyond", "at it"]
)
def test_state_beyond_the_wall_is_refused_without_effect(default: ModelParameters, ring: float, film: str) -> None:
    motion = ShaftMotion(default, 900.0, 5)
    before, beyond = motion.state, motion.state
    beyond[0, -1] = ring
    message = (
        rf"eccentricity: the journal reached .* µm of the {film} film's clearance of 20 µm at 950\.0 rad/s, expected"
    )
    with pytest.raises(WallContactError, match=message):
        motion.resume(beyond, 950.0)
    assert np.array_equal(motion.state, before)
    beyond[0] = 0
    beyond[0, -1] = 80e-6  # the ring in the housing, the journal in the middle of the ring
    beyond[0, :6] = np.linalg.lstsq(
        ModalSystem.from_parameters(default).shaft.journals, np.array([0, 80e-6]), rcond=None
    )[0]
    with pytest.raises(WallContactError, match=r"eccentricity: the ring reached 80\.00 µm of the outer film's"):
        motion.resume(beyond, 950.0)
    beyond[0, -1] = np.nan
    with pytest.raises(ValueError, match="state: expected finite values"):
        motion.resume(beyond, 950.0)


def test_disturbance_beyond_the_wall_is_an_error(default: ModelParameters) -> None:
    orbit = synchronous_orbit(default, 900.0)
    with pytest.raises(WallContactError, match=r"eccentricity: the .* reached .* at 900\.0 rad/s"):
        ShaftMotion(default, 900.0, 5).disturb(30e-6 * orbit.disturbance)
    with pytest.raises(WallContactError, match=r"eccentricity: the .* reached .* at 900\.0 rad/s"):
        ShaftMotion(default, 900.0, 5).set_initial_state(orbit.initial_state + 90e-6 * orbit.disturbance)


@pytest.mark.parametrize(
    ("speed", "turns", "angle", "message"),
    [
        (-1.0, 10, 0.0, r"speed: -1 rad/s, expected a finite value, 0 or more"),
        (math.nan, 10, 0.0, r"speed: nan rad/s"),
        (100.0, -1, 0.0, r"turns_to_settle: -1, expected 0 or more"),
        (100.0, 1, math.inf, r"angle: inf rad"),
    ],
)
def test_invalid_start_is_refused(
    default: ModelParameters, speed: float, turns: int, angle: float, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        ShaftMotion(default, speed, turns, angle=angle)


def test_invalid_time_history_is_refused(default: ModelParameters) -> None:
    motion = ShaftMotion(default, 100.0, 0)
    zeros = np.zeros(3)
    with pytest.raises(ValueError, match=r"shapes \(3,\) and \(2,\), expected \(n,\) twice"):
        motion.advance(zeros, zeros[:2], 1e-4)
    with pytest.raises(ValueError, match="step: 0 s"):
        motion.advance(zeros, zeros, 0.0)
    with pytest.raises(ValueError, match="speed: -5 rad/s"):
        motion.advance(zeros, zeros - 5, 1e-4)
    with pytest.raises(ValueError, match="angle: expected finite values, rad"):
        motion.advance(zeros + np.nan, zeros, 1e-4)
    with pytest.raises(ValueError, match=r"step: 1 s, expected at most .* s at 100 rad/s"):
        motion.advance(zeros, zeros, 1.0)
    with pytest.raises(ValueError, match="speed: 0 rad/s, expected a turning shaft"):
        ShaftMotion(default, 0.0, 0).integrate_turns(1)
