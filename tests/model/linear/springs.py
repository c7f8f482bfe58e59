"""The rotor on equal springs at the journals, from the matrices of one plane: an independent reference."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from model.linear.modes import CriticalSpeeds
from model.rotor.rotor import Rotor

FloatArray = NDArray[np.float64]


def supported_stiffness(rotor: Rotor, bearing_stiffness: float) -> FloatArray:
    """Return the stiffness matrix with a spring of ``bearing_stiffness``, N/m, at each journal, (n_dofs, n_dofs)."""
    stiffness = rotor.stiffness_matrix()
    for journal in rotor.journals:
        stiffness[journal, journal] += bearing_stiffness
    return stiffness


def natural_frequencies(rotor: Rotor, bearing_stiffness: float, speed: float) -> FloatArray:
    """Return all natural frequencies of the rotating rotor on springs.

    Parameters
    ----------
    rotor : Rotor
        With n stations.
    bearing_stiffness : float
        Of each bearing, N/m.
    speed : float
        Of the shaft, rad/s.

    Returns
    -------
    ndarray of float64, shape (4 n,)
        Rising, rad/s: negative for reverse, positive for forward precession.
    """
    K = supported_stiffness(rotor, bearing_stiffness)
    M, J = rotor.mass_matrix(), rotor.gyroscopic_matrix()
    zero = np.zeros_like(K)
    # Eq. (5.18) with lambda = i omega, (K + omega Omega J - omega^2 M) Z = 0, made symmetric:
    left = np.block([[zero, K], [K, speed * J]])
    right = np.block([[K, zero], [zero, M]])
    return np.asarray(eigh(left, right, eigvals_only=True), dtype=np.float64)


def critical_speeds_on_springs(rotor: Rotor, bearing_stiffness: float, highest: float) -> CriticalSpeeds:
    """Return the critical speeds of the rotor on springs, without a search over speed.

    Parameters
    ----------
    rotor : Rotor
        The rotor.
    bearing_stiffness : float
        Of each bearing, N/m.
    highest : float
        Largest speed returned, rad/s.

    Returns
    -------
    CriticalSpeeds
        Speeds at which the frequency of a mode equals the speed (forward) or minus the speed (reverse).
    """
    K = supported_stiffness(rotor, bearing_stiffness)
    M, J = rotor.mass_matrix(), rotor.gyroscopic_matrix()

    def below_highest(inertia: FloatArray) -> tuple[float, ...]:
        inverse_squares = np.asarray(eigh(inertia, K, eigvals_only=True), dtype=np.float64)
        speeds = 1 / np.sqrt(inverse_squares[inverse_squares > 0])
        return tuple(float(speed) for speed in np.sort(speeds) if speed <= highest)

    # det(K - Omega^2 (M - J)) = 0 and det(K - Omega^2 (M + J)) = 0
    return CriticalSpeeds(forward=below_highest(M - J), reverse=below_highest(M + J))
