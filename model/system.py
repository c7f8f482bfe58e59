"""What the integration in time needs of the parameters: modes of the shaft, films, matrices of the time step."""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.modes import free_modes
from model.parameters import ModelParameters

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

MODES = 6  # two rigid, four bending: within 0.05 % of all twelve
N_LEVELS = 6  # how often a time step may be divided by four
NO_LEVEL = -1


class Films(NamedTuple):
    """The films of one floating-ring bearing.

    Parameters
    ----------
    inner_factor, outer_factor : float
        mu R L³ / (4 C²) of each film, N s: its force at unit surface speed is of this size.
    inner_clearance, outer_clearance : float
        Radial clearances, m.
    inner_speed, outer_speed : float
        Sum of the speeds of a film's two surfaces over the shaft's speed.
    ring_mass : float
        kg.
    gravity : float
        Force on a ring towards -Y over its mass, of its weight and the oil feed, m/s².
    """

    inner_factor: float
    outer_factor: float
    inner_clearance: float
    outer_clearance: float
    inner_speed: float
    outer_speed: float
    ring_mass: float
    gravity: float


class Shaft(NamedTuple):
    """The shaft's modes as the march needs them.

    Parameters
    ----------
    squares : ndarray of float64, shape (m,)
        Squared natural frequencies, rad²/s².
    gyroscopic : ndarray of float64, shape (m, m)
        Modal polar inertia.
    journals : ndarray of float64, shape (2, m)
        Mode shapes at the journals, kg^-1/2.
    probe : ndarray of float64, shape (m,)
        Mode shapes at the probes' station.
    imbalance : ndarray of complex128, shape (m,)
        Modal imbalance at theta = 0, kg m times shape.
    weight : ndarray of complex128, shape (m,)
        Modal weight and other loads at rest.
    """

    squares: FloatArray
    gyroscopic: FloatArray
    journals: FloatArray
    probe: FloatArray
    imbalance: ComplexArray
    weight: ComplexArray


class Levels(NamedTuple):
    """Newmark's matrix for a time step and its fourths: ``T diag(1 / (1 - i Omega g)) T^T`` is its inverse.

    Parameters
    ----------
    steps : ndarray of float64, shape (n_levels,)
        Time steps, s, each a fourth of the one before.
    transforms : ndarray of float64, shape (n_levels, m, m)
        T.
    gyroscopic : ndarray of float64, shape (n_levels, m)
        g, s.
    journals : ndarray of float64, shape (n_levels, 2, m)
        The journals' mode shapes times T.
    """

    steps: FloatArray
    transforms: FloatArray
    gyroscopic: FloatArray
    journals: FloatArray


class State(NamedTuple):
    """All that the motion carries from step to step; changed in place.

    Parameters
    ----------
    modal : ndarray of complex128, shape (3, m)
        Modal displacements, velocities and accelerations.
    rings : ndarray of complex128, shape (3, 2)
        The rings' displacements, velocities and accelerations, m, m/s, m/s².
    augmented : ndarray of float64, shape (8, 16)
        The inverse of Newton's matrix in the right half, kept as long as it serves.
    level : ndarray of int64, shape (1,)
        Level that it belongs to; ``NO_LEVEL`` for none.
    angle, speed : ndarray of float64, shape (1,)
        Of the shaft, rad and rad/s.
    """

    modal: ComplexArray
    rings: ComplexArray
    augmented: FloatArray
    level: NDArray[np.int64]
    angle: FloatArray
    speed: FloatArray


class Work(NamedTuple):
    """Room for the unknowns of a step, made once a march.

    Parameters
    ----------
    journals, rings : ndarray of complex128, shape (2, 2)
        Positions, m, and velocities, m/s, by bearing, as Newton's method moves them.
    start_journals, start_rings : ndarray of complex128, shape (2, 2)
        The same where the step starts.
    free : ndarray of complex128, shape (2, 2)
        Where journals and rings would come to without film forces, m.
    receptance : ndarray of complex128, shape (2, 2)
        Displacement of journal b for a force on journal c, m/N.
    forces : ndarray of complex128, shape (2, 2)
        Of the inner and the outer films by bearing, N.
    residual, change : ndarray of float64, shape (8,)
        What the equations miss and Newton's answer, m: journals, then rings, X and Y alternately.
    modal : ndarray of complex128, shape (3, m)
        Forces, diagonal coordinates, compliances.
    kept_modal, kept_rings : ndarray of complex128, shapes (3, m) and (3, 2)
        The state at the start of the step.
    """

    journals: ComplexArray
    rings: ComplexArray
    start_journals: ComplexArray
    start_rings: ComplexArray
    free: ComplexArray
    receptance: ComplexArray
    forces: ComplexArray
    residual: FloatArray
    change: FloatArray
    modal: ComplexArray
    kept_modal: ComplexArray
    kept_rings: ComplexArray


