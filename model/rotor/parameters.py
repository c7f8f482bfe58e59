"""Parameters of the model: rotor, floating-ring bearings, imbalance, gravity and probe positions."""

import cmath
import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from analysis.signals import ComplexArray
from model.errors import ParameterError
from model.rotor.rotor import Rotor, require_positive
from model.rotor.supports import Rub, StaticLoad, Support

GRAVITY = 9.80665  # m/s²


class FilmModel(StrEnum):
    """Force law of the oil films."""

    CAPONE = "capone"  # cavitated short film, pressure where it is positive (4.38)
    FULL_SOMMERFELD = "full-sommerfeld"  # short film without cavity (2π film)


@dataclass(frozen=True, slots=True)
class FloatingRing:
    """A floating-ring bearing: an oil film inside and one outside a freely rotating ring.

    Parameters
    ----------
    length : float
        Length of both films, m.
    journal_radius : float
        Radius of the journal, m.
    inner_clearance, outer_clearance : float
        Radial clearances journal to ring and ring to housing, m.
    ring_outer_radius : float
        Outer radius of the ring, m.
    ring_mass : float
        Mass of the ring, kg.
    viscosity : float
        Dynamic viscosity of the oil in both films, Pa s.
    static_load : float
        Force of the oil feed on each ring towards -Y, in addition to its weight, N.
    film_model : FilmModel
        Force law of both films.

    Raises
    ------
    ParameterError
        If a size is not positive, the ring has no wall, or a film is thicker than a tenth of the journal radius.
    """

    length: float
    journal_radius: float
    inner_clearance: float
    outer_clearance: float
    ring_outer_radius: float
    ring_mass: float
    viscosity: float
    static_load: float = 0.0
    film_model: FilmModel = FilmModel.CAPONE

    def __post_init__(self) -> None:
        sizes = ("length", "journal_radius", "inner_clearance", "outer_clearance", "ring_outer_radius")
        units = {**dict.fromkeys(sizes, "m"), "ring_mass": "kg", "viscosity": "Pa s"}
        for name, unit in units.items():
            require_positive(name, getattr(self, name), unit)
        if not math.isfinite(self.static_load):
            raise ParameterError(f"static_load: {self.static_load:g} N, expected a finite value")
        if self.ring_outer_radius <= self.ring_inner_radius:
            raise ParameterError(
                f"ring_outer_radius: {self.ring_outer_radius:g} m, expected more than the ring's inner radius "
                f"{self.ring_inner_radius:g} m (journal radius plus inner clearance)"
            )
        for name, clearance in (("inner_clearance", self.inner_clearance), ("outer_clearance", self.outer_clearance)):
            if clearance > 0.1 * self.journal_radius:
                raise ParameterError(
                    f"{name}: {clearance:g} m, expected a thin film, at most a tenth of the journal's radius"
                )

    @property
    def ring_inner_radius(self) -> float:
        """Inner radius of the ring, m."""
        return self.journal_radius + self.inner_clearance

    @property
    def clearance(self) -> float:
        """Largest displacement of the journal centre from the housing centre, m."""
        return self.inner_clearance + self.outer_clearance

    @property
    def ring_speed_ratio(self) -> float:
        """Ring speed over shaft speed, from the balance of the drag of both films at small eccentricity."""
        drag = self.ring_outer_radius**3 * self.inner_clearance / (self.journal_radius**3 * self.outer_clearance)
        return 1 / (1 + drag)  # Eq. (3.25)


@dataclass(frozen=True, slots=True)
class Imbalance:
    """An imbalance at a station.

    Parameters
    ----------
    station : int
        Counted from 1 at the compressor end.
    magnitude : float
        Mass times eccentricity, kg m.
    phase : float
        Angle of the heavy spot from the once-per-turn mark in the direction of rotation, rad. At theta = 0 the mark
        points to +X.
    """

    station: int
    magnitude: float
    phase: float = 0.0

    def require_below(self, maximum: float, reason: str) -> None:
        """Raise ParameterError unless the imbalance is finite and at most ``maximum``, kg m."""
        if not (math.isfinite(self.magnitude) and self.magnitude >= 0):
            raise ParameterError(f"imbalance: {self.magnitude:g} kg m, expected a finite value, 0 or more")
        if not math.isfinite(self.phase):
            raise ParameterError(f"imbalance: phase {self.phase} rad, expected a finite angle")
        if self.magnitude > maximum:
            raise ParameterError(
                f"imbalance: {self.magnitude:g} kg m at station {self.station}, expected at most {maximum:g} kg m "
                f"{reason}"
            )


@dataclass(frozen=True, slots=True)
class Bow:
    """Displacement of the unloaded, bent shaft at a station; it rotates with the shaft.

    Parameters
    ----------
    station : int
        Counted from 1 at the compressor end.
    displacement : float
        From the line through the journals, m.
    phase : float
        Angle from the once-per-turn mark in the direction of rotation, rad.
    """

    station: int
    displacement: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.displacement) and math.isfinite(self.phase)):
            raise ParameterError(
                f"bow: {self.displacement:g} m at {self.phase:g} rad at station {self.station}, expected finite values"
            )


