"""Pairs of probes at any two angles: conversion to the bench axes X and Y, and ellipses of single orders."""

import math
from dataclasses import dataclass

import numpy as np

from analysis.signals import ComplexArray, FloatArray


class ProbePair:
    """Two probes that measure the shaft from two directions.

    Parameters
    ----------
    angle_x, angle_y : float
        Mounting angles of the probes, rad from +X, positive in the direction of rotation.

    Raises
    ------
    ValueError
        Both probes lie on one line: they do not measure the motion across it.
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
        """Return the motion in X and Y, shape (2, ...), from displacements towards the probes, shape (2, ...)."""
        return np.asarray(np.tensordot(self._bench, displacement, axes=1), dtype=np.float64)

    def to_probes(self, motion: FloatArray) -> FloatArray:
        """Return displacements towards the probes, shape (2, ...), from the motion in X and Y, shape (2, ...)."""
        return np.asarray(np.tensordot(self._towards, motion, axes=1), dtype=np.float64)

    @property
    def lead(self) -> float:
        """Sine of the angle from probe x to probe y: 1 where y leads by 90° in the direction of rotation."""
        cross = self._towards[0, 0] * self._towards[1, 1] - self._towards[0, 1] * self._towards[1, 0]
        return float(round(cross, 6))

    def vectors_to_bench(self, vectors: ComplexArray) -> ComplexArray:
        """Return complex vectors in X and Y, shape (2, ...), from those at the probes x and y, shape (2, ...)."""
        return np.asarray(np.tensordot(self._bench, vectors, axes=1), dtype=np.complex128)

    def ellipse(self, vectors: ComplexArray) -> "Ellipse":
        """Return the ellipse of one order component.

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
        Circles with and against the rotation, m peak (D. Bently and C. Hatch, Fundamentals of Rotating Machinery
        Diagnostics, 2002, ch. 8).
    """

    forward: complex
    backward: complex

    @property
    def major(self) -> float:
        """Half the major axis, m peak."""
        return abs(self.forward) + abs(self.backward)

    @property
    def minor(self) -> float:
        """Half the minor axis, m peak; negative for backward precession."""
        return abs(self.forward) - abs(self.backward)

    @property
    def tilt(self) -> float:
        """Angle of the major axis from +X, rad, from -pi/2 to pi/2; 0 for a circle."""
        product = self.forward * self.backward
        return 0.5 * float(np.angle(product)) if product else 0.0


def require_displacement(displacement: FloatArray, rate: float) -> None:
    """Raise ValueError unless displacement is finite, m, of shape (2, n), and its rate is above 0 Hz."""
    if displacement.ndim != 2 or displacement.shape[0] != 2:
        raise ValueError(f"displacement: shape {displacement.shape}, expected (2, n), m at the probes x and y")
    if not np.isfinite(displacement).all():
        raise ValueError("displacement: holds values that are not finite, expected metres")
    if not 0.0 < rate < math.inf:
        raise ValueError(f"rate: {rate} Hz, expected above 0")
