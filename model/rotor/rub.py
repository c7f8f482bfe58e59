"""Rub and impact between the shaft and what stands around it (section 4.4)."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.rotor.rotor import require_positive

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Rub:
    """A wall that pushes back and rubs where the shaft touches it.

    The thesis gives neither its stiffness nor its friction. It takes the journal's displacement from the housing
    against both clearances together (`FloatingRing.clearance`): there the wall begins where both films are closed,
    which the films never allow, so that in the motion walls are of seals and wheels.

    Parameters
    ----------
    station : int
        Counted from 1 at the compressor's end.
    clearance : float
        Displacement from the bearings' centre line at which contact begins, m.
    stiffness : float
        Of the wall, radial, N/m.
    radius : float
        Of the shaft or wheel where it rubs, m.
    friction : float
        Rubbing force over the pressing one, 0 or more.
    damping : float
        By what part the wall presses more for each metre a second of the shaft inwards, s/m: Hunt and Crossley's.

    Raises
    ------
    ValueError
        Where stiffness, radius or clearance is not positive or friction or damping is negative.
    """

    station: int
    clearance: float
    stiffness: float
    radius: float
    friction: float = 0.0
    damping: float = 0.0

    def __post_init__(self) -> None:
        require_positive("clearance", self.clearance, "m")
        require_positive("stiffness", self.stiffness, "N/m")
        require_positive("radius", self.radius, "m")
        for name, value, unit in (("friction", self.friction, ""), ("damping", self.damping, " s/m")):
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{name}: {value:g}{unit}, expected a finite value, 0 or more")

    @property
    def sizes(self) -> FloatArray:
        """Clearance, stiffness, friction, damping and radius, (5,), as `forces.wall_force` takes them."""
        return np.array([self.clearance, self.stiffness, self.friction, self.damping, self.radius])
