"""Equilibrium of a body in an infinitely long film under a load, and the pressure around it (thesis, chapter 3).

``Psi`` is the angle around the film in the direction of rotation, rad. It is 0 opposite to the load, at the oil inlet.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from model.errors import EquilibriumError, ParameterError
from model.films.long_film import LongFilm, bearing_angle, complete_film, ruptured_film, sommerfeld_angle
from model.rotor.rotor import require_positive

FloatArray = NDArray[np.float64]

MAX_EQUILIBRIUM_ECCENTRICITY = 0.999  # eccentricity ratio of an accepted equilibrium
MIN_ECCENTRICITY, MAX_ECCENTRICITY = 1e-6, 1 - 1e-9  # search range
SEARCH_EXTENTS = (
    0.99,
    0.95,
    0.9,
    0.8,
    0.7,
    0.6,
    0.5,
    0.4,
    0.3,
    0.2,
    0.1,
)  # with the last one the film starts far past the inlet under any load


@dataclass(frozen=True, slots=True)
class FilmEquilibrium:
    """Equilibrium of an infinitely long film under a load.

    Parameters
    ----------
    shape : LongFilm
        Eccentricity and ends of the film.
    attitude : float
        Angle from the load to the displacement in the direction of rotation, rad.
    scale : float
        K = 6 eta R² w / C², Pa.
    inlet_pressure : float
        At Psi = 0, Pa.
    load : float
        Load carried by the pressure, downwards, N.
    """

    shape: LongFilm
    attitude: float
    scale: float
    inlet_pressure: float
    load: float

    @property
    def eccentricity(self) -> float:
        """Ratio of the displacement to the clearance."""
        return self.shape.eccentricity

    @property
    def is_complete(self) -> bool:
        """Whether the film covers the full circumference, without a cavity."""
        return self.shape.is_complete

    @property
    def rupture(self) -> float | None:
        """Angle at which the film ruptures and the cavity starts, Psi from 0 to 2 pi, rad; None in a complete film."""
        return None if self.is_complete else self._angle(self.shape.end)

    @property
    def reformation(self) -> float | None:
        """Angle at which the film reforms, Psi above 0 and at most 2 pi, rad; None in a complete film."""
        if self.is_complete:
            return None
        angle = self._angle(self.shape.start)
        turn = 2 * math.pi
        return turn if min(angle, turn - angle) < 1e-9 else angle

    def pressure(self, psi: ArrayLike) -> FloatArray:
        """Return the pressure, Pa.

        Parameters
        ----------
        psi : array_like
            Angles around the bearing, rad; any value.

        Returns
        -------
        ndarray
            Pa, in the shape of `psi`; 0 in the cavity.
        """
        shape = self.shape
        start = float(bearing_angle(shape.start, shape.eccentricity))
        theta = start + np.mod(np.asarray(psi, dtype=np.float64) - self.attitude - start, 2 * math.pi)
        phi = sommerfeld_angle(theta, shape.eccentricity)
        if self.is_complete:
            return np.asarray(self.inlet_pressure + self.scale * (shape.rise(phi) - shape.inlet_rise))
        return np.where(phi < shape.end, np.maximum(self.scale * shape.rise(phi), 0.0), 0.0)

    def _angle(self, phi: float) -> float:
        return float((bearing_angle(phi, self.shape.eccentricity) + self.attitude) % (2 * math.pi))


def film_equilibrium(load: float, scale: float, area: float, inlet_pressure: float) -> FilmEquilibrium:
    """Return the equilibrium of an infinitely long film under a load.

    Parameters
    ----------
    load : float
        Downwards, N.
    scale : float
        K = 6 eta R² w / C², with w the sum of the surface speeds, Pa.
    area : float
        Length times radius, m².
    inlet_pressure : float
        At the top (Psi = 0), Pa, 0 or more.

    Returns
    -------
    FilmEquilibrium

    Raises
    ------
    ValueError
        If a quantity is invalid.
    EquilibriumError
        If the load presses the body against the wall, or is too small to resolve.
    """
    for name, value, unit in (("load", load, "N"), ("scale", scale, "Pa"), ("area", area, "m²")):
        require_positive(name, value, unit)
    if not (math.isfinite(inlet_pressure) and inlet_pressure >= 0):
        raise ParameterError(f"inlet_pressure: {inlet_pressure:g} Pa, expected a finite value, 0 or more")
    target, rise = load / (scale * area), inlet_pressure / scale
    shape = complete_film(_eccentricity_under(target, load, complete_film))
    if rise < shape.inlet_rise:
        shape = _ruptured_with(target, load, rise)
    if shape.eccentricity > MAX_EQUILIBRIUM_ECCENTRICITY:
        raise _wall_error(load, shape.eccentricity)
    return FilmEquilibrium(shape, shape.attitude, scale, inlet_pressure, load)


def just_complete_film(pressure: float) -> LongFilm:
    """Return the film at the limit of cavitation: complete, with zero pressure at one angle.

    Parameters
    ----------
    pressure : float
        Inlet pressure over load per length and radius.

    Returns
    -------
    LongFilm

    Raises
    ------
    EquilibriumError
        If it is too close to the centre or to the wall to be computed.
    """

    def excess(eccentricity: float) -> float:
        film = complete_film(eccentricity)
        return film.inlet_rise / film.load - pressure

    if not excess(MIN_ECCENTRICITY) < 0 < excess(MAX_EQUILIBRIUM_ECCENTRICITY):
        raise EquilibriumError(
            f"inlet_pressure: {pressure:g} of the load per length and radius, expected a value that gives a "
            f"complete film between {MIN_ECCENTRICITY:g} and {MAX_EQUILIBRIUM_ECCENTRICITY} of its clearance"
        )
    return complete_film(_root(excess, MIN_ECCENTRICITY, MAX_EQUILIBRIUM_ECCENTRICITY))


def _ruptured_with(target: float, load: float, rise: float) -> LongFilm:
    # Film under a load with the given pressure at the inlet. Load and rise grow with eccentricity and extent.

    def film(extent: float) -> LongFilm:
        return ruptured_film(_eccentricity_under(target, load, lambda eps: ruptured_film(eps, extent)), extent)

    shorter = next(extent for extent in SEARCH_EXTENTS if film(extent).inlet_rise < rise)
    return film(_root(lambda extent: film(extent).inlet_rise - rise, shorter, 1.0))


def _eccentricity_under(target: float, load: float, film: Callable[[float], LongFilm]) -> float:
    # Eccentricity ratio at which a film of this type carries the load, K L R.
    if film(MIN_ECCENTRICITY).load > target:
        raise EquilibriumError(
            f"load: {load:g} N displaces the body by less than {MIN_ECCENTRICITY:g} of its clearance, "
            "expected a load that the film's equations can resolve"
        )
    if film(MAX_ECCENTRICITY).load < target:
        raise _wall_error(load, MAX_ECCENTRICITY)
    return _root(lambda eps: film(eps).load - target, MIN_ECCENTRICITY, MAX_ECCENTRICITY)


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    return float(brentq(function, low, high, xtol=1e-15, rtol=1e-14))


def _wall_error(load: float, eccentricity: float) -> EquilibriumError:
    return EquilibriumError(
        f"load: {load:g} N presses the body to {eccentricity:.9g} of its clearance, "
        f"expected a load that leaves it within {MAX_EQUILIBRIUM_ECCENTRICITY} of it"
    )
