"""The eight linear coefficients: closed forms, differentiation and perturbation agree."""

import math
from dataclasses import replace
from typing import cast

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from model.errors import EquilibriumError
from model.films.coefficients import (
    LinearCoefficients,
    differentiated_coefficients,
    finite_film_equilibrium,
    floating_ring_coefficients,
    perturbed_coefficients,
    series_impedance,
    short_film_attitude,
    short_film_coefficients,
    short_film_load,
    short_film_ratios,
)
from model.films.film import Film, bearing_films
from model.films.finite_film import Flow, Grid, pressure_unit, slenderness, solve_reynolds
from model.films.lubrication import table_3_1
from model.rotor.parameters import FilmModel

FloatArray = NDArray[np.float64]

ECCENTRICITIES = tuple(round(0.1 * n, 1) for n in range(1, 10))
FILM = Film(radius=5e-3, length=10e-3, clearance=20e-6, viscosity=0.015)
SPEED = 1000.0


def closed(eccentricity: float, film: Film = FILM) -> LinearCoefficients:
    load = short_film_load(eccentricity, film.model) * film.factor * SPEED
    return short_film_coefficients(film, load, SPEED)


@pytest.mark.parametrize(
    ("eccentricity", "stiffness", "damping"),
    [
        (0.1, (2.5308, 9.7577, -10.3811, 1.3284), (19.7905, -2.5325, 20.4872)),
        (0.3, (2.4126, 2.6246, -4.4825, 1.7949), (6.0612, -2.4270, 8.1530)),
        (0.5, (2.2099, 0.8577, -3.9766, 2.9233), (3.0539, -2.2450, 6.6148)),
        (0.7, (1.9695, -0.1734, -4.5347, 5.6594), (1.6240, -2.0267, 7.0987)),
        (0.9, (1.7294, -1.4213, -7.2637, 19.0955), (0.6869, -1.8059, 10.9978)),
    ],
)
def test_closed_forms_have_the_tabulated_values(
    eccentricity: float, stiffness: tuple[float, ...], damping: tuple[float, float, float]
) -> None:
    a, b = short_film_ratios(eccentricity)
    assert a.ravel() == pytest.approx(stiffness, abs=6e-5)
    assert b.ravel() == pytest.approx((damping[0], damping[1], damping[1], damping[2]), abs=6e-5)


@pytest.mark.parametrize("eccentricity", ECCENTRICITIES)
def test_differentiated_force_has_the_coefficients_of_the_closed_forms(eccentricity: float) -> None:
    expected = closed(eccentricity)
    found = differentiated_coefficients(FILM, expected.position, SPEED)
    assert found.force == pytest.approx(expected.force, rel=1e-10)
    assert found.stiffness == pytest.approx(expected.stiffness, rel=1e-6)
    assert found.damping == pytest.approx(expected.damping, rel=1e-6)


@pytest.mark.parametrize("eccentricity", ECCENTRICITIES)
def test_differentiated_force_without_cavity_has_the_coefficients_of_the_closed_forms(eccentricity: float) -> None:
    film = replace(FILM, model=FilmModel.FULL_SOMMERFELD)
    expected = closed(eccentricity, film)
    assert abs(expected.position) == pytest.approx(eccentricity * film.clearance, rel=1e-9)
    assert film.force(expected.position, 0j, SPEED) == pytest.approx(expected.force, rel=1e-9)
    found = differentiated_coefficients(film, expected.position, SPEED)
    assert found.force == pytest.approx(expected.force, rel=1e-9)
    scale = abs(expected.stiffness).max(), abs(expected.damping).max()
    assert found.stiffness == pytest.approx(expected.stiffness, rel=1e-9, abs=1e-12 * scale[0])
    assert found.damping == pytest.approx(expected.damping, rel=1e-9, abs=1e-12 * scale[1])


@pytest.mark.parametrize("eccentricity", ECCENTRICITIES)
def test_perturbation_with_axial_flow_only_has_the_coefficients_of_the_closed_forms(eccentricity: float) -> None:
    expected = closed(eccentricity)
    around = 32768
    thickest = float(np.angle(expected.position)) + math.pi
    grid = Grid(around, 2, first_angle=thickest + math.pi / around)  # the ends of the film are between nodes
    found = perturbed_coefficients(FILM, expected.position, SPEED, grid, Flow.AXIAL)
    assert found.force == pytest.approx(expected.force, rel=1e-6)
    assert found.stiffness == pytest.approx(expected.stiffness, rel=1e-6)
    assert found.damping == pytest.approx(expected.damping, rel=1e-6)


