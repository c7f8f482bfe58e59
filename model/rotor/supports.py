"""Linear supports of a rotor (springs, dampers, rings with mass), static loads, and walls that it may touch."""

import math
from dataclasses import dataclass

import numpy as np

from analysis.signals import FloatArray
from model.errors import ParameterError
from model.rotor.rotor import require_positive

Matrix = tuple[tuple[float, float], tuple[float, float]]

ZERO_MATRIX: Matrix = ((0.0, 0.0), (0.0, 0.0))


@dataclass(frozen=True, slots=True)
class SupportCoefficients:
    """Linear stiffness and damping in X and Y.

    Parameters
    ----------
    stiffness : tuple of tuples of float, 2 by 2
        Force towards -X and -Y (rows) for displacements in X and Y (columns), N/m.
    damping : tuple of tuples of float, 2 by 2
        The same for velocities, N s/m.

    Raises
    ------
    ParameterError
        If a value is not finite or a matrix is not 2 by 2.
    """

    stiffness: Matrix
    damping: Matrix = ZERO_MATRIX

    def __post_init__(self) -> None:
        for name, matrix, unit in (("stiffness", self.stiffness, "N/m"), ("damping", self.damping, "N s/m")):
            if len(matrix) != 2 or any(len(row) != 2 for row in matrix):
                raise ValueError(f"{name}: {matrix} {unit}, expected two rows of two values")
            for value in (*matrix[0], *matrix[1]):
                if not math.isfinite(value):
                    raise ParameterError(f"{name}: {value:g} {unit}, expected finite values")

    @classmethod
    def isotropic(cls, stiffness: float, damping: float = 0.0) -> "SupportCoefficients":
        """Return coefficients that are equal in all directions, N/m (above 0) and N s/m."""
        require_positive("stiffness", stiffness, "N/m")
        return cls(((stiffness, 0.0), (0.0, stiffness)), ((damping, 0.0), (0.0, damping)))

    @property
    def is_undamped_isotropic(self) -> bool:
        """Whether this is an undamped isotropic spring of non-negative stiffness."""
        (xx, xy), (yx, yy) = self.stiffness
        return xx == yy >= 0 and xy == yx == 0 and self.damping == ZERO_MATRIX


@dataclass(frozen=True, slots=True)
class Support:
    """A linear support at a station.

    Parameters
    ----------
    station : int
        Counted from 1 at the compressor end.
    inner : SupportCoefficients
        Between shaft and housing, or between shaft and ring if there is one.
    outer : SupportCoefficients, optional
        Between ring and housing.
    ring_mass : float
        kg; above 0 if and only if ``outer`` is given.

    Raises
    ------
    ParameterError
        If a ring has no mass or a mass is given without ``outer``.
    """

    station: int
    inner: SupportCoefficients
    outer: SupportCoefficients | None = None
    ring_mass: float = 0.0

    def __post_init__(self) -> None:
        if self.outer is not None:
            require_positive("ring_mass", self.ring_mass, "kg")
        elif self.ring_mass != 0:
            raise ParameterError(f"ring_mass: {self.ring_mass:g} kg, expected none without outer coefficients")

    @property
    def is_undamped_isotropic(self) -> bool:
        """Whether all coefficients are undamped and isotropic."""
        return self.inner.is_undamped_isotropic and (self.outer is None or self.outer.is_undamped_isotropic)


@dataclass(frozen=True, slots=True)
class StaticLoad:
    """A constant force at a station.

    Parameters
    ----------
    station : int
        Counted from 1 at the compressor end.
    x, y : float
        Force towards +X and +Y, N.
    """

    station: int
    x: float
    y: float

    def __post_init__(self) -> None:
        for value in (self.x, self.y):
            if not math.isfinite(value):
                raise ParameterError(f"load: {value:g} N at station {self.station}, expected a finite value")


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
