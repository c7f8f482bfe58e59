"""Pressure of the short film, and its force in polar coordinates, (2.4) and (2.9): independent references."""

from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


class LoadedHalf(Enum):
    """The half of the film that carries pressure."""

    FIXED = "fixed"
    """The converging half, independent of the velocity: (2.4)."""
    MOVING = "moving"
    """The half with positive pressure, which moves with the velocity: (2.9)."""


def short_film_pressure(
    position: complex, velocity: complex, surface_speed: float, angle: ArrayLike, station: ArrayLike
) -> FloatArray:
    """Return the pressure of a short film.

    Parameters
    ----------
    position, velocity : complex
        Of the inner body, clearances and clearances per second.
    surface_speed : float
        w, rad/s.
    angle : array_like
        From +X in the direction of rotation, rad.
    station : array_like
        Axial position in film lengths from the middle, -1/2 to 1/2; broadcasts with `angle`.

    Returns
    -------
    ndarray
        Pressure over mu L² / C², rad/s; 0 in the cavity.
    """
    theta, z = np.asarray(angle, dtype=np.float64), np.asarray(station, dtype=np.float64)
    turn = np.exp(-1j * theta)
    h = 1 - (position * turn).real
    squeeze = surface_speed * (position * turn).imag + 2 * (velocity * turn).real  # closing rate of the film, Eq. (2.5)
    return np.asarray(np.maximum(-3 * squeeze / h**3 * (z**2 - 0.25), 0.0))  # Eq. (2.6)


def half_film_force(
    eccentricity: ArrayLike,
    eccentricity_rate: ArrayLike,
    whirl_speed: ArrayLike,
    surface_speed: float,
    half: LoadedHalf,
) -> ComplexArray:
    """Return the force of the infinitely short film of which one half carries pressure.

    Parameters
    ----------
    eccentricity : array_like
        Ratio, 0 to below 1.
    eccentricity_rate : array_like
        Rate of the eccentricity ratio, 1/s.
    whirl_speed : array_like
        Angular speed of the line of centres, rad/s.
    surface_speed : float
        w, rad/s.
    half : LoadedHalf
        The half that carries pressure.

    Returns
    -------
    ndarray
        Radial + i tangential force on the inner body, rad/s; multiply by `Film.factor` for N.
    """
    eps, rate, whirl = np.broadcast_arrays(
        np.asarray(eccentricity, dtype=np.float64),
        np.asarray(eccentricity_rate, dtype=np.float64),
        np.asarray(whirl_speed, dtype=np.float64),
    )
    sweep = np.asarray(
        eps * (surface_speed - 2 * whirl)
    )  # oil speed relative to the line of centres, times eccentricity
    return np.asarray(
        4 * (_fixed_half(eps, rate, sweep) if half is LoadedHalf.FIXED else _moving_half(eps, rate, sweep))
    )


def _fixed_half(eps: FloatArray, rate: FloatArray, sweep: FloatArray) -> ComplexArray:
    s = 1 - eps**2
    outwards = -(
        eps * sweep / s**2 + np.pi * (1 + 2 * eps**2) * rate / (2 * s**2.5)
    )  # Eq. (2.4a), force on the journal
    forwards = np.pi * sweep / (4 * s**1.5) + 2 * eps * rate / s**2  # Eq. (2.4b)
    return np.asarray(outwards + 1j * forwards)


def _moving_half(eps: FloatArray, rate: FloatArray, sweep: FloatArray) -> ComplexArray:
    s = 1 - eps**2
    start = np.arctan2(
        rate, sweep / 2
    )  # the film extends over half a turn from this angle, measured from the thickest position
    beta = eps / (1 + np.sqrt(s))
    turn = 2 * np.arctan2(beta * np.sin(start), 1 + beta * np.cos(start))
    back = 2 * np.arctan2(-beta * np.sin(start), 1 - beta * np.cos(start))
    first, last = start - turn, start + np.pi - back  # Sommerfeld variables; their difference is the Delta of (2.9)
    Jcc = (_cos_squared(last, eps) - _cos_squared(first, eps)) / s**2.5
    Jsc = (_sin_cos(last, eps) - _sin_cos(first, eps)) / s**2
    Jss = (_sin_squared(last) - _sin_squared(first)) / s**1.5
    outwards = -Jcc * rate + Jsc * sweep / 2
    forwards = -Jsc * rate + Jss * sweep / 2  # Eq. (2.9)
    return np.asarray(outwards + 1j * forwards)


def _cos_squared(phi: FloatArray, eps: FloatArray) -> FloatArray:
    # integral of (cos phi - eps)²
    return phi / 2 + np.sin(2 * phi) / 4 - 2 * eps * np.sin(phi) + eps**2 * phi


def _sin_cos(phi: FloatArray, eps: FloatArray) -> FloatArray:
    # integral of sin phi (cos phi - eps)
    return np.sin(phi) ** 2 / 2 + eps * np.cos(phi)


def _sin_squared(phi: FloatArray) -> FloatArray:
    return phi / 2 - np.sin(2 * phi) / 4
