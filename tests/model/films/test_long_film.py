"""Closed forms of the infinitely long film against quadrature."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import fixed_quad

from model.films.long_film import (
    LongFilm,
    bearing_angle,
    complete_film,
    ruptured_film,
    sommerfeld_angle,
)

FloatArray = NDArray[np.float64]
Function = Callable[[FloatArray], FloatArray]


def random_cases(count: int) -> list[tuple[float, float]]:
    rng = np.random.default_rng(3)
    return list(zip(rng.uniform(0.01, 0.9, count), rng.uniform(0.3, 1.0, count), strict=True))


def quadrature(function: Function, low: float, high: float) -> float:
    pieces = np.linspace(low, high, 41)
    return float(sum(fixed_quad(function, a, b, n=16)[0] for a, b in pairwise(pieces)))


def slope(eccentricity: float, theta_end: float) -> Function:
    return lambda t: eccentricity * (np.cos(t) - math.cos(theta_end)) / (1 + eccentricity * np.cos(t)) ** 3  # (3.9)


def inverse_cube(eccentricity: float) -> Function:
    return lambda theta: (1 + eccentricity * np.cos(theta)) ** -3


def weighted(function: Function, weight: np.ufunc) -> Function:
    return lambda theta: np.asarray(function(theta) * weight(theta))


def pressure_of(film: LongFilm) -> Function:
    return lambda theta: film.rise(sommerfeld_angle(theta, film.eccentricity))


def test_bearing_angle_inverts_sommerfeld_angle_in_every_revolution() -> None:
    theta = np.linspace(-9.0, 9.0, 201)
    phi = sommerfeld_angle(theta, 0.6)
    assert (1 + 0.6 * np.cos(theta)) * (1 - 0.6 * np.cos(phi)) == pytest.approx(np.full(201, 1 - 0.36), rel=1e-13)
    assert bearing_angle(phi, 0.6) == pytest.approx(theta, abs=1e-13)


def test_pressure_equals_quadrature_of_its_gradient_in_200_random_films() -> None:
    for eccentricity, extent in random_cases(200):
        film = ruptured_film(eccentricity, extent)
        start, end = bearing_angle([film.start, film.end], eccentricity)
        place = start + 0.6 * (end - start)
        dP = slope(eccentricity, end)
        largest = float(np.max(film.rise(np.linspace(film.start, film.end, 100))))
        assert float(film.rise(film.end)) == pytest.approx(0.0, abs=1e-9 * largest)
        assert quadrature(dP, start, end) == pytest.approx(0.0, abs=1e-9 * largest)
        assert float(film.rise(sommerfeld_angle(place, eccentricity))) == pytest.approx(
            quadrature(dP, start, place), rel=1e-9, abs=1e-9 * largest
        )


def test_second_form_of_the_pressure_equals_the_first() -> None:
    for eccentricity, extent in random_cases(50):
        film = ruptured_film(eccentricity, extent)
        phi = np.linspace(film.start, film.end, 50)

        def second(phi: FloatArray, eps: float = eccentricity, end: float = film.end) -> FloatArray:
            bracket = phi - 2 * eps * np.sin(phi) + eps**2 * (phi / 2 + np.sin(2 * phi) / 4)
            pressure = phi - eps * np.sin(phi) - bracket / (1 - eps * math.cos(end))
            return np.asarray((1 - eps**2) ** -1.5 * pressure)  # Eq. (3.17), without a leading eps

        rise = film.rise(phi)
        assert second(phi) - second(phi[:1]) == pytest.approx(rise, abs=1e-9 * float(np.max(rise)))


def test_force_equals_quadrature_of_the_pressure_in_200_random_films() -> None:
    for eccentricity, extent in random_cases(200):
        film = ruptured_film(eccentricity, extent)
        start, end = bearing_angle([film.start, film.end], eccentricity)
        pressure = pressure_of(film)
        along = quadrature(weighted(pressure, np.cos), start, end)
        across = quadrature(weighted(pressure, np.sin), start, end)
        assert film.force == pytest.approx((along, across), rel=1e-9, abs=1e-9 * film.load)


def test_tangential_force_equals_the_generalised_form() -> None:
    for eccentricity, extent in random_cases(50):
        film = ruptured_film(eccentricity, extent)
        e, s = film.end, film.start
        bracket = math.sin(e) - math.sin(s) - (e - s) * math.cos(e)
        across = bracket / (math.sqrt(1 - eccentricity**2) * (1 - eccentricity * math.cos(e)))  # Eq. (3.21), any start
        assert film.force[1] == pytest.approx(across, rel=1e-9)


@pytest.mark.parametrize("eccentricity", [0.01, 0.3, 0.9])
def test_complete_film_is_the_limit_of_the_ruptured_film(eccentricity: float) -> None:
    complete, nearly = complete_film(eccentricity), ruptured_film(eccentricity, 1 - 1e-12)
    assert complete.end - complete.start == pytest.approx(2 * math.pi)
    assert nearly.start == pytest.approx(complete.start, abs=1e-4)
    assert nearly.load == pytest.approx(complete.load, rel=1e-6)
    assert complete.attitude == pytest.approx(math.pi / 2, abs=1e-12)
    pressures = complete.rise(np.linspace(complete.start, complete.end, 500))
    assert np.min(pressures) >= -1e-12 * np.max(pressures)


@pytest.mark.parametrize("eccentricity", [0.0, 1.0, 1.2, -0.1, math.nan])
def test_ruptured_film_refuses_an_eccentricity_at_the_wall(eccentricity: float) -> None:
    with pytest.raises(ValueError, match=r"eccentricity: .* of the clearance, expected above 0 and below 1"):
        ruptured_film(eccentricity, 0.5)


@pytest.mark.parametrize("extent", [0.0, -1.0, 1.01, math.nan])
def test_ruptured_film_refuses_an_extent_outside_its_range(extent: float) -> None:
    with pytest.raises(ValueError, match="extent"):
        ruptured_film(0.5, extent)
