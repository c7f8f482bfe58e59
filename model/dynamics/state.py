"""Data of the integration in time: state of the motion, Newmark matrices of a step size, work arrays."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

NO_LEVEL = -1


class NewmarkMatrices(NamedTuple):
    """Newmark's matrices for a time step and its divisions by four; inverse ``T diag(1 / (1 - i Omega g)) T^T``.

    Parameters
    ----------
    steps : ndarray of float64, shape (n_levels,)
        Time steps, s, each a fourth of the one before.
    transforms : ndarray of float64, shape (n_levels, m, m)
        T.
    gyroscopic : ndarray of float64, shape (n_levels, m)
        g, s.
    points : ndarray of float64, shape (n_levels, n_points, m)
        Mode shapes at the points, times T.
    """

    steps: FloatArray
    transforms: FloatArray
    gyroscopic: FloatArray
    points: FloatArray


class MotionState(NamedTuple):
    """State of the motion between time steps; changed in place.

    Parameters
    ----------
    motion : ndarray of complex128, shape (3, m + n_rings)
        Displacements, velocities and accelerations of modes, then rings, m, m/s, m/s².
    augmented : ndarray of float64, shape (n, 2 n)
        Inverse Newton matrix in the right half, reused while Newton converges; n = 2 (n_points + n_rings).
    level : ndarray of int64, shape (1,)
        Level of step size of this inverse; ``NO_LEVEL`` for none.
    angle, speed : ndarray of float64, shape (1,)
        Of the shaft, rad and rad/s.
    """

    motion: ComplexArray
    augmented: FloatArray
    level: NDArray[np.int64]
    angle: FloatArray
    speed: FloatArray

    def set_initial_state(self, initial_state: FloatArray) -> None:
        """Set the motion to an initial state, (4 (m + n_rings),): see `model.dynamics.stability`."""
        self.motion[:] = 0.0
        self.disturb(initial_state)

    def disturb(self, disturbance: FloatArray) -> None:
        """Add a disturbance of the same form as an initial state."""
        position, rate = disturbance.view(np.complex128).reshape(2, -1)
        self.motion[0] += position
        self.motion[1] += self.speed[0] * rate
        self.level[0] = NO_LEVEL


class Workspace(NamedTuple):
    """Work arrays of a time step, allocated once per integration. Bodies are points of the shaft, then rings.

    Parameters
    ----------
    bodies : ndarray of complex128, shape (2, n_bodies)
        Positions, m, and velocities, m/s: the iterates of Newton's method.
    start : ndarray of complex128, shape (2, n_bodies)
        Positions and velocities at the start of the step.
    free : ndarray of complex128, shape (n_bodies,)
        Positions at the end of the step without bearing forces, m.
    receptance : ndarray of complex128, shape (n_bodies, n_bodies)
        Displacement of a body per force on another, m/N.
    forces : ndarray of complex128, shape (n_bodies,)
        Bearing forces on the bodies, N.
    derivatives : ndarray of complex128, shape (n_bodies, n_bodies, 2)
        Derivatives of the forces with respect to X and Y, N/m.
    residual, change : ndarray of float64, shape (2 n_bodies,)
        Residual of the equations and Newton step, m: X and Y alternately.
    modal : ndarray of complex128, shape (3, m)
        Forces, diagonal coordinates, compliances.
    saved : ndarray of complex128, shape (3, m + n_rings)
        Motion at the start of the caller's step, for a restart with shorter steps.
    interval : ndarray of float64, shape (2, 2)
        Angle, rad, and speed, rad/s, of the shaft at start and end of the caller's step.
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
