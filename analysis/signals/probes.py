"""What every tool for a whole record asks of the displacement towards the two probes.

The shaft's path in the bench's directions, from two probes at any two angles, and the ellipses it is made of.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


class ProbePair:
    """Two probes that look at the shaft from two directions.

    Parameters
    ----------
    angle_x, angle_y : float
        Where the probes sit, rad from +X, positive in the direction of rotation.

    Raises
    ------
    ValueError
        Where both lie on one line: the motion across it cannot be known.
    """

    def __init__(self, angle_x: float, angle_y: float) -> None:
        if abs(np.sin(angle_y - angle_x)) < 1e-3:
            raise ValueError(
                f"probe angles: {angle_x:.4f} and {angle_y:.4f} rad, expected two directions that are not parallel"
            )
        towards = np.array([[np.cos(angle_x), np.sin(angle_x)], [np.cos(angle_y), np.sin(angle_y)]])
        self._towards: FloatArray = towards
        self._bench: FloatArray = np.linalg.inv(towards)

    def to_bench(self, displacement: FloatArray) -> FloatArray:
        """Return motion in X and Y, shape (2, ...), of displacements towards the probes x and y, shape (2, ...)."""
        return np.asarray(np.tensordot(self._bench, displacement, axes=1), dtype=np.float64)

    def to_probes(self, motion: FloatArray) -> FloatArray:
        """Return displacements towards the probes, shape (2, ...), of motion in X and Y, shape (2, ...)."""
        return np.asarray(np.tensordot(self._towards, motion, axes=1), dtype=np.float64)

    @property
    def lead(self) -> float:
        """Sine of the angle from probe x to probe y: 1 where y lies a quarter turn further in the turning sense."""
        cross = self._towards[0, 0] * self._towards[1, 1] - self._towards[0, 1] * self._towards[1, 0]
        return float(round(cross, 6))

    def vectors_to_bench(self, vectors: ComplexArray) -> ComplexArray:
        """Return complex vectors in X and Y, shape (2, ...), of those at the probes x and y, shape (2, ...)."""
        return np.asarray(np.tensordot(self._bench, vectors, axes=1), dtype=np.complex128)

    def ellipse(self, vectors: ComplexArray) -> "Ellipse":
        """Return the ellipse of one component.

        Parameters
        ----------
        vectors : ndarray of complex128, shape (2,)
            Peak amplitude and phase at the probes x and y, displacement = Re[vector exp(i k theta)], m.
        """
        X, Y = self._bench @ vectors
        forward = 0.5 * (X + 1j * Y)
        backward = 0.5 * (np.conj(X) + 1j * np.conj(Y))
        return Ellipse(complex(forward), complex(backward))


@dataclass(frozen=True, slots=True)
class Ellipse:
    """One component of an orbit: X + iY = forward exp(i k theta) + backward exp(-i k theta).

    Parameters
    ----------
    forward, backward : complex
        The circles with and against the rotation, m peak (D. Bently and C. Hatch, Fundamentals of Rotating
        Machinery Diagnostics, 2002, ch. 8).
    """

    forward: complex
    backward: complex

    @property
    def major(self) -> float:
        """Half the major axis, m peak."""
        return abs(self.forward) + abs(self.backward)

    @property
    def minor(self) -> float:
        """Half the minor axis, m peak; negative where the component goes round against the shaft."""
        return abs(self.forward) - abs(self.backward)

    @property
    def tilt(self) -> float:
        """Angle of the major axis from +X, rad, from -pi/2 to pi/2; 0 where one circle vanishes."""
        product = self.forward * self.backward
        return 0.5 * float(np.angle(product)) if product else 0.0


def require_displacement(displacement: NDArray[np.float64], rate: float) -> None:
    """Raise ValueError where displacement is not of two probes, shape (2, n), finite, m, or its rate not above 0 Hz."""
    if displacement.ndim != 2 or displacement.shape[0] != 2:
        raise ValueError(f"displacement: shape {displacement.shape}, expected (2, n), m at the probes x and y")
    if not np.isfinite(displacement).all():
        raise ValueError("displacement: holds values that are not finite, expected metres")
    if not 0.0 < rate < math.inf:
        raise ValueError(f"rate: {rate} Hz, expected above 0")
