"""Rub and impact between the shaft and a surrounding wall (thesis, section 4.4)."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.errors import ParameterError
from model.rotor.rotor import require_positive

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Rub:
    """A wall that presses and rubs on the shaft when the shaft touches it.

    The thesis gives neither stiffness nor friction. It compares the displacement of the journal from the housing with
    the sum of both clearances (`FloatingRing.clearance`). The films prevent that contact, so here walls represent seals
    and wheel casings.

    Parameters
    ----------
    station : int
        Counted from 1 at the compressor end.
    clearance : float
        Displacement from the bearing centre line at which contact begins, m.
    stiffness : float
        Radial stiffness of the wall, N/m.
    radius : float
        Radius of the rubbing surface of shaft or wheel, m.
    friction : float
        Friction coefficient, 0 or more.
    damping : float
        Hunt-Crossley damping: relative increase of the contact force per m/s of approach, s/m.

    Raises
    ------
    ParameterError
        If stiffness, radius or clearance is not positive or friction or damping is negative.
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
                raise ParameterError(f"{name}: {value:g}{unit}, expected a finite value, 0 or more")

    @property
    def sizes(self) -> FloatArray:
        """Clearance, stiffness, friction, damping and radius, (5,): the array that `forces.wall_force` takes."""
        return np.array([self.clearance, self.stiffness, self.friction, self.damping, self.radius])
