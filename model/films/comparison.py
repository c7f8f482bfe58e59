"""Comparison of the short, finite and long film: load, attitude and coefficients over eccentricity."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from model.films.coefficients import LinearCoefficients, differentiated_coefficients
from model.films.film import Film
from model.films.grid import Grid
from model.films.long_film import LongFilm, ruptured_film
from model.films.perturbation import perturbed_coefficients
from model.rotor.rotor import require_positive

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FilmComparison:
    """Static results of three film models over eccentricity.

    Parameters
    ----------
    eccentricities : ndarray, shape (n,)
        Ratios.
    short_load, finite_load, long_load : ndarray, shape (n,)
        Of the infinitely short film, the film of finite length and the infinitely long film, N.
    short_attitude, finite_attitude, long_attitude : ndarray, shape (n,)
        Angle from the load to the displacement in the direction of rotation, rad.
    short_coefficients, finite_coefficients : tuple of LinearCoefficients, length n
        For a downward load.
    """

    eccentricities: FloatArray
    short_load: FloatArray
    finite_load: FloatArray
    long_load: FloatArray
    short_attitude: FloatArray
    finite_attitude: FloatArray
    long_attitude: FloatArray
    short_coefficients: tuple[LinearCoefficients, ...]
    finite_coefficients: tuple[LinearCoefficients, ...]


def compare_film_models(film: Film, surface_speed: float, eccentricities: ArrayLike, grid: Grid) -> FilmComparison:
    """Return load, attitude and coefficients of a film by the short, finite and long model.

    Parameters
    ----------
    film : Film
        Sizes, viscosity and model of the short film.
    surface_speed : float
        Sum of the angular speeds of both surfaces, rad/s.
    eccentricities : array_like, shape (n,)
        Ratios, above 0 and below 1.
    grid : Grid
        Grid of the film of finite length.

    Returns
    -------
    FilmComparison
        The infinitely long film starts with zero pressure at its thickest position, as the others do, at least nearly,
        without a groove.

    Raises
    ------
    ValueError
        If the speed is not positive, or an eccentricity is outside its range or too close to the wall for the grid.
    """
    require_positive("surface_speed", surface_speed, "rad/s")
    ratios = np.atleast_1d(np.asarray(eccentricities, dtype=np.float64))
    if ratios.ndim != 1:
        raise ValueError(f"eccentricities: shape {ratios.shape}, expected (n,)")
    longs = [film_from_thickest(float(ratio)) for ratio in ratios]
    shorts = [_upright_short(film, float(ratio), surface_speed) for ratio in ratios]
    finites = [_upright_finite(film, float(ratio), surface_speed, grid) for ratio in ratios]
    unit = 6 * film.viscosity * (film.radius / film.clearance) ** 2 * surface_speed * film.length * film.radius
    return FilmComparison(
        eccentricities=ratios,
        short_load=np.array([abs(found.force) for found in shorts]),
        finite_load=np.array([abs(found.force) for found in finites]),
        long_load=unit * np.array([found.load for found in longs]),
        short_attitude=np.array([_attitude(found) for found in shorts]),
        finite_attitude=np.array([_attitude(found) for found in finites]),
        long_attitude=np.array([found.attitude for found in longs]),
        short_coefficients=tuple(shorts),
        finite_coefficients=tuple(finites),
    )


def film_from_thickest(eccentricity: float) -> LongFilm:
    """Return the infinitely long film that starts with zero pressure at its thickest position: (3.20), (3.21).

    Parameters
    ----------
    eccentricity : float
        Ratio, above 0 and below 1.
    """
    extent = brentq(lambda extent: ruptured_film(eccentricity, extent).start, 0.1, 1.0, xtol=1e-14)
    return ruptured_film(eccentricity, float(extent))


def _upright_short(film: Film, ratio: float, surface_speed: float) -> LinearCoefficients:
    flat = differentiated_coefficients(film, complex(ratio * film.clearance), surface_speed)
    return differentiated_coefficients(film, _upright_position(flat), surface_speed)


def _upright_finite(film: Film, ratio: float, surface_speed: float, grid: Grid) -> LinearCoefficients:
    flat = perturbed_coefficients(film, complex(ratio * film.clearance), surface_speed, grid)
    return _rotate(flat, _upright_position(flat) / flat.position)


def _upright_position(found: LinearCoefficients) -> complex:
    # the position, rotated so that the film force points up
    return found.position * 1j * abs(found.force) / found.force


def _rotate(found: LinearCoefficients, rotation_factor: complex) -> LinearCoefficients:
    rotation = np.array([[rotation_factor.real, -rotation_factor.imag], [rotation_factor.imag, rotation_factor.real]])
    return LinearCoefficients(
        found.position * rotation_factor,
        found.force * rotation_factor,
        rotation @ found.stiffness @ rotation.T,
        rotation @ found.damping @ rotation.T,
    )


def _attitude(found: LinearCoefficients) -> float:
    # the load points down
    return math.atan2(found.position.real, -found.position.imag)
