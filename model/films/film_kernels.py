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

Kernel = Callable[[complex, complex, float, float, float], complex]

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


FORCE_LAWS: dict[FilmModel, ForceLaw] = {
    FilmModel.CAPONE: Capone(),
    FilmModel.FULL_SOMMERFELD: FullSommerfeld(),
}
KERNELS: dict[type[ForceLaw], Kernel] = {Capone: capone_force, FullSommerfeld: full_sommerfeld_force}


@selected_by_type(KERNELS)
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
    return KERNELS[type(law)](position, velocity, clearance, surface_speed, factor)


@compiler.compiled
def film_force_derivatives(
    velocity_ratio: complex,
    law: ForceLaw,
    position: complex,
    velocity: complex,
    clearance: float,
    surface_speed: float,
    factor: float,
) -> tuple[complex, complex]:
    """Return the derivatives of a film force with respect to X and Y, N/m, by finite differences.

    Parameters
    ----------
    velocity_ratio : complex
        Change of velocity per change of position, 1/s: 2 / step in Newmark's method, i Omega in the rotating frame.
    law, position, velocity, clearance, surface_speed, factor : ForceLaw, complex and float
        As for ``film_force``.
    """
    start = film_force(law, position, velocity, clearance, surface_speed, factor)
    in_x = -1e-7 * clearance if position.real > 0 else 1e-7 * clearance  # always away from the wall
    in_y = -1e-7 * clearance if position.imag > 0 else 1e-7 * clearance
    of_x = film_force(law, position + in_x, velocity + velocity_ratio * in_x, clearance, surface_speed, factor)
    of_y = film_force(
        law, position + 1j * in_y, velocity + velocity_ratio * 1j * in_y, clearance, surface_speed, factor
    )
    return (of_x - start) / in_x, (of_y - start) / in_y