@dataclass(frozen=True, slots=True, eq=False)
class ModalSystem:
    """The parameters as the compiled kernel takes them.

    Parameters
    ----------
    shaft : Shaft
        Modes.
    films : Films
        Bearings.
    """

    shaft: Shaft
    films: Films

    @classmethod
    def of(cls, parameters: ModelParameters, modes: int = MODES) -> "ModalSystem":
        """Reduce the parameters to the lowest ``modes`` free modes; the last few are kept for those that ask again."""
        return _reduced(parameters, modes)

    @classmethod
    def reduced(cls, parameters: ModelParameters, modes: int) -> "ModalSystem":
        """Reduce the parameters anew."""
        rotor, bearing = parameters.rotor, parameters.bearing
        modes = min(modes, 2 * rotor.stations)
        free = free_modes(rotor, modes)
        shapes = free.shapes
        imbalance = np.zeros(modes, np.complex128)
        for one in parameters.imbalances:
            imbalance += one.magnitude * np.exp(1j * one.phase) * shapes[rotor.displacement(one.station)]
        weight = np.asarray(-1j * parameters.gravity * (rotor.translation @ rotor.mass_matrix() @ shapes))
        for load in parameters.loads:
            weight += complex(load.x, load.y) * shapes[rotor.displacement(load.station)]
        shaft = Shaft(
            squares=free.frequencies**2,
            gyroscopic=np.ascontiguousarray(shapes.T @ rotor.gyroscopic_matrix() @ shapes),
            journals=np.ascontiguousarray(shapes[list(rotor.journals)]),
            probe=np.ascontiguousarray(shapes[rotor.displacement(parameters.probe_station)]),
            imbalance=imbalance,
            weight=weight,
        )
        ring, size = bearing.ring_speed_ratio, bearing.viscosity * bearing.length**3 / 4
        films = Films(
            inner_factor=size * bearing.journal_radius / bearing.inner_clearance**2,
            outer_factor=size * bearing.ring_outer_radius / bearing.outer_clearance**2,
            inner_clearance=bearing.inner_clearance,
            outer_clearance=bearing.outer_clearance,
            inner_speed=1 + ring * bearing.ring_inner_radius / bearing.journal_radius,  # surfaces of ring and journal
            outer_speed=ring,
            ring_mass=bearing.ring_mass,
            gravity=parameters.gravity + bearing.static_load / bearing.ring_mass,
        )
        return cls(shaft, films)

    def at_rest(self, *, angle: float, speed: float) -> State:
        """Return a motion at rest in the bearings' centre, the shaft at this angle, rad, and speed, rad/s."""
        shaft = self.shaft
        modal, rings = np.zeros((3, shaft.squares.size), np.complex128), np.zeros((3, 2), np.complex128)
        modal[2] = speed**2 * np.exp(1j * angle) * shaft.imbalance + shaft.weight  # no film force there yet
        rings[2] = -1j * self.films.gravity
        return State(
            modal=modal,
            rings=rings,
            augmented=np.zeros((8, 16)),
            level=np.array([NO_LEVEL], np.int64),
            angle=np.array([angle]),
            speed=np.array([float(speed)]),
        )

    def levels(self, step: float) -> Levels:
        """Return Newmark's matrices for a time step, s, and its fourths."""
        steps = np.array([step / 4**level for level in range(N_LEVELS)])
        transforms, gyroscopic = [], []
        for h in steps:
            # 4/h² + w² - i Omega 2/h G = D^(1/2) (1 - i Omega V g V^T) D^(1/2)
            scale = 1 / np.sqrt(4 / h**2 + self.shaft.squares)
            g, V = np.linalg.eigh(scale[:, None] * self.shaft.gyroscopic * scale * (2 / h))
            transforms.append(scale[:, None] * V)
            gyroscopic.append(g)
        stacked = np.stack(transforms)
        journals = np.ascontiguousarray(self.shaft.journals @ stacked)
        return Levels(steps, stacked, np.stack(gyroscopic), journals)


@lru_cache(maxsize=8)
def _reduced(parameters: ModelParameters, modes: int) -> ModalSystem:
    return ModalSystem.reduced(parameters, modes)


def stand(state: State, standing: FloatArray) -> None:
    """Put a motion where ``standing`` says, (4 (m + 2),): see `model.stability`."""
    modes = state.modal.shape[1]
    place, rate = standing.view(np.complex128).reshape(2, -1)
    for kept, part in ((state.modal, slice(0, modes)), (state.rings, slice(modes, None))):
        kept[0], kept[1], kept[2] = place[part], state.speed[0] * rate[part], 0.0
    state.level[0] = NO_LEVEL