@pytest.mark.parametrize("slenderness", [0.5, 1.0])
def test_perturbation_of_a_finite_film_equals_differences_of_its_solution(slenderness: float) -> None:
    film = Film(5e-3, slenderness * 10e-3, 20e-6, 0.012)
    position = 0.5 * film.clearance * np.exp(-0.5j)
    grid = Grid(96, 8)
    found = perturbed_coefficients(film, position, SPEED, grid)
    step = 1e-6 * film.clearance

    def difference(move: complex, velocity: complex, size: float) -> complex:
        ahead = solve_reynolds(film, position + move, velocity, SPEED, grid).force
        back = solve_reynolds(film, position - move, -velocity, SPEED, grid).force
        return -(ahead - back) / (2 * size)

    for column, direction in enumerate((1, 1j)):
        stiffness = difference(direction * step, 0j, step)
        damping = difference(0j, direction * step * SPEED, step * SPEED)
        assert found.stiffness[:, column] == pytest.approx((stiffness.real, stiffness.imag), rel=1e-6)
        assert found.damping[:, column] == pytest.approx((damping.real, damping.imag), rel=1e-6)


def printed_perturbation(film: Film, position: complex, grid: Grid) -> tuple[FloatArray, FloatArray]:
    """Stiffness and damping from (4.24)-(4.27) of the thesis, corrected and with the axial flow."""
    rest = solve_reynolds(film, position, 0j, SPEED, grid)
    unit = pressure_unit(film)
    p = rest.pressure[:-1] / unit
    psi = grid.angles - math.pi / 2  # the thesis measures from +Y
    z = position / film.clearance
    h = 1 - (z * np.exp(-1j * grid.angles)).real
    slope = (1j * z * np.exp(-1j * grid.angles)).real
    slope_p = (np.roll(p, -1, axis=1) - np.roll(p, 1, axis=1)) / (2 * grid.width)
    sin, cos = np.sin(psi), np.cos(psi)
    right = (
        6 * SPEED * (cos - 3 * sin * slope / h) - 3 * h**3 * slope_p * (cos * h - sin * slope) / h**2,  # Eq. (4.24)
        6 * SPEED * (sin + 3 * cos * slope / h) + 3 * h**3 * slope_p * (-sin * h - cos * slope) / h**2,  # Eq. (4.25)
        12 * sin,  # Eq. (4.26)
        -12 * cos,  # Eq. (4.27)
    )
    h_faces = 1 - (z * np.exp(-1j * grid.faces)).real
    matrix = grid.flow_matrix(h**3, h_faces**3, slenderness(film), Flow.BOTH)
    is_full_film = np.flatnonzero(rest.is_full_film)
    solver = splu(matrix[is_full_film][:, is_full_film].tocsc())
    coefficients = np.zeros((4, 2))
    for row, side in zip(coefficients, right, strict=True):
        change = np.zeros(p.size)
        change[is_full_film] = solver.solve(-(side * grid.lengths[:, np.newaxis] * grid.width).ravel()[is_full_film])
        resultant = unit * film.radius * film.length / film.clearance * grid.resultant(change)
        row[:] = resultant.real, resultant.imag
    return coefficients[:2].T, coefficients[2:].T


