"""Rub and impact between a journal and its bearing (section 4.4)."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from model.rotor import require_positive

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class Rub:
    """A wall that pushes back and rubs where it is touched.

    The thesis gives neither its stiffness nor its friction. It takes the journal's displacement from the housing
    against both clearances together (`FloatingRing.clearance`): the wall begins where both films are closed. There
    is no damping, and the force has a kink where contact begins.

    Parameters
    ----------
    stiffness : float
        Of the wall, radial, N/m.
    friction : float
        Rubbing force over the pressing one, 0 or more.
    clearance : float
        Displacement at which contact begins, m.

    Raises
    ------
    ValueError
        Where stiffness or clearance is not positive or friction is negative.
    """

    stiffness: float
    friction: float
    clearance: float

    def __post_init__(self) -> None:
        require_positive("stiffness", self.stiffness, "N/m")
        require_positive("clearance", self.clearance, "m")
        if not (math.isfinite(self.friction) and self.friction >= 0):
            raise ValueError(f"friction: {self.friction:g}, expected a finite value, 0 or more")

    def force(self, position: ArrayLike, surface_speed: ArrayLike) -> ComplexArray:
        """Return the force on the journal.

        Parameters
        ----------
        position : array_like
            Of the journal from the housing's centre, X + i Y, m.
        surface_speed : array_like
            With which the journal's surface slides along the wall in the direction of rotation (counter-clockwise), in
            any unit: only its sign counts, and where it is 0 nothing rubs.

        Returns
        -------
        ndarray
            X + i Y, N; 0 without contact.
        """
        z = np.asarray(position, dtype=np.complex128)
        distance = np.abs(z)
        depth = np.maximum(distance - self.clearance, 0.0)
        outwards = np.divide(z, distance, out=np.zeros_like(z), where=distance > 0)
        impact = self.stiffness * depth  # Eq. (4.41)
        rub = self.friction * impact * np.sign(surface_speed)  # Eq. (4.42)
        return np.asarray(-impact * outwards - 1j * rub * outwards)
