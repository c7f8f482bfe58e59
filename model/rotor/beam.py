"""Element matrices of a round shaft segment: stiffness, mass, rotary inertia and gyroscopic.

Degrees of freedom are ``(z, phi)`` at both ends. Thesis, eqs. (4.6) to (4.9), extended to the Timoshenko beam by the
shear parameter ``shear``, bending stiffness over shear stiffness (Przemieniecki's Phi). With 0 the matrices are those
of the thesis, for the Euler-Bernoulli beam.
"""

import math

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LENGTH_POWERS = np.array([0, 1, 0, 1])  # slopes carry a factor of the length


def second_moment(radius: float, inner_radius: float = 0.0) -> float:
    """Return the second moment of area of a round section, m⁴, from its radii, m."""
    return math.pi * (radius**4 - inner_radius**4) / 4


def area(radius: float, inner_radius: float = 0.0) -> float:
    """Return the area of a round section, m², from its radii, m."""
    return math.pi * (radius**2 - inner_radius**2)


def shear_coefficient(poissons_ratio: float, radius: float, inner_radius: float = 0.0) -> float:
    """Return the shear coefficient kappa of a round section after Cowper (J. Appl. Mech. 33, 1966)."""
    nu, hollow = poissons_ratio, (inner_radius / radius) ** 2
    wall = (1 + hollow) ** 2
    return 6 * (1 + nu) * wall / ((7 + 6 * nu) * wall + (20 + 12 * nu) * hollow)


def stiffness_element(bending_stiffness: float, length: float, shear: float = 0.0) -> FloatArray:
    """Return the stiffness matrix of a segment.

    Parameters
    ----------
    bending_stiffness : float
        E I, N m².
    length : float
        m.
    shear : float
        12 E I / (kappa G A l²); 0 for the Euler-Bernoulli beam.

    Returns
    -------
    ndarray, shape (4, 4)
        N/m, N and N m.
    """
    shape = np.array(
        [
            [12, 6, -12, 6],
            [6, 4 + shear, -6, 2 - shear],
            [-12, -6, 12, -6],
            [6, 2 - shear, -6, 4 + shear],
        ]
    )
    return bending_stiffness / (length**3 * (1 + shear)) * _scaled_by_length(shape, length)  # Eq. (4.9)


def mass_element(linear_density: float, length: float, shear: float = 0.0) -> FloatArray:
    """Return the consistent mass matrix of a segment, for translation.

    Parameters
    ----------
    linear_density : float
        kg/m.
    length, shear : float
        As for `stiffness_element`.

    Returns
    -------
    ndarray, shape (4, 4)
        kg, kg m and kg m².
    """
    s, s2 = shear, shear**2
    a, b, c = 312 + 588 * s + 280 * s2, 44 + 77 * s + 35 * s2, 108 + 252 * s + 140 * s2
    d, e, f = 26 + 63 * s + 35 * s2, 8 + 14 * s + 7 * s2, 6 + 14 * s + 7 * s2
    shape = np.array([[a, b, c, -d], [b, e, d, -f], [c, d, a, -b], [-d, -f, -b, e]])
    return linear_density * length / (840 * (1 + s) ** 2) * _scaled_by_length(shape, length)  # Eq. (4.6)


def rotary_inertia_element(inertia_density: float, length: float, shear: float = 0.0) -> FloatArray:
    """Return the rotary inertia matrix of a segment; with twice the density, its gyroscopic matrix.

    Parameters
    ----------
    inertia_density : float
        Moment of inertia per unit length, kg m: about a diameter for eq. (4.7), about the axis for eq. (4.8).
    length, shear : float
        As for `stiffness_element`.

    Returns
    -------
    ndarray, shape (4, 4)
        kg, kg m and kg m².
    """
    s, s2 = shear, shear**2
    a, b, c = 3 - 15 * s, 4 + 5 * s + 10 * s2, 1 + 5 * s - 5 * s2
    shape = np.array([[36, a, -36, a], [a, b, -a, -c], [-36, -a, 36, -a], [a, -c, -a, b]])
    return inertia_density / (30 * length * (1 + s) ** 2) * _scaled_by_length(shape, length)  # Eq. (4.7), (4.8)


def _scaled_by_length(shape: FloatArray, length: float) -> FloatArray:
    factors = length**LENGTH_POWERS
    return np.asarray(shape * np.outer(factors, factors), dtype=np.float64)
