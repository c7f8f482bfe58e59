"""What the march in time carries from step to step, and what it keeps for a step's size."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

NO_LEVEL = -1


class NewmarkMatrices(NamedTuple):
    """Newmark's matrix for a time step and its fourths: ``T diag(1 / (1 - i Omega g)) T^T`` is its inverse.

    Parameters
    ----------
    steps : ndarray of float64, shape (n_levels,)
        Time steps, s, each a fourth of the one before.
    transforms : ndarray of float64, shape (n_levels, m, m)
        T.
    gyroscopic : ndarray of float64, shape (n_levels, m)
        g, s.
    points : ndarray of float64, shape (n_levels, n_points, m)
        The points' mode shapes times T.
    """

    steps: FloatArray
    transforms: FloatArray
    gyroscopic: FloatArray
    points: FloatArray


class MotionState(NamedTuple):
    """All that the motion carries from step to step; changed in place.

    Parameters
    ----------
    motion : ndarray of complex128, shape (3, m + n_rings)
        Displacements, velocities and accelerations of the modes, and of the rings, m, m/s, m/s².
    augmented : ndarray of float64, shape (n, 2 n)
        The inverse of Newton's matrix in the right half, kept as long as it serves; n = 2 (n_points + n_rings).
    level : ndarray of int64, shape (1,)
        Level that it belongs to; ``NO_LEVEL`` for none.
    angle, speed : ndarray of float64, shape (1,)
        Of the shaft, rad and rad/s.
    """

    motion: ComplexArray
    augmented: FloatArray
    level: NDArray[np.int64]
    angle: FloatArray
    speed: FloatArray

    def set_initial_state(self, initial_state: FloatArray) -> None:
        """Put the motion where ``initial_state`` says, (4 (m + n_rings),): see `model.dynamics.stability`."""
        self.motion[:] = 0.0
        self.disturb(initial_state)

    def disturb(self, disturbance: FloatArray) -> None:
        """Move the motion by a difference of where it stands."""
        position, rate = disturbance.view(np.complex128).reshape(2, -1)
        self.motion[0] += position
        self.motion[1] += self.speed[0] * rate
        self.level[0] = NO_LEVEL


class Workspace(NamedTuple):
    """Room for the unknowns of a step, made once a march. Bodies are points of the shaft, then rings.

    Parameters
    ----------
    bodies : ndarray of complex128, shape (2, n_bodies)
        Positions, m, and velocities, m/s, as Newton's method moves them.
    start : ndarray of complex128, shape (2, n_bodies)
        The same where the step starts.
    free : ndarray of complex128, shape (n_bodies,)
        Where they would come to without forces of bearings, m.
    receptance : ndarray of complex128, shape (n_bodies, n_bodies)
        Displacement of a body for a force on another, m/N.
    forces : ndarray of complex128, shape (n_bodies,)
        Of bearings on the bodies, N.
    derivatives : ndarray of complex128, shape (n_bodies, n_bodies, 2)
        Changes of the forces with displacements in X and in Y, N/m.
    residual, change : ndarray of float64, shape (2 n_bodies,)
        What the equations miss and Newton's answer, m: X and Y alternately.
    modal : ndarray of complex128, shape (3, m)
        Forces, diagonal coordinates, compliances.
    saved : ndarray of complex128, shape (3, m + n_rings)
        The motion at the start of the caller's step.
    interval : ndarray of float64, shape (2, 2)
        Angle, rad, and speed, rad/s, of the shaft where the caller's step starts and ends.
    """

    bodies: ComplexArray
    start: ComplexArray
    free: ComplexArray
    receptance: ComplexArray
    forces: ComplexArray
    derivatives: ComplexArray
    residual: FloatArray
    change: FloatArray
    modal: ComplexArray
    saved: ComplexArray
    interval: FloatArray
