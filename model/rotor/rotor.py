"""The rotor: discs on shaft segments, element matrices, and the rotor's matrices in complex coordinates.

With ``z = x + i y`` and the slope ``phi = theta_y - i theta_x`` at each station, both planes combine into one equation
(thesis, eq. (5.12)): ``M z'' - i Omega J z' + K z = F`` with real symmetric matrices and the degrees of freedom
``(z_1, phi_1, z_2, phi_2, ...)``. X points right, Y up, and the shaft turns from X to Y.

Element matrices follow thesis, eqs. (4.6) to (4.9), extended to the Timoshenko beam by the shear parameter ``shear``,
bending stiffness over shear stiffness (Przemieniecki's Phi). With 0 they are those of the Euler-Bernoulli beam.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from analysis.signals import FloatArray
from model.errors import ParameterError

LENGTH_POWERS = np.array([0, 1, 0, 1])  # slopes carry a factor of the length


def second_moment(radius: float, inner_radius: float = 0.0) -> float:
    """Return the second moment of area of a round section, m⁴, from its radii, m."""
    return math.pi * (radius**4 - inner_radius**4) / 4


def area(radius: float, inner_radius: float = 0.0) -> float:
    """Return the area of a round section, m², from its radii, m."""
    return math.pi * (radius**2 - inner_radius**2)


def shear_coefficient(poissons_ratio: float, radius: float, inner_radius: float = 0.0) -> float:
    """Return the shear coefficient kappa of a round section after Cowper (J. Appl. Mech. 33, 1966)."""
    nu, hollow = poissons_ratio, (inner_radius / radius) ** 2
    wall = (1 + hollow) ** 2
    return 6 * (1 + nu) * wall / ((7 + 6 * nu) * wall + (20 + 12 * nu) * hollow)


def stiffness_element(bending_stiffness: float, length: float, shear: float = 0.0) -> FloatArray:
    """Return the stiffness matrix of a segment.

    Parameters
    ----------
    bending_stiffness : float
        E I, N m².
    length : float
        m.
    shear : float
        12 E I / (kappa G A l²); 0 for the Euler-Bernoulli beam.

    Returns
    -------
    ndarray, shape (4, 4)
        N/m, N and N m.
    """
    shape = np.array(
        [
            [12, 6, -12, 6],
            [6, 4 + shear, -6, 2 - shear],
            [-12, -6, 12, -6],
            [6, 2 - shear, -6, 4 + shear],
        ]
    )
    return bending_stiffness / (length**3 * (1 + shear)) * _scaled_by_length(shape, length)  # Eq. (4.9)


def mass_element(linear_density: float, length: float, shear: float = 0.0) -> FloatArray:
    """Return the consistent mass matrix of a segment, for translation.

    Parameters
    ----------
    linear_density : float
        kg/m.
    length, shear : float
        As for `stiffness_element`.

    Returns
    -------
    ndarray, shape (4, 4)
        kg, kg m and kg m².
    """
    s, s2 = shear, shear**2
    a, b, c = 312 + 588 * s + 280 * s2, 44 + 77 * s + 35 * s2, 108 + 252 * s + 140 * s2
    d, e, f = 26 + 63 * s + 35 * s2, 8 + 14 * s + 7 * s2, 6 + 14 * s + 7 * s2
    shape = np.array([[a, b, c, -d], [b, e, d, -f], [c, d, a, -b], [-d, -f, -b, e]])
    return linear_density * length / (840 * (1 + s) ** 2) * _scaled_by_length(shape, length)  # Eq. (4.6)


def rotary_inertia_element(inertia_density: float, length: float, shear: float = 0.0) -> FloatArray:
    """Return the rotary inertia matrix of a segment; with twice the density, its gyroscopic matrix.

    Parameters
    ----------
    inertia_density : float
        Moment of inertia per unit length, kg m: about a diameter for eq. (4.7), about the axis for eq. (4.8).
    length, shear : float
        As for `stiffness_element`.

    Returns
    -------
    ndarray, shape (4, 4)
        kg, kg m and kg m².
    """
    s, s2 = shear, shear**2
    a, b, c = 3 - 15 * s, 4 + 5 * s + 10 * s2, 1 + 5 * s - 5 * s2
    shape = np.array([[36, a, -36, a], [a, b, -a, -c], [-36, -a, 36, -a], [a, -c, -a, b]])
    return inertia_density / (30 * length * (1 + s) ** 2) * _scaled_by_length(shape, length)  # Eq. (4.7), (4.8)


def _scaled_by_length(shape: FloatArray, length: float) -> FloatArray:
    factors = length**LENGTH_POWERS
    return np.asarray(shape * np.outer(factors, factors), dtype=np.float64)


class Beam(StrEnum):
    """Beam theory of the segments."""

    EULER_BERNOULLI = "euler-bernoulli"
    TIMOSHENKO = "timoshenko"  # with shear deformation


class ShaftMass(StrEnum):
    """Distribution of the mass of the segments."""

    NONE = "none"  # included in the disc masses (5.13)
    LUMPED = "lumped"  # half at each end, with rotary inertia
    CONSISTENT = "consistent"  # along the segment, (4.6) to (4.8)


@dataclass(frozen=True, slots=True)
class Segment:
    """A round piece of shaft between two neighbouring stations.

    Parameters
    ----------
    length : float
        m.
    radius : float
        m.
    inner_radius : float
        Of a hollow shaft, m; 0 for a solid one.
    youngs_modulus : float
        Pa.
    density : float
        kg/m³; may be 0 with `ShaftMass.NONE`.
    poissons_ratio : float
        For the shear deformation.

    Raises
    ------
    ParameterError
        If a size is not positive, the shaft has no wall, or Poisson's ratio is not between 0 and 0.5.
    """

    length: float
    radius: float
    inner_radius: float = 0.0
    youngs_modulus: float = 205e9
    density: float = 0.0
    poissons_ratio: float = 0.3

    def __post_init__(self) -> None:
        require_positive("length", self.length, "m")
        require_positive("radius", self.radius, "m")
        require_positive("youngs_modulus", self.youngs_modulus, "Pa")
        if not 0 <= self.inner_radius < self.radius:
            raise ParameterError(f"inner_radius: {self.inner_radius:g} m, expected 0 to less than {self.radius:g} m")
        if not (math.isfinite(self.density) and self.density >= 0):
            raise ParameterError(f"density: {self.density:g} kg/m³, expected a finite value, 0 or more")
        if not 0 <= self.poissons_ratio <= 0.5:
            raise ParameterError(f"poissons_ratio: {self.poissons_ratio:g}, expected 0 to 0.5")

    @property
    def bending_stiffness(self) -> float:
        """E I, N m²."""
        return self.youngs_modulus * second_moment(self.radius, self.inner_radius)

    @property
    def linear_density(self) -> float:
        """Mass per unit length, kg/m."""
        return self.density * area(self.radius, self.inner_radius)

    @property
    def inertia_density(self) -> float:
        """Moment of inertia about a diameter per unit length, kg m; about the axis it is twice this."""
        return self.density * second_moment(self.radius, self.inner_radius)

    @property
    def shear_parameter(self) -> float:
        """Bending stiffness over shear stiffness, 12 E I / (kappa G A l²)."""
        shear_modulus = self.youngs_modulus / (2 * (1 + self.poissons_ratio))
        section = area(self.radius, self.inner_radius)
        kappa = shear_coefficient(self.poissons_ratio, self.radius, self.inner_radius)
        return 12 * self.bending_stiffness / (kappa * shear_modulus * section * self.length**2)


@dataclass(frozen=True, slots=True)
class Disc:
    """A rigid disc at a station.

    Parameters
    ----------
    station : int
        Counted from 1 at the compressor end.
    mass : float
        kg.
    diametral_inertia, polar_inertia : float
        Moments of inertia about a diameter and about the axis, kg m².

    Raises
    ------
    ParameterError
        If a size is not positive.
    """

    station: int
    mass: float
    diametral_inertia: float
    polar_inertia: float

    def __post_init__(self) -> None:
        require_positive(f"mass of the disc at station {self.station}", self.mass, "kg")
        require_positive(f"diametral_inertia of the disc at station {self.station}", self.diametral_inertia, "kg m²")
        require_positive(f"polar_inertia of the disc at station {self.station}", self.polar_inertia, "kg m²")


@dataclass(frozen=True, slots=True)
class Rotor:
    """A rotor of ``n`` stations joined by ``n - 1`` round shaft segments.

    Parameters
    ----------
    segments : tuple of Segment, length n - 1
        In order from the compressor end.
    discs : tuple of Disc
        Any number at any station.
    bearing_stations : tuple of int, length 2 or 0
        Stations of the two journals, counted from 1 at the compressor end, rising; empty for a rotor without journals.
    shaft_mass : ShaftMass
        Distribution of the mass of the segments.
    beam : Beam
        Beam theory of the segments.

    Raises
    ------
    ParameterError
        If there is no segment, a disc or journal is at no station, the bearing stations are not two different stations
        in rising order, or a station has no mass.
    """

    segments: tuple[Segment, ...]
    discs: tuple[Disc, ...]
    bearing_stations: tuple[int, ...]
    shaft_mass: ShaftMass = ShaftMass.NONE
    beam: Beam = Beam.EULER_BERNOULLI

    def __post_init__(self) -> None:
        if not self.segments:
            raise ParameterError("segments: none, expected one or more: a rotor has two stations or more")
        n = self.stations
        for disc in self.discs:
            if not 1 <= disc.station <= n:
                raise ParameterError(f"disc: station {disc.station}, expected 1 to {n}")
        if self.bearing_stations:
            first, second = self.journal_stations
            if not 1 <= first < second <= n:
                raise ParameterError(
                    f"bearing_stations: {self.bearing_stations}, expected two different stations from 1 to {n}, "
                    "in rising order"
                )
        with_disc = {disc.station for disc in self.discs}
        if self.shaft_mass is not ShaftMass.NONE:
            for number, segment in enumerate(self.segments, 1):
                if segment.density == 0:
                    raise ParameterError(
                        f"density: 0 kg/m³ in segment {number}, expected above 0 with shaft_mass {self.shaft_mass}"
                    )
        elif missing := sorted(set(range(1, n + 1)) - with_disc):
            raise ParameterError(
                f"disc: none at station {missing[0]}, expected one at every station with shaft_mass none"
            )

    @property
    def stations(self) -> int:
        """Number of stations."""
        return len(self.segments) + 1

    @property
    def positions(self) -> FloatArray:
        """Axial positions of the stations from the compressor end, (n,), m."""
        return np.concatenate(([0.0], np.cumsum([segment.length for segment in self.segments])))

    @property
    def mass(self) -> float:
        """Mass of the rotor, kg."""
        discs = sum(disc.mass for disc in self.discs)
        if self.shaft_mass is ShaftMass.NONE:
            return discs
        return discs + sum(segment.linear_density * segment.length for segment in self.segments)

    @property
    def journal_stations(self) -> tuple[int, int]:
        """Stations of the two journals; ParameterError if there are none."""
        self.require_journals()
        first, second = self.bearing_stations
        return first, second

    @property
    def journals(self) -> tuple[int, int]:
        """Degrees of freedom (counted from 0) of the displacements of the journals."""
        first, second = self.journal_stations
        return self.displacement(first), self.displacement(second)

    @property
    def translation(self) -> FloatArray:
        """Unit displacement of all stations, (2 n,)."""
        return np.tile([1.0, 0.0], self.stations)

    def require_journals(self) -> None:
        """Raise ParameterError unless there are two journals."""
        if len(self.bearing_stations) != 2:
            count = len(self.bearing_stations) or "none"
            raise ParameterError(f"journal: {count}, expected two stations for bearings or springs")

    def displacement(self, station: int) -> int:
        """Return the degree of freedom (counted from 0) of the displacement of a station (counted from 1)."""
        if not 1 <= station <= self.stations:
            raise ParameterError(f"station: {station}, expected 1 to {self.stations}")
        return 2 * (station - 1)

    def radius(self, station: int) -> float:
        """Return the shaft radius at a station (counted from 1), the larger of both adjacent segments, m."""
        if not 1 <= station <= self.stations:
            raise ParameterError(f"station: {station}, expected 1 to {self.stations}")
        return max(segment.radius for segment in self.segments[max(station - 2, 0) : station])

    def mass_matrix(self) -> FloatArray:
        """Return the mass matrix M of discs (5.13) and shaft, (2 n, 2 n): masses, kg, and diametral inertias, kg m²."""
        mass = np.zeros((2 * self.stations, 2 * self.stations))
        for disc in self.discs:
            place = self.displacement(disc.station)
            mass[place, place] += disc.mass
            mass[place + 1, place + 1] += disc.diametral_inertia
        return mass + self._assemble(self._own_mass)

    def gyroscopic_matrix(self) -> FloatArray:
        """Return the gyroscopic matrix J, (2 n, 2 n): polar inertias, kg m², at the slopes."""
        gyroscopic = np.zeros((2 * self.stations, 2 * self.stations))
        for disc in self.discs:
            slope = self.displacement(disc.station) + 1
            gyroscopic[slope, slope] += disc.polar_inertia
        return gyroscopic + self._assemble(self._own_gyroscopic)

    def stiffness_matrix(self) -> FloatArray:
        """Return the stiffness matrix K of the free shaft, (2 n, 2 n): N/m, N and N m."""
        return self._assemble(
            lambda segment: stiffness_element(segment.bending_stiffness, segment.length, self._shear(segment))
        )

    def _assemble(self, element: Callable[[Segment], FloatArray]) -> FloatArray:
        matrix = np.zeros((2 * self.stations, 2 * self.stations))
        for number, segment in enumerate(self.segments):
            dofs = slice(2 * number, 2 * number + 4)
            matrix[dofs, dofs] += element(segment)
        return matrix

    def _shear(self, segment: Segment) -> float:
        return segment.shear_parameter if self.beam is Beam.TIMOSHENKO else 0.0

    def _own_mass(self, segment: Segment) -> FloatArray:
        if self.shaft_mass is ShaftMass.CONSISTENT:
            shear = self._shear(segment)
            translation = mass_element(segment.linear_density, segment.length, shear)
            return translation + rotary_inertia_element(segment.inertia_density, segment.length, shear)
        if self.shaft_mass is ShaftMass.NONE:
            return np.zeros((4, 4))
        half = segment.length / 2
        inertia = half * segment.inertia_density + segment.linear_density * half**3 / 12  # of half a segment
        return np.diag([half * segment.linear_density, inertia] * 2)

    def _own_gyroscopic(self, segment: Segment) -> FloatArray:
        polar = 2 * segment.inertia_density
        if self.shaft_mass is ShaftMass.CONSISTENT:
            return rotary_inertia_element(polar, segment.length, self._shear(segment))
        if self.shaft_mass is ShaftMass.NONE:
            return np.zeros((4, 4))
        return np.diag([0.0, polar * segment.length / 2] * 2)


def require_positive(name: str, value: float, unit: str) -> None:
    """Raise ParameterError with name, value and unit unless the value is finite and above 0."""
    if not (math.isfinite(value) and value > 0):
        raise ParameterError(f"{name}: {value:g} {unit}, expected a finite value above 0")


def require_rising(speeds: FloatArray) -> None:
    """Raise ParameterError unless there are two or more speeds, rad/s, above 0 and rising."""
    if speeds.ndim != 1 or speeds.size < 2 or not (speeds[0] > 0 and np.all(np.diff(speeds) > 0)):
        raise ParameterError(f"speeds: {speeds}, rad/s, expected two or more, rising, above 0")
