"""The rotor: lumped discs on Euler-Bernoulli beam segments, in complex coordinates.

With ``z = x + i y`` and the slope ``phi = theta_y - i theta_x`` at each station the two planes become one (thesis, eq.
(5.12)): ``M z'' - i Omega J z' + K z = F`` with real symmetric matrices, degrees of freedom
``(z_1, phi_1, z_2, phi_2, ...)``. X points right, Y up, the shaft turns from X to Y.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Rotor:
    """A rotor of ``n`` stations joined by ``n - 1`` round shaft segments.

    Parameters
    ----------
    masses : tuple of float, length n
        Lumped masses, kg. The shaft's own mass is in them.
    diametral_inertias : tuple of float, length n
        Moments of inertia about a diameter, kg m².
    polar_inertias : tuple of float, length n
        Moments of inertia about the axis, kg m².
    radii : tuple of float, length n - 1
        Radii of the segments, m.
    lengths : tuple of float, length n - 1
        Lengths of the segments, m.
    youngs_modulus : float
        Of the shaft, Pa.
    bearing_stations : tuple of int, length 2
        Stations of the two journals, counted from 1 at the compressor's end, rising.

    Raises
    ------
    ValueError
        Where a size is not positive, numbers of sizes do not fit together, or the bearing stations are not two
        different stations in rising order.
    """

    masses: tuple[float, ...]
    diametral_inertias: tuple[float, ...]
    polar_inertias: tuple[float, ...]
    radii: tuple[float, ...]
    lengths: tuple[float, ...]
    youngs_modulus: float
    bearing_stations: tuple[int, int]

    def __post_init__(self) -> None:
        n = len(self.masses)
        if n < 2:
            raise ValueError(f"masses: a rotor has two stations or more, got {n}")
        sized = (
            ("masses", self.masses, "kg", n),
            ("diametral_inertias", self.diametral_inertias, "kg m²", n),
            ("polar_inertias", self.polar_inertias, "kg m²", n),
            ("radii", self.radii, "m", n - 1),
            ("lengths", self.lengths, "m", n - 1),
            ("youngs_modulus", (self.youngs_modulus,), "Pa", 1),
        )
        for name, values, unit, count in sized:
            if len(values) != count:
                raise ValueError(f"{name}: {len(values)} values, expected {count} for a rotor of {n} stations")
            for value in values:
                require_positive(name, value, unit)
        first, second = self.bearing_stations
        if not 1 <= first < second <= n:
            raise ValueError(
                f"bearing_stations: {self.bearing_stations}, expected two different stations from 1 to {n}, "
                "in rising order"
            )

    @property
    def stations(self) -> int:
        """Number of stations."""
        return len(self.masses)

    @property
    def journals(self) -> tuple[int, int]:
        """Degrees of freedom (counted from 0) that are the journals' displacements."""
        first, second = self.bearing_stations
        return self.displacement(first), self.displacement(second)

    def displacement(self, station: int) -> int:
        """Return the degree of freedom (counted from 0) that is the displacement of a station (counted from 1)."""
        if not 1 <= station <= self.stations:
            raise ValueError(f"station: {station}, expected 1 to {self.stations}")
        return 2 * (station - 1)

    def mass_matrix(self) -> FloatArray:
        """Return M, (2 n, 2 n): lumped masses, kg, and diametral inertias, kg m²."""
        return np.diag(np.ravel(np.column_stack((self.masses, self.diametral_inertias))))

    def gyroscopic_matrix(self) -> FloatArray:
        """Return J, (2 n, 2 n): polar inertias, kg m², at the slopes."""
        return np.diag(np.ravel(np.column_stack((np.zeros(self.stations), self.polar_inertias))))

    def stiffness_matrix(self) -> FloatArray:
        """Return K, (2 n, 2 n), of the free shaft: N/m, N and N m, from Euler-Bernoulli beam elements."""
        stiffness = np.zeros((2 * self.stations, 2 * self.stations))
        for segment, (radius, length) in enumerate(zip(self.radii, self.lengths, strict=True)):
            dofs = slice(2 * segment, 2 * segment + 4)
            stiffness[dofs, dofs] += beam_element(self.youngs_modulus, radius, length)
        return stiffness


def beam_element(youngs_modulus: float, radius: float, length: float) -> FloatArray:
    """Return the stiffness of a round Euler-Bernoulli segment between ``(z, phi)`` at its ends.

    Parameters
    ----------
    youngs_modulus : float
        Pa.
    radius, length : float
        m.

    Returns
    -------
    ndarray, shape (4, 4)
        N/m, N and N m.
    """
    second_moment = math.pi * radius**4 / 4
    lever = length
    shape = np.array(
        [
            [12, 6 * lever, -12, 6 * lever],
            [6 * lever, 4 * lever**2, -6 * lever, 2 * lever**2],
            [-12, -6 * lever, 12, -6 * lever],
            [6 * lever, 2 * lever**2, -6 * lever, 4 * lever**2],
        ]
    )
    return youngs_modulus * second_moment / length**3 * shape


def require_positive(name: str, value: float, unit: str) -> None:
    """Raise ValueError, naming quantity, value and unit, unless the value is finite and above 0."""
    if not (math.isfinite(value) and value > 0):
        raise ValueError(f"{name}: {value:g} {unit}, expected a finite value above 0")
