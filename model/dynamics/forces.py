"""Forces of linear supports and walls on the shaft, with their derivatives, compiled on the first call.

Complex numbers are vectors in the plane of measurement, ``X + i Y``.
"""

import numpy as np
from numpy.typing import NDArray

from model.compiling import Compiler

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

FRICTION_TRANSITION_SPEED = 1e-3  # m/s: regularises friction, so that it does not jump at the reversal of sliding

compiler = Compiler()


@compiler.compiled
def support_force(position: complex, velocity: complex, coefficients: ComplexArray) -> complex:
    """Return the force of a linear support on the shaft or ring, N.

    Parameters
    ----------
    position, velocity : complex
        Of the supported body relative to the supporting one, m and m/s.
    coefficients : ndarray of complex128, shape (4,)
        a, b, c, d of ``-(a z + b conj z + c z' + d conj z')``, N/m and N s/m.
    """
    restoring = coefficients[0] * position + coefficients[1] * position.conjugate()
    force: complex = -(restoring + coefficients[2] * velocity + coefficients[3] * velocity.conjugate())
    return force


@compiler.compiled
def support_force_derivatives(velocity_ratio: complex, coefficients: ComplexArray) -> tuple[complex, complex]:
    """Return the derivatives of `support_force` with respect to X and Y, N/m; ``velocity_ratio`` as for a film."""
    of_x = support_force(1 + 0j, velocity_ratio, coefficients)
    return of_x, support_force(1j, velocity_ratio * 1j, coefficients)


@compiler.compiled
def wall_force(
    position: complex,
    velocity: complex,
    speed: float,
    sizes: FloatArray,
) -> complex:
    """Return the contact force of a wall on the shaft, N.

    Thesis eqs. (4.41) and (4.42) with Hunt-Crossley damping, which is proportional to the depth, so that the force does
    not jump at first contact. A wall never pulls.

    Parameters
    ----------
    position, velocity : complex
        Of the shaft centre, m and m/s.
    speed : float
        Of the shaft, rad/s.
    sizes : ndarray of float64, shape (5,)
        Clearance, the displacement at which contact begins, m; radial stiffness, N/m; friction coefficient; damping,
        the relative increase of the contact force per m/s of approach, s/m; radius of the rubbing surface, m.

    Returns
    -------
    complex
        Contact and friction force, N; 0 without contact.
    """
    clearance, stiffness, friction, damping, radius = sizes[0], sizes[1], sizes[2], sizes[3], sizes[4]
    distance = abs(position)
    depth = distance - clearance
    if depth <= 0.0:
        return 0j
    outwards = position / distance
    along = outwards.conjugate() * velocity  # radial + i tangential
    press = stiffness * depth * (1 + damping * along.real)  # Eq. (4.41)
    if press <= 0.0:
        return 0j
    sliding = speed * radius + along.imag
    rub = (
        friction * press * sliding / np.sqrt(sliding * sliding + FRICTION_TRANSITION_SPEED * FRICTION_TRANSITION_SPEED)
    )  # Eq. (4.42)
    return -complex(press, rub) * outwards


@compiler.compiled
def wall_force_derivatives(
    position: complex,
    velocity: complex,
    velocity_ratio: complex,
    speed: float,
    sizes: FloatArray,
) -> tuple[complex, complex]:
    """Return the derivatives of `wall_force` with respect to X and Y, N/m, by finite differences.

    Parameters
    ----------
    position, velocity, speed, sizes : complex, float and ndarray
        As for ``wall_force``.
    velocity_ratio : complex
        As for ``film_force_derivatives``.
    """
    start, reach = wall_force(position, velocity, speed, sizes), 1e-7 * sizes[0]
    in_x = reach if position.real > 0 else -reach  # into the wall
    in_y = reach if position.imag > 0 else -reach
    of_x = wall_force(position + in_x, velocity + velocity_ratio * in_x, speed, sizes)
    of_y = wall_force(position + 1j * in_y, velocity + velocity_ratio * 1j * in_y, speed, sizes)
    return (of_x - start) / in_x, (of_y - start) / in_y
