"""The infinitely short oil film: the force laws of section 2.1.4 of the thesis and the 2π film, for arrays of states.

In a short film the oil flows in axial direction only. Its closed form depends on which half of the film carries
pressure. In (2.4) it is the converging half, independent of the velocity. In Capone's film it is the half with positive
pressure, which moves with the velocity; (2.7) is its form in Cartesian, (2.9) in polar coordinates.
Without a cavity (full Sommerfeld or 2π film) the full circumference carries positive and negative pressure.

Positions are complex, ``X + i Y``, in clearances; velocities in clearances per second; speeds in rad/s. Forces are in
rad/s, to be multiplied by ``mu R L³ / (4 C²)`` (`Film.factor`, N s), so that a film without rotation needs no special
case. ``w`` is the sum of the angular speeds of both surfaces.
"""

from enum import Enum
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from analysis.signals import ComplexArray, FloatArray
from model.errors import ParameterError
from model.rotor.parameters import FilmModel

Numbers = TypeVar("Numbers", FloatArray, ComplexArray)


class CaponeForm(Enum):
    """The term F of Capone's force."""

    EXACT = "exact"
    """F = q / (1 - q²), from the integral of the pressure."""
    AS_PRINTED = "as printed"
    """F = q / (1 - x² - y²) as printed in the thesis: correct to first order in the velocity only."""


class LoadedHalf(Enum):
    """The half of the film that carries pressure."""

    FIXED = "fixed"
    """The converging half, independent of the velocity: (2.4)."""
    MOVING = "moving"
    """The half with positive pressure, which moves with the velocity: (2.9)."""


def capone_components(
    x: Numbers, y: Numbers, x_rate: Numbers, y_rate: Numbers, surface_speed: float, form: CaponeForm
) -> tuple[Numbers, Numbers]:
    """Return Capone's force from real coordinates; complex values allow complex-step differentiation.

    Parameters
    ----------
    x, y : ndarray
        Position of the inner body, clearances.
    x_rate, y_rate : ndarray
        Velocity of the inner body, clearances per second.
    surface_speed : float
        w, rad/s.
    form : CaponeForm
        Form of the term F.

    Returns
    -------
    tuple of ndarray
        Force on the inner body in X and Y, rad/s.
    """
    A = surface_speed * x - 2 * y_rate
    B = surface_speed * y + 2 * x_rate
    s = np.sqrt(A * A + B * B)
    moves = s != 0
    size = np.where(moves, s, 1.0)
    cos_a, sin_a = -A / size, -B / size  # alpha of (2.7), without its 0/0
    u = 1 - x * x - y * y
    root = np.sqrt(u)
    p = y * cos_a - x * sin_a
    q = x * cos_a + y * sin_a
    G = 2 / root * (np.pi / 2 + np.arctan(p / root))
    V = (2 + p * G) / u
    F = q / (1 - q * q) if form is CaponeForm.EXACT else q / u
    along_x = -s / u * (3 * x * V - sin_a * G - 2 * cos_a * F)
    along_y = -s / u * (3 * y * V + cos_a * G - 2 * sin_a * F)  # Eq. (2.7); second sign before cos a G corrected
    return np.where(moves, along_x, 0.0), np.where(moves, along_y, 0.0)


def full_sommerfeld_components(
    x: Numbers, y: Numbers, x_rate: Numbers, y_rate: Numbers, surface_speed: float
) -> tuple[Numbers, Numbers]:
    """Return the force of the short film without cavity; parameters and result as for `capone_components`."""
    u = 1 - x * x - y * y
    scale = 4 * np.pi / (u * np.sqrt(u))
    squeeze = 3 * (x * x_rate + y * y_rate) / u
    along_x = scale * (-surface_speed * y / 2 - x_rate - squeeze * x)
    along_y = scale * (surface_speed * x / 2 - y_rate - squeeze * y)  # integral of (2.6) over the full circumference
    return along_x, along_y


def force_components(
    model: FilmModel,
    state: tuple[Numbers, Numbers, Numbers, Numbers],
    surface_speed: float,
    form: CaponeForm = CaponeForm.EXACT,
) -> tuple[Numbers, Numbers]:
    """Return the force of a film model in X and Y, rad/s.

    Parameters
    ----------
    model : FilmModel
        Force law.
    state : tuple of ndarray
        x, y, x_rate and y_rate as for `capone_components`.
    surface_speed : float
        w, rad/s.
    form : CaponeForm, optional
        Form of Capone's force.
    """
    if model is FilmModel.FULL_SOMMERFELD:
        if form is CaponeForm.AS_PRINTED:
            require_capone(model)
        return full_sommerfeld_components(*state, surface_speed)
    return capone_components(*state, surface_speed, form)


def require_capone(model: FilmModel) -> None:
    """Raise ValueError for the printed form of another film model than Capone's."""
    if model is not FilmModel.CAPONE:
        raise ValueError(f"form: as printed, with film model {model}, expected film model {FilmModel.CAPONE}")


def capone_forces(
    position: ArrayLike, velocity: ArrayLike, surface_speed: float, form: CaponeForm = CaponeForm.EXACT
) -> ComplexArray:
    """Return Capone's force of a short film on the inner body: the film carries where its pressure is positive.

    Parameters
    ----------
    position, velocity : array_like
        Of the inner body relative to the outer one, X + i Y, clearances and clearances per second; broadcastable.
    surface_speed : float
        w, rad/s.
    form : CaponeForm, optional
        The exact force, or the form printed in the thesis.

    Returns
    -------
    ndarray
        X + i Y, rad/s; multiply by `Film.factor` for N.

    Raises
    ------
    ValueError
        If a position is at or beyond the wall or a value is not finite.
    """
    z, v = np.asarray(position, dtype=np.complex128), np.asarray(velocity, dtype=np.complex128)
    _require_inside(np.abs(z))
    _require_finite("velocity", v, "clearances/s")
    _require_finite("surface_speed", surface_speed, "rad/s")
    along_x, along_y = capone_components(z.real, z.imag, v.real, v.imag, surface_speed, form)
    return np.asarray(along_x + 1j * along_y)


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

    Raises
    ------
    ValueError
        If the position is at or beyond the wall.
    """
    _require_inside(np.abs(np.asarray(position)))
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

    Raises
    ------
    ValueError
        If an eccentricity is outside its range or a value is not finite.
    """
    eps, rate, whirl = np.broadcast_arrays(
        np.asarray(eccentricity, dtype=np.float64),
        np.asarray(eccentricity_rate, dtype=np.float64),
        np.asarray(whirl_speed, dtype=np.float64),
    )
    _require_inside(eps)
    _require_finite("eccentricity_rate", rate, "1/s")
    _require_finite("whirl_speed", whirl, "rad/s")
    _require_finite("surface_speed", surface_speed, "rad/s")
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


def _require_inside(eccentricity: FloatArray) -> None:
    inside = (eccentricity >= 0) & (eccentricity < 1)
    if not np.all(inside):
        worst = float(eccentricity[~inside].flat[0])
        raise ParameterError(f"eccentricity: {worst:g} of the clearance, expected 0 or more and below 1 (the wall)")


def _require_finite(name: str, values: ArrayLike, unit: str) -> None:
    array = np.asarray(values)
    finite = np.isfinite(array)
    if not np.all(finite):
        raise ParameterError(f"{name}: {array[~finite].flat[0]} {unit}, expected a finite value")
