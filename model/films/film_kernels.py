"""Force laws of short films with one signature, and their derivatives; compiled on the first call.

The type of a law selects its kernel when the caller is compiled: the solver exists once per law, without branches.

Complex numbers are vectors in the plane of measurement, ``X + i Y``.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from model.compiling import Compiler, selected_by_type
from model.rotor.parameters import FilmModel

MIN_WALL_MARGIN = 1e-4  # minimum of 1 - eccentricity²: closer to the wall the film equations lose precision

Force = Callable[[complex, complex, float, float, float], complex]
Slopes = Callable[[complex, complex, float, float, float, complex], tuple[complex, complex]]

compiler = Compiler()


class Capone(NamedTuple):
    """Capone's force of a cavitated short film."""


class FullSommerfeld(NamedTuple):
    """Force of a short film without cavity."""


ForceLaw = Capone | FullSommerfeld


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
def capone_slopes(
    position: complex, velocity: complex, clearance: float, surface_speed: float, factor: float, velocity_ratio: complex
) -> tuple[complex, complex]:
    """Return the derivatives of `capone_force` with respect to X and Y, N/m; ``velocity_ratio`` as for `film_slopes`.

    The force is differentiated along the position, and along A and B, which contain the velocity. Where nothing moves
    it has no derivative but in the centre; the one of the centre is returned.
    """
    x, y = position.real / clearance, position.imag / clearance
    A = surface_speed * x - 2 * velocity.imag / clearance
    B = surface_speed * y + 2 * velocity.real / clearance
    s = np.sqrt(A * A + B * B)
    A_x, A_y = surface_speed - 2 * velocity_ratio.imag, -2 * velocity_ratio.real
    B_x, B_y = -A_y, A_x
    if s == 0.0:
        unit = np.pi * factor / clearance
        return unit * complex(-B_x, A_x), unit * complex(-B_y, A_y)
    cos_a, sin_a = -A / s, -B / s
    u = 1 - x * x - y * y
    root = np.sqrt(u)
    p, q = y * cos_a - x * sin_a, x * cos_a + y * sin_a
    v = 1 - q * q  # also u + p²
    G = 2 / root * (0.5 * np.pi + np.arctan(p / root))
    V, F = (2 + p * G) / u, q / v
    X, Y = 3 * x * V - sin_a * G - 2 * cos_a * F, 3 * y * V + cos_a * G - 2 * sin_a * F
    scale = -factor * s / u
    slopes = (0j, 0j)
    for k in range(2):
        dx, dy, dA, dB = (1.0, 0.0, A_x, B_x) if k == 0 else (0.0, 1.0, A_y, B_y)
        turn = (sin_a * dA - cos_a * dB) / s  # of alpha
        dp, dq, du = cos_a * dy - sin_a * dx - q * turn, cos_a * dx + sin_a * dy + p * turn, -2 * (x * dx + y * dy)
        dG = 2 / v * dp - (G / 2 + p / v) / u * du
        dV, dF = (G * dp + p * dG - V * du) / u, (1 + q * q) / (v * v) * dq
        dX = 3 * (dx * V + x * dV) - sin_a * dG - 2 * cos_a * dF - (cos_a * G - 2 * sin_a * F) * turn
        dY = 3 * (dy * V + y * dV) + cos_a * dG - 2 * sin_a * dF - (sin_a * G + 2 * cos_a * F) * turn
        growth = -(cos_a * dA + sin_a * dB) / s - du / u  # of the scale
        slope = scale / clearance * complex(dX + growth * X, dY + growth * Y)
        slopes = (slope, 0j) if k == 0 else (slopes[0], slope)
    return slopes


@compiler.compiled
def full_sommerfeld_force(
    position: complex, velocity: complex, clearance: float, surface_speed: float, factor: float
) -> complex:
    """Return the force of a short film without cavity (2π film) on the inner body, N.

    The integral of the pressure (2.6) over the full circumference, where negative pressure pulls. At rest the force is
    perpendicular to the displacement. Parameters as for ``capone_force``.
    """
    z, rate = position / clearance, velocity / clearance
    u = 1 - (z.real * z.real + z.imag * z.imag)
    radial = z.real * rate.real + z.imag * rate.imag  # eccentricity times its rate
    return complex(4 * np.pi * factor / (u * np.sqrt(u)) * (0.5j * surface_speed * z - rate - 3 * radial / u * z))


@compiler.compiled
def full_sommerfeld_slopes(
    position: complex, velocity: complex, clearance: float, surface_speed: float, factor: float, velocity_ratio: complex
) -> tuple[complex, complex]:
    """Return the derivatives of `full_sommerfeld_force` with respect to X and Y, N/m; parameters as `film_slopes`."""
    z, rate = position / clearance, velocity / clearance
    u = 1 - (z.real * z.real + z.imag * z.imag)
    radial = z.real * rate.real + z.imag * rate.imag
    scale = 4 * np.pi * factor / (u * np.sqrt(u))
    force = 0.5j * surface_speed * z - rate - 3 * radial / u * z
    slopes = (0j, 0j)
    for k in range(2):
        dz = 1 + 0j if k == 0 else 1j
        dv = velocity_ratio * dz
        du = -2 * (z.real * dz.real + z.imag * dz.imag)
        of_radial = dz.real * rate.real + dz.imag * rate.imag + z.real * dv.real + z.imag * dv.imag
        of_squeeze = (of_radial - radial * du / u) / u * z + radial / u * dz
        slope = scale / clearance * (0.5j * surface_speed * dz - dv - 3 * of_squeeze - 1.5 * du / u * force)
        slopes = (slope, 0j) if k == 0 else (slopes[0], slope)
    return slopes


FORCE_LAWS: dict[FilmModel, ForceLaw] = {
    FilmModel.CAPONE: Capone(),
    FilmModel.FULL_SOMMERFELD: FullSommerfeld(),
}
FORCES: dict[type[ForceLaw], Force] = {Capone: capone_force, FullSommerfeld: full_sommerfeld_force}
SLOPES: dict[type[ForceLaw], Slopes] = {Capone: capone_slopes, FullSommerfeld: full_sommerfeld_slopes}


@selected_by_type(FORCES)
def film_force(
    law: ForceLaw, position: complex, velocity: complex, clearance: float, surface_speed: float, factor: float
) -> complex:
    """Return the force of a short film on the inner body by a force law, N.

    Parameters
    ----------
    law : ForceLaw
        One of `FORCE_LAWS`; its type selects the kernel.
    position, velocity, clearance, surface_speed, factor : complex and float
        As for ``capone_force``.
    """
    return FORCES[type(law)](position, velocity, clearance, surface_speed, factor)


@selected_by_type(SLOPES)
def film_slopes(
    law: ForceLaw,
    position: complex,
    velocity: complex,
    clearance: float,
    surface_speed: float,
    factor: float,
    velocity_ratio: complex,
) -> tuple[complex, complex]:
    """Return the derivatives of a film force with respect to X and Y, N/m.

    Parameters
    ----------
    law, position, velocity, clearance, surface_speed, factor : ForceLaw, complex and float
        As for ``film_force``.
    velocity_ratio : complex
        Change of velocity per change of position, 1/s: 2 / step in Newmark's method, i Omega in the rotating frame.
    """
    return SLOPES[type(law)](position, velocity, clearance, surface_speed, factor, velocity_ratio)
