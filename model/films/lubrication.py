"""Lubrication of a floating-ring bearing under a constant load (thesis, chapter 3): equilibrium and oil flow.

Axes: X right, Y up; the shaft turns counter-clockwise and the load points down. ``Psi`` is the angle around the bearing
in the direction of rotation, rad, 0 at the oil inlet at the top. The inner film carries the load, the outer one the
load and the ring weight, so each film is solved separately. Both films are infinitely long.

Table 3.1 taken literally does not give the numbers of the chapter. Two calibration factors, for which the thesis names
no cause, reproduce its equilibria and cavities but not its flows: `Lubrication.load_factor` and
`Lubrication.inner_capacity_factor`, set in `thesis_like_lubrication`. `nominal_lubrication` has no calibration.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from analysis.signals import FloatArray
from model.errors import ParameterError
from model.films.long_film import FilmEquilibrium, film_equilibrium, just_complete_film
from model.rotor.parameters import GRAVITY, FloatingRing
from model.rotor.rotor import require_positive

HOLES = 6  # evenly spaced in the ring, section 3.3.3


@dataclass(frozen=True, slots=True)
class RingEquilibrium:
    """Equilibrium of journal and ring in the bearing.

    Parameters
    ----------
    inner, outer : FilmEquilibrium
        Journal in ring and ring in housing.
    flow_scale : float
        Flow through one hole, kg/s per square root of Pa.
    """

    inner: FilmEquilibrium
    outer: FilmEquilibrium
    flow_scale: float

    def pressure_difference(self, psi: ArrayLike) -> FloatArray:
        """Return the pressure of the outer film minus that of the inner film at angles around the bearing (rad), Pa."""
        return self.outer.pressure(psi) - self.inner.pressure(psi)

    def hole_flow(self, psi: ArrayLike) -> FloatArray:
        """Return the oil flow through one hole at angles around the bearing (rad), kg/s, positive inwards.

        Proportional to the square root of the pressure difference, (3.24); `flow_scale` replaces the constants that the
        thesis omits.
        """
        difference = self.pressure_difference(psi)
        return np.asarray(self.flow_scale * np.sign(difference) * np.sqrt(np.abs(difference)))  # Eq. (3.24)

    def flow(self, ring_angle: ArrayLike) -> FloatArray:
        """Return the oil flow through the six holes into the inner film, kg/s.

        Parameters
        ----------
        ring_angle : array_like
            Angle of the first hole, Psi, rad.

        Returns
        -------
        ndarray
            kg/s in the shape of `ring_angle`, positive into the inner film. Proportional to the calibration
            `flow_scale`, so only shape and sign are meaningful.
        """
        holes = 2 * np.pi / HOLES * np.arange(HOLES)
        angles = np.asarray(ring_angle, dtype=np.float64)[..., np.newaxis] + holes
        return np.asarray(np.sum(self.hole_flow(angles), axis=-1))

    def mean_flow(self, angles: int = 240) -> float:
        """Return the flow into the inner film averaged over a revolution of the ring, kg/s (a calibrated value).

        Parameters
        ----------
        angles : int
            Number of ring angles between two holes over which the flow is averaged.
        """
        return float(np.mean(self.flow(2 * np.pi / HOLES * (np.arange(angles) + 0.5) / angles)))


@dataclass(frozen=True, slots=True)
class Lubrication:
    """A floating-ring bearing with its oil supply, as modelled in chapter 3.

    Parameters
    ----------
    bearing : FloatingRing
        Sizes, ring mass and oil viscosity.
    load_factor : float
        Calibration of the load of both films: load carried over load stated; 1 is uncalibrated.
    inner_capacity_factor : float
        Calibration of the pressures of the inner film; 1 is uncalibrated.
    flow_scale : float
        Calibration of the flow through one hole, kg/s per square root of Pa. The thesis gives neither diameter nor
        length of the holes, and its (3.24) has no unit of flow: flows are known up to this factor only. The default
        gives the 2.1e-4 kg/s of page 84 (10 N, 1e5 Pa, 1,000 rad/s) with both other factors at 1.
    gravity : float
        m/s².

    Raises
    ------
    ParameterError
        If a factor is not positive or gravity is negative.
    """

    bearing: FloatingRing
    load_factor: float = 1.0
    inner_capacity_factor: float = 1.0
    flow_scale: float = 1.22e-7
    gravity: float = GRAVITY

    def __post_init__(self) -> None:
        for name, unit in (("load_factor", ""), ("inner_capacity_factor", ""), ("flow_scale", "kg/s/sqrt(Pa)")):
            require_positive(name, getattr(self, name), unit)
        if not (math.isfinite(self.gravity) and self.gravity >= 0):
            raise ParameterError(f"gravity: {self.gravity:g} m/s², expected a finite value, 0 or more")

    @property
    def outer_scale(self) -> float:
        """K of the outer film at a shaft speed of 1 rad/s, Pa s."""
        b = self.bearing
        return 6 * b.viscosity * b.ring_outer_radius**2 * b.ring_speed_ratio / b.outer_clearance**2

    @property
    def inner_scale(self) -> float:
        """K of the inner film at a shaft speed of 1 rad/s, Pa s."""
        b = self.bearing
        surfaces = (
            1 + b.ring_speed_ratio * b.ring_inner_radius / b.journal_radius
        )  # Eq. (3.2): sum of the surface speeds
        return self.inner_capacity_factor * 6 * b.viscosity * b.journal_radius**2 * surfaces / b.inner_clearance**2

    def equilibrium(self, load: float, speed: float, inlet_pressure: float) -> RingEquilibrium:
        """Return the equilibrium of journal and ring.

        Parameters
        ----------
        load : float
            On the journal, downwards, N.
        speed : float
            Of the shaft, rad/s.
        inlet_pressure : float
            Oil pressure at the top of the outer film, Pa; the inner film starts at zero pressure.

        Returns
        -------
        RingEquilibrium

        Raises
        ------
        ParameterError
            If a quantity is invalid.
        EquilibriumError
            If a film cannot carry the load.
        """
        require_positive("load", load, "N")
        require_positive("speed", speed, "rad/s")
        b = self.bearing
        inner_load = self.load_factor * load  # force balance of the ring: its weight is added, so the films decouple
        outer_load = inner_load + b.ring_mass * self.gravity
        return RingEquilibrium(
            inner=film_equilibrium(inner_load, self.inner_scale * speed, b.length * b.journal_radius, 0.0),
            outer=film_equilibrium(
                outer_load, self.outer_scale * speed, b.length * b.ring_outer_radius, inlet_pressure
            ),
            flow_scale=self.flow_scale,
        )

    def cavity_free_speed(self, load: float, inlet_pressure: float) -> float:
        """Return the shaft speed above which the outer film has no cavity, rad/s.

        Parameters
        ----------
        load : float
            On the journal, downwards, N.
        inlet_pressure : float
            Pa, above 0: without pressure the film always ruptures.

        Returns
        -------
        float
            rad/s.

        Raises
        ------
        ParameterError
            If load or pressure is not positive.
        EquilibriumError
            If the film would close too near its centre or the wall to be computed.
        """
        require_positive("load", load, "N")
        require_positive("inlet_pressure", inlet_pressure, "Pa")
        b = self.bearing
        outer_load = self.load_factor * load + b.ring_mass * self.gravity
        film = just_complete_film(inlet_pressure * b.length * b.ring_outer_radius / outer_load)
        return inlet_pressure / (film.inlet_rise * self.outer_scale)


def table_3_1() -> FloatingRing:
    """Return the bearing of Table 3.1 of the thesis."""
    return FloatingRing(
        length=10e-3,
        journal_radius=5e-3,
        inner_clearance=20e-6,
        outer_clearance=80e-6,
        ring_outer_radius=7e-3,
        ring_mass=0.02,
        viscosity=0.012,
    )


def nominal_lubrication() -> Lubrication:
    """Return the bearing of chapter 3 according to its table and equations, without calibration."""
    return Lubrication(table_3_1())


def thesis_like_lubrication() -> Lubrication:
    """Return the bearing of chapter 3, calibrated to the equilibria stated there; the cause is unknown."""
    return Lubrication(table_3_1(), load_factor=5.0, inner_capacity_factor=0.382)
