"""Comparison of the film models."""

import math
from dataclasses import replace

import numpy as np
import pytest

from model.films.coefficients import (
    finite_film_equilibrium,
    short_film_attitude,
    short_film_coefficients,
    short_film_load,
)
from model.films.film import Film
from model.films.finite_film import Grid
from model.rotor.parameters import FilmModel
from model.studies.films import compare_film_models, film_from_thickest

FILM = Film(radius=5e-3, length=10e-3, clearance=20e-6, viscosity=0.015)
SPEED = 1000.0
RATIOS = (0.1, 0.3, 0.6, 0.8)


def test_comparison_has_the_closed_forms_of_the_short_film() -> None:
    study = compare_film_models(FILM, SPEED, RATIOS, Grid(96, 8))
    for ratio, load, attitude, found in zip(
        RATIOS, study.short_load, study.short_attitude, study.short_coefficients, strict=True
    ):
        expected = short_film_coefficients(FILM, float(load), SPEED)
        assert abs(expected.position) == pytest.approx(ratio * FILM.clearance, rel=1e-9)
        assert attitude == pytest.approx(short_film_attitude(ratio), rel=1e-9)
        assert found.stiffness == pytest.approx(expected.stiffness, rel=1e-7)
        assert found.damping == pytest.approx(expected.damping, rel=1e-7)


def test_comparison_uses_the_model_of_the_short_film() -> None:
    film = replace(FILM, model=FilmModel.FULL_SOMMERFELD)
    cavitated, full = (compare_film_models(one, SPEED, RATIOS, Grid(96, 8)) for one in (FILM, film))
    assert full.short_attitude == pytest.approx(np.full(len(RATIOS), math.pi / 2), rel=1e-9)
    loads = [short_film_load(ratio, film.model) * film.factor * SPEED for ratio in RATIOS]
    assert full.short_load == pytest.approx(loads, rel=1e-9)
    assert full.finite_load == pytest.approx(cavitated.finite_load, rel=1e-12)


def test_comparison_has_the_equilibrium_of_the_finite_film() -> None:
    grid = Grid(192, 8)
    study = compare_film_models(FILM, SPEED, RATIOS, grid)
    for ratio, load, attitude, found in zip(
        RATIOS, study.finite_load, study.finite_attitude, study.finite_coefficients, strict=True
    ):
        expected = finite_film_equilibrium(FILM, float(load), SPEED, grid)
        assert abs(expected.position) == pytest.approx(ratio * FILM.clearance, rel=2e-3)
        assert math.atan2(expected.position.real, -expected.position.imag) == pytest.approx(attitude, abs=3e-3)
        scale = float(np.max(np.abs(expected.stiffness)))
        assert found.stiffness == pytest.approx(expected.stiffness, abs=0.01 * scale)


def test_film_of_length_over_diameter_one_carries_less_than_both_ideal_films() -> None:
    study = compare_film_models(FILM, SPEED, RATIOS, Grid(96, 8))
    assert np.all(study.finite_load < study.short_load)
    assert np.all(study.finite_load < study.long_load)


def test_ideal_films_are_the_limits_of_the_finite_film() -> None:
    short = Film(radius=5e-3, length=0.5e-3, clearance=20e-6, viscosity=0.015)
    study = compare_film_models(short, SPEED, RATIOS, Grid(360, 4))
    assert study.finite_load == pytest.approx(study.short_load, rel=0.03)
    assert np.all(study.long_load > 50 * study.finite_load)


@pytest.mark.parametrize("ratio", RATIOS)
def test_long_film_from_the_thickest_position_has_the_printed_force(ratio: float) -> None:
    film = film_from_thickest(ratio)
    assert film.start == pytest.approx(0, abs=1e-12)
    bracket = math.sin(film.end) - film.end * math.cos(film.end)
    across = bracket / (math.sqrt(1 - ratio**2) * (1 - ratio * math.cos(film.end)))  # Eq. (3.21) as printed
    along = -ratio * (1 - math.cos(film.end)) ** 2 / (2 * (1 - ratio**2) * (1 - ratio * math.cos(film.end)))  # (3.20)
    assert film.force == pytest.approx((along, across), rel=1e-9)


def test_comparison_refuses_invalid_values() -> None:
    with pytest.raises(ValueError, match="surface_speed: 0 rad/s"):
        compare_film_models(FILM, 0.0, RATIOS, Grid())
    with pytest.raises(ValueError, match="eccentricity: 1 of the clearance"):
        compare_film_models(FILM, SPEED, [0.5, 1.0], Grid())
    with pytest.raises(ValueError, match=r"eccentricities: shape \(1, 2\), expected \(n,\)"):
        compare_film_models(FILM, SPEED, [[0.5, 0.6]], Grid())
    with pytest.raises(ValueError, match="around: 48 nodes, expected at least"):
        compare_film_models(FILM, SPEED, [0.97], Grid(48, 4))
