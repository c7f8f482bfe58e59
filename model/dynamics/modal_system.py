"""Modal model for the integration in time: shaft modes, films, rings, supports and walls; state and work arrays."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from analysis.signals import ComplexArray, FloatArray, IntArray
from model.errors import ParameterError
from model.films.film_kernels import FORCE_LAWS, MIN_WALL_MARGIN, ForceLaw
from model.linear.modes import free_modes
from model.rotor.parameters import FloatingRing, ModelParameters
from model.rotor.supports import SupportCoefficients

POSITION_TOLERANCE = 1e-9  # of the inner clearance
USUAL_CLEARANCE = 1e-5  # m, in its place without films

NO_LEVEL = -1
DEFAULT_MODES = 6  # two rigid-body, four bending: within 0.05 % of the result with all twelve
MODES_WITH_CONSTRAINTS = 16  # with supports or walls: stiff ones excite higher modes
N_LEVELS = 6  # levels of step size, each a fourth of the one before
MAX_BOUNCE_PHASE = 0.2  # rad: phase of a bounce on a wall per time step


class NewmarkMatrices(NamedTuple):
    """Newmark's matrices for a time step and its divisions by four; inverse ``T diag(1 / (1 - i Omega g)) T^T``.

    Parameters
    ----------
    steps : ndarray of float64, shape (n_levels,)
        Time steps, s, each a fourth of the one before.
    transforms : ndarray of float64, shape (n_levels, m, m)
        T.
    gyroscopic : ndarray of float64, shape (n_levels, m)
        g, s.
    points : ndarray of float64, shape (n_levels, n_points, m)
        Mode shapes at the points, times T.
    """

    steps: FloatArray
    transforms: FloatArray
    gyroscopic: FloatArray
    points: FloatArray


class MotionState(NamedTuple):
    """State of the motion between time steps; changed in place.

    Parameters
    ----------
    motion : ndarray of complex128, shape (3, m + n_rings)
        Displacements, velocities and accelerations of modes, then rings, m, m/s, m/s².
    inverse : ndarray of float64, shape (n, n)
        Inverse of the Newton matrix, reused while Newton converges; n = 2 (n_points + n_rings).
    level : ndarray of int64, shape (1,)
        Level of step size of this inverse; ``NO_LEVEL`` for none.
    angle, speed, acceleration : ndarray of float64, shape (1,)
        Of the shaft, rad, rad/s and rad/s².
    """

    motion: ComplexArray
    inverse: FloatArray
    level: IntArray
    angle: FloatArray
    speed: FloatArray
    acceleration: FloatArray

    def set_initial_state(self, initial_state: FloatArray) -> None:
        """Set the motion to an initial state, (4 (m + n_rings),): see `model.dynamics.stability`."""
        self.motion[:] = 0.0
        self.disturb(initial_state)

    def disturb(self, disturbance: FloatArray) -> None:
        """Add a disturbance of the same form as an initial state."""
        position, rate = disturbance.view(np.complex128).reshape(2, -1)
        self.motion[0] += position
        self.motion[1] += self.speed[0] * rate
        self.level[0] = NO_LEVEL


class Workspace(NamedTuple):
    """Work arrays of a time step, allocated once per integration. Bodies are points of the shaft, then rings.

    Parameters
    ----------
    bodies : ndarray of complex128, shape (2, n_bodies)
        Positions, m, and velocities, m/s: the iterates of Newton's method.
    start : ndarray of complex128, shape (3, n_bodies)
        Positions, velocities and accelerations, m/s², at the start of the step.
    free : ndarray of complex128, shape (n_bodies,)
        Positions at the end of the step without bearing forces, m.
    receptance : ndarray of complex128, shape (n_bodies, n_bodies)
        Displacement of a body per force on another, m/N.
    forces : ndarray of complex128, shape (n_bodies,)
        Bearing forces on the bodies, N.
    derivatives : ndarray of complex128, shape (n_bodies, n_bodies, 2)
        Derivatives of the forces with respect to X and Y, N/m.
    residual, change : ndarray of float64, shape (2 n_bodies,)
        Residual of the equations and Newton step, m: X and Y alternately.
    matrix : ndarray of float64, shape (2 n_bodies, 2 n_bodies)
        Newton matrix.
    modal : ndarray of complex128, shape (3, m)
        Forces, diagonal coordinates, compliances.
    saved : ndarray of complex128, shape (3, m + n_rings)
        Motion at the start of the caller's step, for a restart with shorter steps.
    interval : ndarray of float64, shape (2, 2)
        Angle, rad, and speed, rad/s, of the shaft at start and end of the caller's step.
    """

    bodies: ComplexArray
    start: ComplexArray
    free: ComplexArray
    receptance: ComplexArray
    forces: ComplexArray
    derivatives: ComplexArray
    residual: FloatArray
    change: FloatArray
    matrix: FloatArray
    modal: ComplexArray
    saved: ComplexArray
    interval: FloatArray


class ModalShaft(NamedTuple):
    """Modes of the free shaft and their excitation.

    Parameters
    ----------
    squared_frequencies : ndarray of float64, shape (m,)
        Squared natural frequencies, rad²/s².
    gyroscopic : ndarray of float64, shape (m, m)
        Modal polar inertia.
    points : ndarray of float64, shape (n_points, m)
        Mode shapes at the points where forces act, kg^-1/2: the journals, then other stations with supports or walls.
    probe : ndarray of float64, shape (m,)
        Mode shapes at the station of the probes.
    imbalance : ndarray of complex128, shape (m,)
        Modal imbalance at theta = 0, kg m times mode shape.
    weight : ndarray of complex128, shape (m,)
        Modal weight and other constant loads.
    damping : ndarray of float64, shape (m,)
        Twice the damping ratio times the natural frequency, rad/s.
    bow : ndarray of complex128, shape (m,)
        Modal forces that would bend a straight shaft to the bow at theta = 0.
    """

    squared_frequencies: FloatArray
    gyroscopic: FloatArray
    points: FloatArray
    probe: FloatArray
    imbalance: ComplexArray
    weight: ComplexArray
    damping: FloatArray
    bow: ComplexArray

    @property
    def journals(self) -> FloatArray:
        """Mode shapes at the journals, (2, m)."""
        return self.points[:2]


class Films(NamedTuple):
    """The films of one floating-ring bearing.

    Parameters
    ----------
    inner_factor, outer_factor : float
        mu R L³ / (4 C²) of each film, N s: the scale of its force at unit surface speed.
    inner_clearance, outer_clearance : float
        Radial clearances, m.
    inner_speed, outer_speed : float
        Sum of the surface speeds of a film over the shaft speed.
    law : ForceLaw
        Force law of both films.
    """

    inner_factor: float
    outer_factor: float
    inner_clearance: float
    outer_clearance: float
    inner_speed: float
    outer_speed: float
    law: ForceLaw


class Rings(NamedTuple):
    """Rings: with films the two floating rings, then those of linear supports.

    Parameters
    ----------
    mass : ndarray of float64, shape (n_rings,)
        kg.
    gravity : ndarray of float64, shape (n_rings,)
        Constant force towards -Y (weight and oil feed) over mass, m/s².
    """

    mass: FloatArray
    gravity: FloatArray


class Parts(NamedTuple):
    """Shaft, films, if it has any, and rings: the parts of every system; and the tolerance of positions, m."""

    shaft: ModalShaft
    films: Films | None
    rings: Rings
    tolerance: float


class Constraints(NamedTuple):
    """Linear supports of the shaft and walls that it may touch. Bodies are points of the shaft, then rings.

    Parameters
    ----------
    points : int
        Number of points of the shaft.
    supported : ndarray of int64, shape (n_supports, 2)
        Indices of the supported point and of the ring between, -1 for none.
    coefficients : ndarray of complex128, shape (n_supports, 8)
        Coefficients of `model.dynamics.condensed.support_force`: four between shaft and ring (or housing), then four
        between ring and housing.
    wall_points : ndarray of int64, shape (n_walls,)
        Index of the point that may touch each wall.
    walls : ndarray of float64, shape (n_walls, 5)
        Parameters of `model.dynamics.condensed.wall_force`.
    max_steps : ndarray of float64, shape (n_walls,)
        Largest time step that resolves a bounce on each wall, s.
    """

    points: int
    supported: IntArray
    coefficients: ComplexArray
    wall_points: IntArray
    walls: FloatArray
    max_steps: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ModalSystem:
    """The model parameters as modal matrices, for the compiled integration.

    Parameters
    ----------
    shaft : ModalShaft
        Modes of the free shaft.
    films : Films, optional
        Films of each of the two equal bearings; None for a rotor on linear supports alone.
    rings : Rings
        Floating rings and rings of supports.
    constraints : Constraints, optional
        Supports and walls; None without any.
    stations : ndarray of float64, shape (n_stations, m)
        Mode shapes at all stations, kg^-1/2.
    eccentricities : ndarray of float64, shape (4, m + n_rings)
        Matrix from modal and ring coordinates to the eccentricity ratios of both inner, then both outer films; no rows
        without films.
    """

    shaft: ModalShaft
    films: Films | None
    rings: Rings
    constraints: Constraints | None
    stations: FloatArray
    eccentricities: FloatArray

    @classmethod
    def from_parameters(cls, parameters: ModelParameters, modes: int | None = None) -> "ModalSystem":
        """Return the system with the lowest free modes, from a cache of the last few.

        Without ``modes``, the number depends on whether supports or walls act on the shaft.
        """
        if modes is None:
            modes = MODES_WITH_CONSTRAINTS if parameters.supports or parameters.rubs else DEFAULT_MODES
        return _cached_system(parameters, min(modes, 2 * parameters.rotor.stations))

    @classmethod
    def build(cls, parameters: ModelParameters, modes: int) -> "ModalSystem":
        """Build the system without the cache; ParameterError if neither films nor supports hold the rotor."""
        rotor, bearing = parameters.rotor, parameters.bearing
        if bearing is None and not parameters.supports:
            raise ParameterError("bearing: none, expected a rotor on oil films or with [[support]]")
        films, rings = None if bearing is None else _films(bearing), _rings(parameters)
        free = free_modes(rotor, modes)
        shapes = free.shapes
        imbalance = np.zeros(modes, np.complex128)
        for one in parameters.imbalances:
            imbalance += one.magnitude * np.exp(1j * one.phase) * shapes[rotor.displacement(one.station)]
        weight = np.asarray(-1j * parameters.gravity * (rotor.translation @ rotor.mass_matrix() @ shapes))
        for load in parameters.loads:
            weight += complex(load.x, load.y) * shapes[rotor.displacement(load.station)]
        supported = {one.station for one in parameters.supports} | {one.station for one in parameters.rubs}
        journals = () if bearing is None else rotor.journal_stations
        points = [*journals, *sorted(supported.difference(journals))]
        positions = np.ascontiguousarray(shapes[[rotor.displacement(station) for station in points]])
        shaft = ModalShaft(
            squared_frequencies=free.frequencies**2,
            gyroscopic=np.ascontiguousarray(shapes.T @ rotor.gyroscopic_matrix() @ shapes),
            points=positions,
            probe=np.ascontiguousarray(shapes[rotor.displacement(parameters.probe_station)]),
            imbalance=imbalance,
            weight=weight,
            damping=2 * parameters.modal_damping * free.frequencies,
            bow=parameters.bow_forces() @ shapes,
        )
        return cls(
            shaft=shaft,
            films=films,
            rings=rings,
            constraints=_constraints(parameters, points, positions) if supported else None,
            stations=np.ascontiguousarray(shapes[::2]),
            eccentricities=_eccentricities(shaft, films, rings),
        )

    @property
    def parts(self) -> Parts:
        """Shaft, films and rings."""
        return Parts(self.shaft, self.films, self.rings, POSITION_TOLERANCE * self.clearance)

    @property
    def clearance(self) -> float:
        """Clearance of the inner films, m; a usual one without films."""
        return USUAL_CLEARANCE if self.films is None else self.films.inner_clearance

    @property
    def is_isotropic(self) -> bool:
        """Whether all supports are isotropic, so that the synchronous motion is a circle."""
        return self.constraints is None or not self.constraints.coefficients[:, 1::2].any()

    def is_inside_clearances(self, motion: ComplexArray) -> bool:
        """Return whether a motion, (3, m + n_rings), is inside the clearance of every film."""
        return bool(np.all(1 - np.abs(self.eccentricities @ motion[0]) ** 2 >= MIN_WALL_MARGIN))

    def at_rest(self, *, angle: float, speed: float) -> MotionState:
        """Return the state at rest in the bearing centre, with the shaft at this angle, rad, and speed, rad/s."""
        shaft, modes = self.shaft, self.shaft.squared_frequencies.size
        motion = np.zeros((3, modes + self.rings.mass.size), np.complex128)
        turned = np.exp(1j * angle) * (speed**2 * shaft.imbalance + shaft.bow)
        motion[2, :modes] = turned + shaft.weight  # films and supports exert no force there
        motion[2, modes:] = -1j * self.rings.gravity
        n = 2 * (shaft.points.shape[0] + self.rings.mass.size)
        return MotionState(
            motion=motion,
            inverse=np.zeros((n, n)),
            level=np.array([NO_LEVEL], np.int64),
            angle=np.array([angle]),
            speed=np.array([float(speed)]),
            acceleration=np.zeros(1),
        )

    def matrices(self, step: float) -> NewmarkMatrices:
        """Return Newmark's matrices for a time step, s, and its divisions by four."""
        steps = np.array([step / 4**level for level in range(N_LEVELS)])
        rates, shaft = 2 / steps[:, None], self.shaft
        # 4/h² + 2/h d + w² - i Omega 2/h G = D^(1/2) (1 - i Omega V g V^T) D^(1/2)
        scale = 1 / np.sqrt(rates**2 + rates * shaft.damping + shaft.squared_frequencies)
        g, V = np.linalg.eigh(scale[:, :, None] * shaft.gyroscopic * (rates * scale)[:, None, :])
        transforms = scale[:, :, None] * V
        return NewmarkMatrices(steps, transforms, g, np.ascontiguousarray(shaft.points @ transforms))


