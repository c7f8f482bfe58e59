"""Linear supports and walls in the motion: closed forms, the linear solution, and an explicit integration."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from model.dynamics.modal_system import ModalSystem
from model.dynamics.motion import ShaftMotion
from model.dynamics.synchronous import synchronous_response
from model.errors import WallContactError
from model.linear.linear_system import linear_system
from model.linear.response import imbalance_response, static_deflection
from model.rotor.gj90c import gj90c
from model.rotor.parameters import Imbalance, ModelParameters
from model.rotor.rotor import Disc, Rotor, Segment
from model.rotor.supports import Rub, StaticLoad, Support, SupportCoefficients
from model.studies.sweep_quantities import with_values
from tests.model.dynamics.equations import at_rest, constrained_rates

FloatArray = NDArray[np.float64]

SPRINGS = tuple(Support(station, SupportCoefficients.isotropic(1e6, 100.0)) for station in (2, 3))
ELLIPTIC = (
    Support(1, SupportCoefficients(((1e6, 2e5), (-1e5, 3e6)), ((100.0, 0.0), (0.0, 60.0)))),
    Support(
        4,
        SupportCoefficients(((2e6, 0.0), (0.0, 1e6)), ((80.0, 0.0), (0.0, 60.0))),
        SupportCoefficients(((5e6, 0.0), (0.0, 4e6)), ((200.0, 0.0), (0.0, 200.0))),
        0.05,
    ),
)
SOFT = (
    Support(1, SupportCoefficients(((1e5, 2e4), (-1e4, 3e5)), ((10.0, 0.0), (0.0, 6.0)))),
    Support(
        4,
        SupportCoefficients(((2e5, 0.0), (0.0, 1e5)), ((8.0, 0.0), (0.0, 6.0))),
        SupportCoefficients(((5e5, 0.0), (0.0, 4e5)), ((20.0, 0.0), (0.0, 20.0))),
        0.05,
    ),
)


WALL = Rub(4, 12e-6, 3e5, 20e-3, 0.05, 0.2)  # soft: the shaft stays in contact


def rotor(masses: tuple[float, ...] = (0.07, 0.015, 0.02, 0.08)) -> Rotor:
    """Four stations, journals at the inner two: few enough modes for both solvers to use all."""
    return Rotor(
        segments=tuple(Segment(length, 5e-3) for length in (25e-3, 30e-3, 25e-3)),
        discs=tuple(Disc(station, mass, 5e-6, 8e-6) for station, mass in enumerate(masses, 1)),
        bearing_stations=(2, 3),
    )


def shaken(**changes: object) -> ModelParameters:
    found = replace(gj90c(), rotor=rotor(), imbalances=(Imbalance(4, 2e-6, 0.3), Imbalance(1, 2e-7, 2.0)))
    return replace(found, **changes)  # type: ignore[arg-type]  # any field


def dry(**changes: object) -> ModelParameters:
    """The same rotor without weight and with negligible films."""
    found = shaken(gravity=0.0, **changes)
    return replace(found, bearing=replace(found.floating_ring, viscosity=1e-12))


def first_order(turns: FloatArray, points: int) -> NDArray[np.complex128]:
    back = np.exp(-2j * math.pi * np.arange(turns.shape[-1]) / points)
    return np.asarray(2 * (turns * back).mean(axis=-1))


@pytest.mark.parametrize("supports", [SPRINGS, ELLIPTIC], ids=["round", "elliptic"])
@pytest.mark.parametrize("speed", [700.0, 1600.0])
def test_motion_on_linear_supports_alone_is_the_linear_solution(supports: tuple[Support, ...], speed: float) -> None:
    parameters = dry(supports=supports, imbalances=(Imbalance(4, 5e-7, 0.3), Imbalance(1, 2e-7, 2.0)))
    expected = imbalance_response(linear_system(parameters.rotor, supports), parameters.imbalances, [speed])[0]
    motion = ShaftMotion(parameters, speed, 60)
    motion.integrate_turns(100, 256)
    found = first_order(motion.integrate_stations(4, 256), 256).T
    assert np.abs(found - expected).max() < 1e-3 * np.abs(expected).max()
    response = synchronous_response(parameters, speed)
    assert np.abs(response.stations - expected).max() < 1e-3 * np.abs(expected).max()
    assert response.vectors == pytest.approx(expected[:, 0], rel=1e-3)


@pytest.mark.parametrize("supports", [SPRINGS, ELLIPTIC], ids=["round", "elliptic"])
def test_synchronous_response_on_films_and_supports_is_the_motion(supports: tuple[Support, ...]) -> None:
    parameters = shaken(supports=supports, gravity=0.0)
    response = synchronous_response(parameters, 1500.0)
    assert response.growth_rate < 0
    motion = ShaftMotion(parameters, 1500.0, 100)
    motion.integrate_turns(50, 256)
    found = first_order(motion.integrate_stations(4, 256), 256).T
    assert np.abs(found - response.stations).max() < 1e-3 * np.abs(found).max()
    free = synchronous_response(shaken(gravity=0.0), 1500.0)
    assert abs(free.circle - response.circle) > 0.2 * abs(free.circle)


def test_synchronous_response_in_full_annular_rub_is_the_motion() -> None:
    parameters = shaken(gravity=0.0, rubs=(WALL,))
    response = synchronous_response(parameters, 1500.0)
    assert response.growth_rate < 0
    assert abs(response.stations[0, 3]) > 1.5 * WALL.clearance
    motion = ShaftMotion(parameters, 1500.0, 150)
    motion.integrate_turns(60, 256)
    found = first_order(motion.integrate_stations(4, 256), 256).T
    assert np.abs(found - response.stations).max() < 1e-3 * np.abs(found).max()


@pytest.mark.parametrize(
    ("supports", "rubs"),
    [
        ((), (Rub(1, 25e-6, 1e6, 20e-3, 0.1, 0.5), Rub(4, 30e-6, 1e6, 20e-3, 0.2))),
        (SOFT, (Rub(1, 15e-6, 1e6, 10e-3, 0.1, 0.5),)),
    ],
    ids=["bouncing", "held and rubbing"],
)
def test_motion_equals_explicit_integration_with_tight_tolerance(
    supports: tuple[Support, ...], rubs: tuple[Rub, ...]
) -> None:
    speed, steps, turns = 1500.0, 256, 5
    parameters = shaken(supports=supports, rubs=rubs)
    system = ModalSystem.from_parameters(parameters)
    modes, rings = system.shaft.squared_frequencies.size, system.rings.mass.size
    times = 2 * math.pi / (speed * steps) * np.arange(turns * steps)
    path = ShaftMotion(parameters, speed, 0).integrate_stations(turns, steps)
    rates, start = constrained_rates(parameters, speed, modes), at_rest(modes, rings)
    solution = solve_ivp(rates, (0.0, float(times[-1])), start, "LSODA", times, rtol=1e-9, atol=1e-13)
    assert solution.success
    expected = system.stations @ np.ascontiguousarray(solution.y.T).view(np.complex128)[:, :modes].T
    for rub in rubs:
        touches = np.abs(expected[rub.station - 1]) > rub.clearance
        assert 0.01 < touches.mean() < 0.9
        assert np.abs(np.diff(touches.astype(int))).sum() >= 2
    assert np.abs(path[:, 0] + 1j * path[:, 1] - expected).max() < 0.05e-6


def test_error_is_second_order_in_the_step_in_contact() -> None:
    # full annular rub, with steps so short that none is divided
    parameters = shaken(gravity=0.0, rubs=(WALL,))

    def after_two_turns(steps: int) -> FloatArray:
        motion = ShaftMotion(parameters, 1500.0, 100)
        return motion.integrate_stations(3, steps)[:, :, ::steps]

    assert np.linalg.norm(after_two_turns(128)[3], axis=0).min() > WALL.clearance
    paths = [after_two_turns(steps) for steps in (128, 256, 512, 1024)]
    errors = [float(np.abs(a - b).max()) for a, b in itertools.pairwise(paths)]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert orders == pytest.approx([2, 2], abs=0.25)


def test_shaft_pressed_onto_a_wall_rests_in_force_balance() -> None:
    load, wall = 5.0, Rub(4, 5e-6, 1e6, 10e-3, 0.3)
    parameters = dry(supports=SPRINGS, rubs=(wall,), loads=(StaticLoad(4, load, 0.0),), imbalances=())
    motion = ShaftMotion(parameters, 300.0, 40)
    found = complex(*motion.integrate_stations(1)[3].mean(axis=1))
    # z = s (W - (1 + i mu) k (|z| - c) z / |z|): springs give the compliance s
    compliance = static_deflection(linear_system(parameters.rotor, SPRINGS), [StaticLoad(4, 1.0, 0.0)])[0, 3]

    def pressed(size: float) -> complex:
        return complex(1 + compliance * (1 + 1j * wall.friction) * wall.stiffness * (1 - wall.clearance / size))

    size = brentq(lambda size: size * abs(pressed(size)) - compliance * load, wall.clearance, 1e-4, xtol=1e-18)
    assert size > 1.2 * wall.clearance
    assert found == pytest.approx(compliance * load / pressed(size), rel=1e-4)


def bounce(parameters: ModelParameters, velocity: float, step: float, steps: int) -> list[NDArray[np.complex128]]:
    """Motion of a non-rotating shaft with an initial velocity of its first mode in X."""
    motion = ShaftMotion(parameters, 50.0, 0)
    system = ModalSystem.from_parameters(parameters)
    modes = system.shaft.squared_frequencies.size
    initial_state = np.zeros((2, modes + system.rings.mass.size), np.complex128)
    initial_state[1, 0] = velocity / system.stations[0, 0] / motion.speed
    motion.set_initial_state(initial_state.ravel().view(np.float64))
    states = []
    for number in range(1, steps + 1):
        motion.advance(np.array([motion.speed * step * number]), np.array([motion.speed]), step)
        states.append(motion.state)
    return states


def test_undamped_frictionless_wall_conserves_energy() -> None:
    rub = Rub(1, 5e-6, 1e6, 10e-3)
    parameters = dry(rubs=(rub,), imbalances=())
    system = ModalSystem.from_parameters(parameters)
    energies, depths = [], []
    for state in bounce(parameters, 0.01, 2e-6, 900):
        q, v = state[:2, : system.shaft.squared_frequencies.size]
        depths.append(max(abs(complex(system.stations[0] @ q)) - rub.clearance, 0.0))
        energy = (np.abs(v) ** 2).sum() + (system.shaft.squared_frequencies * np.abs(q) ** 2).sum()
        energies.append(0.5 * float(energy) + 0.5 * rub.stiffness * depths[-1] ** 2)
    assert max(depths) > 1e-6
    assert depths[0] == depths[-1] == 0
    assert energies == pytest.approx([energies[0]] * len(energies), rel=2e-3)
    assert energies[-1] == pytest.approx(energies[0], rel=5e-4)


def test_rebound_from_a_damped_wall_is_that_of_hunt_and_crossley() -> None:
    speed, damping = 2e-3, 250.0
    walls = tuple(Rub(station, 5e-6, 1e4, 10e-3, 0.0, damping) for station in (1, 4))
    alike = dry(rubs=walls, imbalances=())
    parameters = replace(alike, rotor=rotor((0.05, 0.05, 0.05, 0.05)))
    last = bounce(parameters, speed, 1e-4, 150)[-1]
    system = ModalSystem.from_parameters(parameters)
    rebound = -float((system.stations[0, 0] * last[1, 0]).real)
    assert abs(system.stations[0, 0] * last[0, 0]) < walls[0].clearance

    def left(v: float) -> float:  # v - ln(1 + lambda v) / lambda is equal at begin and end of contact
        return v - math.log1p(damping * v) / damping

    expected = brentq(lambda v: left(-v) - left(speed), 0.0, 0.999 / damping)
    assert 0.3 * speed < expected < 0.9 * speed
    assert rebound == pytest.approx(expected, rel=0.01)


def test_divergence_by_friction_is_an_error() -> None:
    parameters = replace(gj90c(imbalance=2e-7), rubs=(Rub(6, 1e-6, 7e8, 25e-3, 0.45),))
    with pytest.raises(
        WallContactError, match=r"rub: the shaft bounces at .* m/s on the wall of station 6 at 1834\.0 rad"
    ):
        ShaftMotion(parameters, 1834.0, 100)
    ShaftMotion(replace(parameters, rubs=(Rub(6, 1e-6, 7e8, 25e-3, 0.1),)), 1834.0, 10)


def test_with_values_changes_the_first_wall_and_support() -> None:
    found = with_values(
        shaken(supports=SOFT, rubs=(WALL,)),
        {"rub_clearance_um": 30.0, "rub_friction": 0.2, "rub_stiffness_n_m": 1e6, "support_stiffness_n_m": 4e5},
    )
    (rub,) = found.rubs
    assert rub.clearance == pytest.approx(30e-6)
    assert replace(rub, clearance=1.0) == Rub(4, 1.0, 1e6, 20e-3, 0.2, WALL.damping)
    assert found.supports[0].inner == SupportCoefficients(((4e5, 0.0), (0.0, 4e5)), SOFT[0].inner.damping)
    assert found.supports[1] == SOFT[1]
    for name in ("rub_damping_s_m", "support_stiffness_n_m"):
        with pytest.raises(ValueError, match=r"(rub|support): none, expected a rotor with \[\[\1\]\]"):
            with_values(gj90c(), {name: 1.0})


def test_default_rotor_has_no_constraints_and_six_modes() -> None:
    system = ModalSystem.from_parameters(gj90c())
    assert system.constraints is None
    assert system.shaft.squared_frequencies.size == 6
    assert (
        ModalSystem.from_parameters(replace(gj90c(), rubs=(Rub(2, 1e-4, 1e6, 1e-2),))).shaft.squared_frequencies.size
        == 12
    )
