"""Capone's force of a cavitated short film and its derivatives, compiled on the first call.

Complex numbers are vectors in the plane of measurement, ``X + i Y``.
"""

import numpy as np

from model.compiling import Compiler

MIN_WALL_MARGIN = 1e-4  # minimum of 1 - eccentricity²: closer to the wall the film equations lose precision

compiler = Compiler()


@compiler.compiled
def capone_force(
    position: complex, velocity: complex, clearance: float, surface_speed: float, factor: float
) -> complex:
    """Return the force of a cavitated short film on the inner body, N.

    Capone's closed form, thesis eq. (4.38): the film carries pressure where it is positive. One correction:
    F = q / (1 - q²). The printed q / (1 - x² - y²) is equal only without squeeze, and wrong by up to a factor of 15 at
    large velocities.

    Parameters
    ----------
    position : complex
        Of the inner body relative to the outer one, m; less than the clearance.
    velocity : complex
        Of the inner body relative to the outer one, m/s.
    clearance : float
        Radial, m.
    surface_speed : float
        Sum of the angular speeds of both surfaces, rad/s.
    factor : float
        mu R L³ / (4 C²), N s.

    Returns
    -------
    complex
        N; 0 if nothing moves.
    """
    x, y = position.real / clearance, position.imag / clearance
    A = surface_speed * x - 2 * velocity.imag / clearance
    B = surface_speed * y + 2 * velocity.real / clearance
    s = np.sqrt(A * A + B * B)
    if s == 0.0:
        return 0j
    cos_a, sin_a = -A / s, -B / s  # alpha = arctan(B/A) - pi/2 sign(B/A) - pi/2 sign(B), without its 0/0
    u = 1 - x * x - y * y
    root = np.sqrt(u)
    p = y * cos_a - x * sin_a
    q = x * cos_a + y * sin_a
    G = 2 / root * (0.5 * np.pi + np.arctan(p / root))
    V = (2 + p * G) / u
    F = q / (1 - q * q)  # printed q / (1 - x² - y²)
    scale = -factor * s / u
    return complex(
        scale * (3 * x * V - sin_a * G - 2 * cos_a * F),
        scale * (3 * y * V + cos_a * G - 2 * sin_a * F),
    )  # Eq. (4.38)


@compiler.compiled
def capone_force_derivatives(
    velocity_ratio: complex, position: complex, velocity: complex, clearance: float, surface_speed: float, factor: float
) -> tuple[complex, complex]:
    """Return the derivatives of a film force with respect to X and Y, N/m, by finite differences.

    Parameters
    ----------
    velocity_ratio : complex
        Change of velocity per change of position, 1/s: 2 / step in Newmark's method, i Omega in the rotating frame.
    position, velocity, clearance, surface_speed, factor : complex and float
        As for ``capone_force``.
    """
    start = capone_force(position, velocity, clearance, surface_speed, factor)
    in_x = -1e-7 * clearance if position.real > 0 else 1e-7 * clearance  # always away from the wall
    in_y = -1e-7 * clearance if position.imag > 0 else 1e-7 * clearance
    of_x = capone_force(position + in_x, velocity + velocity_ratio * in_x, clearance, surface_speed, factor)
    of_y = capone_force(position + 1j * in_y, velocity + velocity_ratio * 1j * in_y, clearance, surface_speed, factor)
    return (of_x - start) / in_x, (of_y - start) / in_y
