"""Finite-volume grid of an oil film: flow driven by pressure and by the motion of the surfaces.

The film is symmetric about its middle, so the grid covers half of its length and the full circumference. With h in
clearances, zeta from the middle (0) to the end (1), p in mu R²/C² and w the sum of both surface speeds, the Reynolds
equation is

    d/dtheta (h³ dp/dtheta) + (2R/L)² d/dzeta (h³ dp/dzeta) = 6 (w dh/dtheta + 2 dh/dt)
"""

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from model.errors import ParameterError

FloatArray = NDArray[np.float64]


class Flow(Enum):
    """Directions of the pressure-driven flow."""

    BOTH = "both"
    AXIAL = "axial"
    """Axial flow only: the infinitely short film, for comparison."""


@dataclass(frozen=True, slots=True)
class Grid:
    """Numbers of nodes of a film.

    Parameters
    ----------
    around : int
        Nodes in the circumference, an even number of 8 or more.
    along : int
        Intervals from the middle of the film to its end, an even number of 2 or more.
    first_angle : float
        Angle of the first node, from +X in the direction of rotation, rad.

    Raises
    ------
    ValueError
        If a number of intervals is odd or too small.
    """

    around: int = 180
    along: int = 12
    first_angle: float = 0.0

    def __post_init__(self) -> None:
        for name, value, minimum in (("around", self.around, 8), ("along", self.along, 2)):
            if value < minimum or value % 2:
                raise ParameterError(f"{name}: {value} intervals, expected an even number, {minimum} or more")
        if not math.isfinite(self.first_angle):
            raise ParameterError(f"first_angle: {self.first_angle} rad, expected a finite angle")

    @property
    def angles(self) -> FloatArray:
        """Angles of the nodes, rad, shape (around,)."""
        return np.asarray(self.first_angle + self.width * np.arange(self.around), dtype=np.float64)

    @property
    def faces(self) -> FloatArray:
        """Angles half-way to the next node, rad, shape (around,)."""
        return self.angles + self.width / 2

    @property
    def width(self) -> float:
        """Angular width of a volume, rad."""
        return 2 * math.pi / self.around

    @property
    def lengths(self) -> FloatArray:
        """Axial lengths of the volumes from the middle on, in half lengths, shape (along,); the first one is halved."""
        lengths = np.full(self.along, 1 / self.along)
        lengths[0] /= 2
        return lengths

    def flow_matrix(
        self, at_nodes: FloatArray, at_faces: FloatArray, slenderness: float, flow: Flow
    ) -> sparse.csr_array:
        """Return the matrix of the outflow of every volume per pressure in every volume.

        Parameters
        ----------
        at_nodes, at_faces : ndarray, shape (around,)
            h³ at the nodes and at the faces between them, or a derivative of it.
        slenderness : float
            (2 R / L)².
        flow : Flow
            Directions of flow.

        Returns
        -------
        csr_array, shape (along * around, along * around)
            Volumes row by row from the middle of the film; the pressure at the end is zero.
        """
        line = np.full(self.along, 2.0)  # links to both neighbours; at the middle to one
        line[0] = 1.0
        beside = np.full(self.along - 1, -1.0)
        chain = sparse.csr_array(np.diag(line) + np.diag(beside, 1) + np.diag(beside, -1))
        total = sparse.kron(chain * (self.along * slenderness), sparse.diags_array(at_nodes * self.width))
        if flow is Flow.BOTH:
            here = np.arange(self.around)
            ahead = sparse.csr_array((np.ones(self.around), (here, (here + 1) % self.around)))
            forward = ahead - sparse.eye_array(self.around)
            ring = forward.T @ sparse.diags_array(at_faces / self.width) @ forward
            total = total + sparse.kron(sparse.diags_array(self.lengths), ring)
        return sparse.csr_array(total)

    def surface_flow(self, wedge: FloatArray, squeeze: FloatArray) -> FloatArray:
        """Return the outflow of every volume due to the motion of the surfaces.

        Parameters
        ----------
        wedge : ndarray, shape (around,)
            w h at the faces.
        squeeze : ndarray, shape (around,)
            dh/dt at the nodes.

        Returns
        -------
        ndarray, shape (along * around,)
        """
        out = 6 * (wedge - np.roll(wedge, 1)) + 12 * squeeze * self.width
        return np.outer(self.lengths, out).ravel()

    def resultant(self, pressure: FloatArray) -> complex:
        """Return the integral of p e^(i theta) over the circumference, averaged over the length."""
        rows = np.vstack([pressure.reshape(self.along, self.around), np.zeros(self.around)])
        weights = np.tile([2.0, 4.0], self.along // 2 + 1)[: self.along + 1]
        weights[0] = weights[-1] = 1.0  # Simpson's rule: exact for the parabola of a short film
        around = rows @ np.exp(1j * self.angles) * self.width
        return complex(weights @ around / (3 * self.along))