@lru_cache(maxsize=8)
def _cached_system(parameters: ModelParameters, modes: int) -> ModalSystem:
    return ModalSystem.build(parameters, modes)


def _films(bearing: FloatingRing) -> Films:
    ring, size = bearing.ring_speed_ratio, bearing.viscosity * bearing.length**3 / 4
    return Films(
        inner_factor=size * bearing.journal_radius / bearing.inner_clearance**2,
        outer_factor=size * bearing.ring_outer_radius / bearing.outer_clearance**2,
        inner_clearance=bearing.inner_clearance,
        outer_clearance=bearing.outer_clearance,
        inner_speed=1 + ring * bearing.ring_inner_radius / bearing.journal_radius,  # surface speeds of ring and journal
        outer_speed=ring,
        law=FORCE_LAWS[bearing.film_model],
    )


def _eccentricities(shaft: ModalShaft, films: Films | None, rings: Rings) -> FloatArray:
    modes = shaft.squared_frequencies.size
    if films is None:
        return np.zeros((0, modes + rings.mass.size))
    found = np.zeros((4, modes + rings.mass.size))
    found[:2, :modes] = shaft.journals / films.inner_clearance
    for bearing in range(2):
        found[bearing, modes + bearing] = -1 / films.inner_clearance
        found[2 + bearing, modes + bearing] = 1 / films.outer_clearance
    return found


