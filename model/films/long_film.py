"""The infinitely long oil film of chapter 3: Sommerfeld's closed forms for a film with rupture and reformation.

The thickness is ``h = C (1 + eps cos theta)``, with ``theta`` from the thickest position in the direction of rotation.
The film starts at ``theta_s`` with zero pressure and ends at ``theta_e`` with zero pressure and zero pressure gradient;
from there to its next start it is cavitated. The parameters are the eccentricity ratio ``eps`` and the end; everything
else follows in closed form. Pressures are in units of ``K = 6 eta R² w / C²`` and forces in units of ``K L R``, with
``w`` the sum of both surface speeds.

The printed (3.20) and (3.21) hold only for a film that starts at the thickest position (theta_s = 0), which is not what
the results of the chapter use. The forms here hold for any start.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from model.errors import ParameterError

FloatArray = NDArray[np.float64]


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


def sommerfeld_integrals(phi: ArrayLike, eccentricity: float) -> tuple[FloatArray, FloatArray]:
    """Return the integrals from 0 to phi of cos theta and of 1 over (1 + eps cos theta)³.

    Parameters
    ----------
    phi : array_like
        Sommerfeld variable, rad.
    eccentricity : float
        Ratio, at least 0 and below 1.

    Returns
    -------
    tuple of ndarray
        Int cos theta dtheta / (1 + eps cos theta)³ and Int dtheta / (1 + eps cos theta)³.
    """
    ph, eps = np.asarray(phi, dtype=np.float64), eccentricity
    power = (1 - eps**2) ** 2.5
    cosine = (2 * (1 + eps**2) * np.sin(ph) - 3 * eps * ph - eps * np.sin(ph) * np.cos(ph)) / (2 * power)  # Eq. (3.14)
    one = (ph - 2 * eps * np.sin(ph) + eps**2 * ph / 2 + eps**2 / 4 * np.sin(2 * ph)) / power  # Eq. (3.15)
    return cosine, one


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
    ValueError
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
