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


def require_capone(model: FilmModel) -> None:
    """Raise ParameterError for the printed form of another film model than Capone's."""
    if model is not FilmModel.CAPONE:
        raise ParameterError(f"form: as printed, with film model {model}, expected film model {FilmModel.CAPONE}")


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
    ParameterError
        If a position is at or beyond the wall or a value is not finite.
    """
    z, v = np.asarray(position, dtype=np.complex128), np.asarray(velocity, dtype=np.complex128)
    _require_inside(np.abs(z))
    _require_finite("velocity", v, "clearances/s")
    _require_finite("surface_speed", surface_speed, "rad/s")
    along_x, along_y = capone_components(z.real, z.imag, v.real, v.imag, surface_speed, form)
    return np.asarray(along_x + 1j * along_y)


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