def _rings(parameters: ModelParameters) -> Rings:
    bearing, gravity = parameters.bearing, parameters.gravity
    mass = [support.ring_mass for support in parameters.supports if support.outer is not None]
    down = [gravity] * len(mass)
    if bearing is not None:
        mass = [bearing.ring_mass] * 2 + mass
        down = [gravity + bearing.static_load / bearing.ring_mass] * 2 + down
    return Rings(mass=np.array(mass), gravity=np.array(down))


def _constraints(parameters: ModelParameters, points: list[int], shapes: FloatArray) -> Constraints:
    supported, ring = [], len(points) - 1 + (0 if parameters.bearing is None else 2)
    for support in parameters.supports:
        ring += support.outer is not None
        supported.append((points.index(support.station), -1 if support.outer is None else ring))
    coefficients = [_in_complex(one.inner) + _in_complex(one.outer) for one in parameters.supports]
    rubs = parameters.rubs
    wall_points = [points.index(rub.station) for rub in rubs]
    bounces = [
        math.sqrt(rub.stiffness * float(shapes[p] @ shapes[p])) for rub, p in zip(rubs, wall_points, strict=True)
    ]
    return Constraints(
        points=len(points),
        supported=np.array(supported, np.int64).reshape(-1, 2),
        coefficients=np.array(coefficients, np.complex128).reshape(-1, 8),
        wall_points=np.array(wall_points, np.int64),
        walls=np.array([rub.sizes for rub in rubs], np.float64).reshape(-1, 5),
        max_steps=np.array([MAX_BOUNCE_PHASE / bounce for bounce in bounces]),
    )


def _in_complex(coefficients: SupportCoefficients | None) -> list[complex]:
    """Return a, b, c, d of ``a z + b conj z + c z' + d conj z'``."""
    if coefficients is None:
        return [0j] * 4
    found = []
    for (xx, xy), (yx, yy) in (coefficients.stiffness, coefficients.damping):
        found += [complex(xx + yy, yx - xy) / 2, complex(xx - yy, yx + xy) / 2]
    return found
