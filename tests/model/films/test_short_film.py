"""Force laws of the short film against quadrature of the pressure and against each other."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from model.films.film import Film
from model.films.film_kernels import FORCE_LAWS, capone_force, film_force
from model.films.short_film import (
    CaponeForm,
    capone_forces,
)
from model.rotor.parameters import FilmModel
from model.studies.films import CAVITY_NOTES
from tests.model.films.half_film import LoadedHalf, half_film_force, short_film_pressure

ComplexArray = NDArray[np.complex128]
FILM = Film(radius=5e-3, length=10e-3, clearance=20e-6, viscosity=0.015)
SPEED = 1000.0


class States(NamedTuple):
    position: ComplexArray
    velocity: ComplexArray


def random_states(count: int, largest: float = 0.9, spread: float = 0.3) -> States:
    rng = np.random.default_rng(7)
    position = rng.uniform(0.01, largest, count) * np.exp(1j * rng.uniform(0, 2 * math.pi, count))
    velocity = SPEED * spread * (rng.normal(size=count) + 1j * rng.normal(size=count))
    return States(position, np.asarray(velocity, dtype=np.complex128))


def integrated(position: complex, velocity: complex, speed: float) -> complex:
    """Force by Gauss quadrature of the pressure over length and full-film half."""
    x, weight = np.polynomial.legendre.leggauss(16)
    A = speed * position.real - 2 * velocity.imag
    B = speed * position.imag + 2 * velocity.real
    start = math.atan2(-B, -A)  # the full-film half starts where wedge and squeeze cancel
    edges = np.linspace(start, start + math.pi, 41)
    middle, half = (edges[1:] + edges[:-1]) / 2, (edges[1:] - edges[:-1]) / 2
    theta = middle[:, np.newaxis] + half[:, np.newaxis] * x
    pressure = short_film_pressure(position, velocity, speed, theta[..., np.newaxis], x / 2)
    along = pressure @ weight / 2
    return complex(-4 * np.sum(along * np.exp(1j * theta) * weight * half[:, np.newaxis]))


def test_exact_force_equals_quadrature_of_the_pressure_at_1000_random_states() -> None:
    states = random_states(1000, largest=0.95)
    force = capone_forces(states.position, states.velocity, SPEED)
    expected = np.array([integrated(z, v, SPEED) for z, v in zip(*states, strict=True)])
    assert np.max(np.abs(force - expected) / np.abs(expected)) < 1e-9


def test_pressure_is_zero_outside_the_half_of_the_quadrature() -> None:
    for z, v in zip(*random_states(50), strict=True):
        start = math.atan2(-(SPEED * z.imag + 2 * v.real), -(SPEED * z.real - 2 * v.imag))
        outside = start - np.linspace(0.0, math.pi, 60)
        assert np.max(short_film_pressure(z, v, SPEED, outside, 0.0)) < 1e-9 * SPEED


def test_compiled_force_equals_the_exact_one() -> None:
    states = random_states(200)
    compiled = [capone_force(complex(z), complex(v), 1.0, SPEED, 1.0) for z, v in zip(*states, strict=True)]
    assert capone_forces(states.position, states.velocity, SPEED) == pytest.approx(np.array(compiled), rel=1e-12)


def full_sommerfeld(position: complex, velocity: complex) -> complex:
    return film_force(FORCE_LAWS[FilmModel.FULL_SOMMERFELD], complex(position), complex(velocity), 1.0, SPEED, 1.0)


def test_full_sommerfeld_force_equals_quadrature_over_the_full_circumference() -> None:
    theta = 2 * math.pi * np.arange(4096) / 4096  # the trapezoidal rule converges exponentially on a period
    turn = np.exp(-1j * theta)
    for z, v in zip(*random_states(300), strict=True):
        squeeze = SPEED * (z * turn).imag + 2 * (v * turn).real
        pressure = squeeze / (1 - (z * turn).real) ** 3 / 2  # (2.6) over the length
        expected = -4 * np.mean(pressure * turn.conj()) * 2 * math.pi
        assert full_sommerfeld(z, v) == pytest.approx(complex(expected), rel=1e-9)


def test_full_sommerfeld_force_is_the_sum_of_both_halves_of_the_film() -> None:
    # the pressure changes its sign with velocity and speed: the suction of one half is the pressure of the other
    z, v = random_states(300)
    halves = capone_forces(z, v, SPEED) - capone_forces(z, -v, -SPEED)
    found = [full_sommerfeld(*state) for state in zip(z, v, strict=True)]
    assert np.array(found) == pytest.approx(halves, rel=1e-9)


def test_full_sommerfeld_force_at_rest_is_perpendicular_to_the_displacement() -> None:
    for eccentricity in (0.1, 0.5, 0.9):
        expected = 2j * math.pi * SPEED * eccentricity / (1 - eccentricity**2) ** 1.5
        assert full_sommerfeld(eccentricity + 0j, 0j) == pytest.approx(expected, rel=1e-12)


def test_printed_form_is_refused_without_cavity() -> None:
    film = Film(radius=5e-3, length=10e-3, clearance=20e-6, viscosity=0.015, model=FilmModel.FULL_SOMMERFELD)
    with pytest.raises(ValueError, match=r"form: as printed, with film model full-sommerfeld, expected .* capone"):
        film.force(1e-6 + 0j, 0j, SPEED, CaponeForm.AS_PRINTED)


def test_printed_force_equals_the_exact_one_at_rest_and_only_there() -> None:
    states = random_states(1000)
    at_rest = capone_forces(states.position, 0j, SPEED, CaponeForm.AS_PRINTED)
    assert at_rest == pytest.approx(capone_forces(states.position, 0j, SPEED), rel=1e-9)
    exact = capone_forces(states.position, states.velocity, SPEED)
    error = np.abs(capone_forces(states.position, states.velocity, SPEED, CaponeForm.AS_PRINTED) - exact) / np.abs(
        exact
    )
    assert 0.003 < np.median(error) < 0.02
    assert np.max(error) > 2


def test_printed_force_differs_in_second_order_of_the_velocity() -> None:
    z, v = 0.5 * np.exp(0.4j), (0.7 - 0.4j) * SPEED
    errors = [
        abs(complex(capone_forces(z, s * v, SPEED) - capone_forces(z, s * v, SPEED, CaponeForm.AS_PRINTED)))
        for s in (1e-2, 5e-3, 2.5e-3)
    ]
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.05)


def test_film_force_of_both_forms_is_in_newtons() -> None:
    z, v = 0.6 * np.exp(1j) * FILM.clearance, (3 + 2j) * 1e-3
    relative = z / FILM.clearance, v / FILM.clearance, SPEED
    assert FILM.force(z, v, SPEED) == pytest.approx(complex(FILM.factor * capone_forces(*relative)), rel=1e-12)
    printed = FILM.force(z, v, SPEED, CaponeForm.AS_PRINTED)
    assert printed == pytest.approx(complex(FILM.factor * capone_forces(*relative, CaponeForm.AS_PRINTED)), rel=1e-12)
    assert abs(printed - FILM.force(z, v, SPEED)) > 1e-4 * abs(printed)


@pytest.mark.parametrize("form", list(CaponeForm))
def test_force_is_zero_without_motion_and_finite_without_rotation(form: CaponeForm) -> None:
    assert complex(capone_forces(0.4, 0j, 0.0, form)) == 0
    assert complex(capone_forces(0j, 0j, SPEED, form)) == 0
    squeezed = complex(capone_forces(0.4, 100 + 0j, 0.0, form))
    assert squeezed.real < 0
    assert squeezed.imag == pytest.approx(0, abs=1e-9 * abs(squeezed))


def test_moving_half_film_in_polar_coordinates_is_capones_force() -> None:
    z, v = random_states(500, largest=0.95)
    turned = v * np.exp(-1j * np.angle(z))
    polar = half_film_force(np.abs(z), turned.real, turned.imag / np.abs(z), SPEED, LoadedHalf.MOVING)
    assert polar * np.exp(1j * np.angle(z)) == pytest.approx(capone_forces(z, v, SPEED), rel=1e-11)


def test_extent_of_the_moving_half_film_is_the_thesis_delta() -> None:
    # (2.9) integrates 1/(1 + eps cos) over its half: Delta / sqrt(1 - eps²)
    x, weight = np.polynomial.legendre.leggauss(60)
    eps, rate, sweep = 0.6, 130.0, 0.6 * 700.0
    start = math.atan2(rate, sweep / 2)
    theta = start + math.pi / 2 * (1 + x)
    integral = math.pi / 2 * np.sum(weight / (1 + eps * np.cos(theta)))
    A = math.hypot(rate, sweep / 2)
    delta = 2 * (math.pi / 2 + math.atan(eps * rate / (A * math.sqrt(1 - eps**2))))
    assert integral == pytest.approx(delta / math.sqrt(1 - eps**2), rel=1e-12)


def test_fixed_and_moving_half_films_agree_without_squeeze() -> None:
    eps = np.linspace(0, 0.95, 40)
    fixed, moving = (half_film_force(eps, 0.0, 120.0, SPEED, half) for half in LoadedHalf)
    assert fixed == pytest.approx(moving, rel=1e-10)


def test_fixed_half_film_equals_quadrature_over_its_half() -> None:
    x, weight = np.polynomial.legendre.leggauss(80)
    theta = math.pi / 2 * (1 + x)
    rng = np.random.default_rng(5)
    for _ in range(100):
        eps, rate, whirl = rng.uniform(0.01, 0.9), 300 * rng.normal(), 300 * rng.normal()
        pressure = (eps * (SPEED - 2 * whirl) / 2 * np.sin(theta) - rate * np.cos(theta)) / (
            1 + eps * np.cos(theta)
        ) ** 3
        expected = 4 * math.pi / 2 * np.sum(weight * pressure * (np.cos(theta) + 1j * np.sin(theta)))
        assert complex(half_film_force(eps, rate, whirl, SPEED, LoadedHalf.FIXED)) == pytest.approx(
            complex(expected), rel=1e-9
        )


def test_capone_forces_name_the_state_at_the_wall() -> None:
    with pytest.raises(ValueError, match=r"eccentricity: 1\.2 of the clearance"):
        capone_forces([0.1, 1.2j], 0j, SPEED)


@pytest.mark.parametrize("form", list(CaponeForm))
def test_forces_refuse_velocity_or_speed_that_is_not_finite(form: CaponeForm) -> None:
    with pytest.raises(ValueError, match=r"velocity: .*nan.* clearances/s, expected a finite value"):
        capone_forces(0.5, [0j, complex(math.nan, 0)], SPEED, form)
    with pytest.raises(ValueError, match="surface_speed: inf rad/s"):
        capone_forces(0.5, 0j, math.inf, form)
    with pytest.raises(ValueError, match=r"velocity, surface_speed: .*expected finite values"):
        FILM.force(0j, complex(0, math.inf), SPEED, form)


def test_every_film_model_has_a_kernel_and_a_note() -> None:
    assert set(FORCE_LAWS) == set(CAVITY_NOTES) == set(FilmModel)
