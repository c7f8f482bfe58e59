"""The infinitely long oil film of chapter 3: Sommerfeld's closed forms, and the equilibrium under a load.

The thickness is ``h = C (1 + eps cos theta)``, with ``theta`` from the thickest position in the direction of rotation.
The film starts at ``theta_s`` with zero pressure and ends at ``theta_e`` with zero pressure and zero pressure gradient;
from there to its next start it is cavitated. The parameters are the eccentricity ratio ``eps`` and the end; everything
else follows in closed form. Pressures are in units of ``K = 6 eta R² w / C²`` and forces in units of ``K L R``, with
``w`` the sum of both surface speeds. ``Psi`` is the angle around the film in the direction of rotation, rad, 0 opposite
to the load, at the oil inlet.

The printed (3.20) and (3.21) hold only for a film that starts at the thickest position (theta_s = 0), which is not what
the results of the chapter use. The forms here hold for any start.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from analysis.signals import FloatArray
from model.errors import EquilibriumError, ParameterError
from model.rotor.rotor import require_positive

MAX_EQUILIBRIUM_ECCENTRICITY = 0.999  # eccentricity ratio of an accepted equilibrium
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


def sommerfeld_angle(theta: ArrayLike, eccentricity: float) -> FloatArray:
    """Return the Sommerfeld variable of an angle, rad, in the same revolution as the angle.

    Parameters
    ----------
    theta : array_like
        From the thickest position in the direction of rotation, rad; any revolution.
    eccentricity : float
        Ratio, at least 0 and below 1.

    Returns
    -------
    ndarray
        phi with (1 + eps cos theta) (1 - eps cos phi) = 1 - eps², rad; shape of `theta`.
    """
    angle = np.asarray(theta, dtype=np.float64)
    beta = eccentricity / (1 + math.sqrt(1 - eccentricity**2))
    return np.asarray(angle - 2 * np.arctan2(beta * np.sin(angle), 1 + beta * np.cos(angle)))  # Eq. (3.13), inverted


def bearing_angle(phi: ArrayLike, eccentricity: float) -> FloatArray:
    """Return the angle from the thickest position, rad: the inverse of `sommerfeld_angle`."""
    angle = np.asarray(phi, dtype=np.float64)
    beta = eccentricity / (1 + math.sqrt(1 - eccentricity**2))
    return np.asarray(angle + 2 * np.arctan2(beta * np.sin(angle), 1 - beta * np.cos(angle)))  # Eq. (3.13)


@dataclass(frozen=True, slots=True)
class LongFilm:
    """Dimensionless pressure distribution of an infinitely long film at an eccentricity.

    Parameters
    ----------
    eccentricity : float
        Ratio to the clearance, above 0 and below 1.
    start : float
        Sommerfeld variable at the start of the film, rad, between `end` - 2 pi and pi. For a complete film it is
        `end` - 2 pi, where the pressure is lowest.
    end : float
        Sommerfeld variable at the end of the film, rad, above pi.
    is_complete : bool
        Whether the film covers the full circumference.
    """

    eccentricity: float
    start: float
    end: float
    is_complete: bool

    def rise(self, phi: ArrayLike) -> FloatArray:
        """Return the pressure relative to the start of the film, K.

        Parameters
        ----------
        phi : array_like
            Sommerfeld variable, rad, from `start` to `end`.

        Returns
        -------
        ndarray
            (P(phi) - P(start)) / K.
        """
        return _rise(np.asarray(phi, dtype=np.float64), self.start, self.end, self.eccentricity)

    @property
    def force(self) -> tuple[float, float]:
        """Force on the inner body, K L R: along its displacement, and perpendicular in the direction of rotation."""
        eps = self.eccentricity
        cos_e, cos_s = math.cos(self.end), math.cos(self.start)
        sin_e, sin_s = math.sin(self.end), math.sin(self.start)
        if self.is_complete:
            return 0.0, 2 * math.pi * eps / ((2 + eps**2) * math.sqrt(1 - eps**2))
        along = -eps * (cos_s - cos_e) ** 2 / (2 * (1 - eps**2) * (1 - eps * cos_e))  # Eq. (3.18)
        across = (
            (1 + 2 * eps * cos_e) * (self.end - self.start)
            - 2 * (eps + cos_e) * (sin_e - sin_s)
            + sin_e * cos_e
            - sin_s * cos_s
        )  # Eq. (3.19)
        return along, across * eps / (2 * (1 - eps**2) ** 1.5 * (1 - eps * cos_e))

    @property
    def load(self) -> float:
        """Magnitude of the force, K L R."""
        return math.hypot(*self.force)

    @property
    def attitude(self) -> float:
        """Angle from the load to the displacement in the direction of rotation, rad."""
        along, across = self.force
        return math.atan2(across, -along)  # Eqs. (3.22), (3.23) with no side force

    @property
    def inlet_rise(self) -> float:
        """Pressure at the top of the bearing, opposite to the load, relative to the start of the film, K.

        If negative, the top is in the cavity: such a film cannot be fed there.
        """
        inlet = float(sommerfeld_angle(-self.attitude, self.eccentricity))
        return float(_rise(np.float64(inlet), self.start, self.end, self.eccentricity))


def complete_film(eccentricity: float) -> LongFilm:
    """Return the film that covers the full circumference; its end is where its pressure is lowest."""
    end = 2 * math.pi - math.acos(-eccentricity / 2)
    return LongFilm(eccentricity, end - 2 * math.pi, end, is_complete=True)


def ruptured_film(eccentricity: float, extent: float) -> LongFilm:
    """Return the film that ends at a given position.

    Parameters
    ----------
    eccentricity : float
        Ratio, above 0 and below 1.
    extent : float
        End of the film, between the thinnest position (0) and the end of the complete film (1), in the Sommerfeld
        variable.

    Returns
    -------
    LongFilm
        With zero pressure at its start and at its end; at `extent` 1 both coincide.

    Raises
    ------
    ParameterError
        If a value is outside its range.
    """
    if not 0 < eccentricity < 1:
        raise ParameterError(
            f"eccentricity: {eccentricity:g} of the clearance, expected above 0 and below 1 (the wall)"
        )
    if not 0 < extent <= 1:
        raise ParameterError(f"extent: {extent:g}, expected above 0 and at most 1 (the complete film's end)")
    last = 2 * math.pi - math.acos(-eccentricity / 2)
    end = math.pi + extent * (last - math.pi)
    low, high = end - 2 * math.pi, 2 * math.pi - end  # from the lowest to the highest pressure, monotonic
    if not _start_condition(low, end, eccentricity) < 0:
        return LongFilm(eccentricity, low, end, is_complete=False)  # extent 1: start and end coincide
    start = brentq(_start_condition, low, high, args=(end, eccentricity), xtol=1e-14, rtol=1e-14)
    return LongFilm(eccentricity, float(start), end, is_complete=False)


def _start_condition(phi: float, end: float, eps: float) -> float:
    # The braces of (3.16) from the end of the film to phi: 0 at its start. Plain floats, for a fast root search.
    cos_e, sin, cos = math.cos(end), math.sin(phi), math.cos(phi)
    return (
        2 * (sin - math.sin(end)) * (1 + eps * cos_e)
        + (end - phi) * (eps + 2 * cos_e)
        + eps * (math.sin(end) * cos_e - sin * cos)
    )


def _rise(phi: FloatArray | np.float64, start: float, end: float, eps: float) -> FloatArray:
    braces = (
        2 * (np.sin(phi) - math.sin(start)) * (1 + eps * math.cos(end))
        + (start - phi) * (eps + 2 * math.cos(end))
        + eps * (math.sin(start) * math.cos(start) - np.sin(phi) * np.cos(phi))
    )
    return np.asarray(eps / (2 * (1 - eps**2) ** 1.5 * (1 - eps * math.cos(end))) * braces)  # Eq. (3.16)


MIN_ECCENTRICITY, MAX_ECCENTRICITY = 1e-6, 1 - 1e-9  # search range


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
    ParameterError
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