@dataclass(frozen=True, slots=True)
class ModelParameters:
    """A rotor on two equal floating-ring bearings or on linear supports, with its loads and the probes.

    Parameters
    ----------
    rotor : Rotor
        Shaft and discs.
    bearing : FloatingRing or None
        Both bearings; None for a rotor without oil films, on its linear supports alone.
    imbalances : tuple of Imbalance
        May be empty.
    gravity : float
        Acceleration towards -Y, m/s²; 0 switches it off.
    probe_station : int
        Station at which the probes measure, counted from 1 at the compressor end.
    probe_angles : tuple of float, length 2
        Angles of the probes x and y from +X, positive in the direction of rotation, rad.
    loads : tuple of StaticLoad
        Constant forces on the shaft in addition to its weight.
    supports : tuple of Support
        Linear supports. The motion in time uses them together with the floating rings; modes, critical speeds and the
        linear response use them alone.
    rubs : tuple of Rub
        Walls that the shaft may touch in the motion in time.
    bows : tuple of Bow
        Residual bow of the shaft. Its shape is the elastic line through these displacements and through 0 at the
        journals and supports.
    modal_damping : float
        Damping ratio of every bending mode of the free shaft against the fixed frame.

    Raises
    ------
    ParameterError
        If a station does not exist, gravity is negative, a bearing has no journals, or an imbalance is larger than the
        rotor mass times the bearing clearance: rotating about its centre of mass, the rotor would not fit into the
        bearing.
    """

    rotor: Rotor
    bearing: FloatingRing | None
    imbalances: tuple[Imbalance, ...]
    gravity: float = GRAVITY
    probe_station: int = 1
    probe_angles: tuple[float, float] = (0.0, math.pi / 2)
    loads: tuple[StaticLoad, ...] = ()
    supports: tuple[Support, ...] = ()
    rubs: tuple[Rub, ...] = ()
    bows: tuple[Bow, ...] = ()
    modal_damping: float = 0.0

    def __post_init__(self) -> None:
        last = self.rotor.stations
        if not 1 <= self.probe_station <= last:
            raise ParameterError(f"probe_station: {self.probe_station}, expected 1 to {last}")
        if not (math.isfinite(self.gravity) and self.gravity >= 0):
            raise ParameterError(f"gravity: {self.gravity:g} m/s², expected a finite value, 0 or more")
        for angle in self.probe_angles:
            if not math.isfinite(angle):
                raise ParameterError(f"probe_angles: {angle} rad, expected finite angles")
        if not 0 <= self.modal_damping < 1:
            raise ParameterError(f"modal_damping: {self.modal_damping:g}, expected a ratio, 0 or more and below 1")
        self._require_stations()
        maximum, reason = math.inf, ""
        if self.bearing is not None:
            maximum = self.rotor.mass * self.bearing.clearance
            reason = f"(the rotor's mass times the bearing's clearance of {self.bearing.clearance:g} m)"
            self.rotor.require_journals()
        for imbalance in self.imbalances:
            imbalance.require_below(maximum, reason)

    def _require_stations(self) -> None:
        last = self.rotor.stations
        placed: tuple[tuple[str, tuple[Imbalance | StaticLoad | Support | Rub | Bow, ...]], ...] = (
            ("imbalance", self.imbalances),
            ("load", self.loads),
            ("support", self.supports),
            ("rub", self.rubs),
            ("bow", self.bows),
        )
        for name, things in placed:
            for thing in things:
                if not 1 <= thing.station <= last:
                    raise ParameterError(f"{name}: station {thing.station}, expected 1 to {last}")

    @property
    def floating_ring(self) -> FloatingRing:
        """The bearings of a rotor on oil films; ParameterError if it has none."""
        if self.bearing is None:
            raise ParameterError("bearing: none, expected a rotor on oil films, with [bearing] in its file")
        return self.bearing

    @property
    def is_loaded(self) -> bool:
        """Whether weight or other constant loads move the shaft or the rings out of the bearing centre."""
        return bool(self.gravity > 0 or self.loads or (self.bearing and self.bearing.static_load))

    def bow_forces(self) -> ComplexArray:
        """Return the forces and moments that would bend a straight shaft to the bow at theta = 0, (2 n,), N and N m.

        Raises ParameterError if displacements are known at fewer than three stations: the shaft would be straight.
        """
        rotor, shape = self.rotor, np.zeros(2 * self.rotor.stations, np.complex128)
        if not self.bows:
            return shape
        held = (*rotor.bearing_stations, *(support.station for support in self.supports))
        known = dict.fromkeys((rotor.displacement(station) for station in held), 0j)
        known |= {rotor.displacement(bow.station): cmath.rect(bow.displacement, bow.phase) for bow in self.bows}
        if len(known) < 3:
            raise ParameterError(f"bow: known at {len(known)} stations with those of the journals, expected three")
        stiffness, dofs = rotor.stiffness_matrix(), list(known)
        free = [dof for dof in range(shape.size) if dof not in known]
        shape[dofs] = list(known.values())
        # no force acts elsewhere
        shape[free] = -np.linalg.solve(stiffness[np.ix_(free, free)], stiffness[np.ix_(free, dofs)] @ shape[dofs])
        return np.asarray(stiffness @ shape)