def test_perturbed_equations_of_the_thesis_converge_to_the_same_coefficients() -> None:
    film = Film(5e-3, 10e-3, 20e-6, 0.012)
    position = 0.5 * film.clearance * np.exp(-0.5j)
    errors = []
    for around in (96, 192, 384):
        grid = Grid(around, around // 12)
        found = perturbed_coefficients(film, position, SPEED, grid)
        stiffness, damping = printed_perturbation(film, position, grid)
        assert damping == pytest.approx(found.damping, rel=1e-9)
        errors.append(float(np.max(np.abs(stiffness / found.stiffness - 1))))
    assert errors[-1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.1)


def test_load_and_attitude_of_the_short_film_are_those_of_its_force() -> None:
    for eccentricity in ECCENTRICITIES:
        angle = short_film_attitude(eccentricity) - math.pi / 2
        force = FILM.force(eccentricity * FILM.clearance * np.exp(1j * angle), 0j, SPEED)
        assert force.imag == pytest.approx(short_film_load(eccentricity) * FILM.factor * SPEED, rel=1e-12)
        assert force.real == pytest.approx(0, abs=1e-12 * force.imag)


@pytest.mark.parametrize("load", [1e-6, 1.0, 1e4])
def test_short_film_equilibrium_is_found_under_any_load(load: float) -> None:
    found = short_film_coefficients(FILM, load, SPEED)
    assert FILM.force(found.position, 0j, SPEED) == pytest.approx(1j * load, rel=1e-8)


@pytest.mark.parametrize("load", [0.01, 10.0, 300.0])
def test_finite_film_equilibrium_balances_its_load(load: float) -> None:
    grid = Grid(96, 8)
    found = finite_film_equilibrium(FILM, load, SPEED, grid)
    assert solve_reynolds(FILM, found.position, 0j, SPEED, grid).force == pytest.approx(1j * load, rel=1e-8)
    assert abs(found.position) > abs(short_film_coefficients(FILM, load, SPEED).position)  # it carries less


def test_floating_ring_coefficients_use_ring_weight_and_ring_speed() -> None:
    bearing = table_3_1()
    inner, outer = floating_ring_coefficients(bearing, 10.0, 1000.0)
    films = bearing_films(bearing)
    assert films.inner.force(inner.position, 0j, 1000 * films.inner_speed) == pytest.approx(10j, rel=1e-8)
    assert films.outer.force(outer.position, 0j, 593.12) == pytest.approx(10.196j, rel=1e-4)


def test_series_impedance_has_its_limits_for_springs_and_for_a_fixed_or_free_ring() -> None:
    def spring(stiffness: float) -> LinearCoefficients:
        return LinearCoefficients(0j, 0j, stiffness * np.eye(2), np.zeros((2, 2)))

    assert series_impedance(spring(2.0), spring(6.0), 0.0, 10.0) == pytest.approx(1.5 * np.eye(2))
    assert series_impedance(spring(2.0), spring(1e12), 0.02, 10.0) == pytest.approx(2 * np.eye(2))
    assert series_impedance(spring(1e6), spring(0.0), 0.02, 10.0) == pytest.approx(-2 * np.eye(2), rel=1e-4)  # -m w²


def test_impedance_combines_stiffness_and_damping() -> None:
    found = closed(0.4)
    expected: NDArray[np.complex128] = found.stiffness + 250j * found.damping
    assert found.impedance(250.0) == pytest.approx(expected)


@pytest.mark.parametrize("eccentricity", [0.0, 1.0, -0.5, math.nan])
def test_closed_forms_refuse_an_eccentricity_outside_their_range(eccentricity: float) -> None:
    for function in (short_film_ratios, short_film_load, short_film_attitude):
        with pytest.raises(ValueError, match="eccentricity"):
            function(eccentricity)


def test_short_film_coefficients_refuse_invalid_values() -> None:
    with pytest.raises(ValueError, match="load: 0 N, expected"):
        short_film_coefficients(FILM, 0.0, SPEED)
    with pytest.raises(ValueError, match="surface_speed: -1 rad/s, expected"):
        short_film_coefficients(FILM, 1.0, -1.0)
    with pytest.raises(EquilibriumError, match=r"load: 1e\+30 N presses the inner body to"):
        short_film_coefficients(FILM, 1e30, SPEED)


def test_differentiated_coefficients_refuse_invalid_values() -> None:
    with pytest.raises(ValueError, match="eccentricity: 0 of the clearance"):
        differentiated_coefficients(FILM, 0j, SPEED)
    with pytest.raises(ValueError, match="surface_speed: 0 rad/s"):
        differentiated_coefficients(FILM, 1e-5 + 0j, 0.0)


def test_finite_film_equilibrium_refuses_a_load_that_its_grid_cannot_resolve() -> None:
    with pytest.raises(ValueError, match=r"around: 48 nodes, expected at least \d+ to resolve the film"):
        finite_film_equilibrium(FILM, 1e5, SPEED, Grid(48, 4))


def test_finite_film_equilibrium_without_convergence_is_an_error() -> None:
    with pytest.raises(
        EquilibriumError, match=r"load: 300 N is not balanced after 2 steps .* expected at most 3e-07 N"
    ):
        finite_film_equilibrium(FILM, 300.0, SPEED, Grid(96, 8), max_steps=2)


def test_perturbation_without_rotation_has_no_coefficients() -> None:
    found = perturbed_coefficients(FILM, 0.5 * FILM.clearance + 0j, 0.0, Grid(48, 4))
    assert found.force == 0
    assert not np.any(found.stiffness)
    assert not np.any(found.damping)


def test_perturbation_of_a_centred_film_has_no_force_and_only_cross_stiffness() -> None:
    found = perturbed_coefficients(FILM, 1e-6 * FILM.clearance + 0j, SPEED, Grid(96, 8))
    K = found.stiffness
    assert abs(K[0, 0]) < 0.05 * abs(K[1, 0])


def test_closed_forms_reject_a_film_model_without_one() -> None:
    unknown = cast("FilmModel", "unknown")
    for closed_form in (short_film_ratios, short_film_load, short_film_attitude):
        with pytest.raises(AssertionError, match="unknown"):
            closed_form(0.5, unknown)
