"""The motion that goes round with the imbalance, and whether it is stable.

Without weight the synchronous motion stands still in a frame that turns with the shaft: four complex unknowns (two
journals, two rings) instead of an integration in time, and its stability is an eigenvalue problem. Weight moves the
centre of the motion and makes it elliptic; it is left out here, so that a lightly shaken shaft at low speed looks less
stable than it is.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.errors import ModelError
from model.kernel import capone_force, film_stiffness
from model.parameters import ModelParameters
from model.rotor import require_positive
from model.system import MODES, Films, ModalSystem

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

ITERATIONS = 60
WALL = 0.9999  # largest eccentricity ratio


@dataclass(frozen=True, slots=True, eq=False)
class SynchronousResponse:
    """Synchronous motion at one speed.

    Parameters
    ----------
    speed : float
        rad/s.
    vectors : ndarray of complex128, shape (2,)
        1X at the probes x and y, m peak, x(t) = Re[X exp(i theta)].
    circle : complex
        Displacement at the probes' station at theta = 0, X + i Y, m: the motion is this circle.
    journals, rings : ndarray of complex128, shape (2,)
        The same of journals and rings, m.
    growth_rate : float
        Of the least stable whirl about this motion, 1/s; positive where it grows.
    whirl_order : float
        Frequency of that whirl over the shaft's; negative where it goes against the shaft.
    """

    speed: float
    vectors: ComplexArray
    circle: complex
    journals: ComplexArray
    rings: ComplexArray
    growth_rate: float
    whirl_order: float


def synchronous_response(
    parameters: ModelParameters, speed: float, start: SynchronousResponse | None = None, *, modes: int = MODES
) -> SynchronousResponse:
    """Return the synchronous motion at a speed and the growth of its least stable whirl.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor; its gravity is not used.
    speed : float
        rad/s, above 0.
    start : SynchronousResponse, optional
        Motion at a neighbouring speed, to follow one branch where there are several.
    modes : int
        Free modes of the rotor that are kept.

    Returns
    -------
    SynchronousResponse
        The motion that is reached from ``start``; without it, or where that fails, by raising the imbalance, or else
        the speed, step by step.

    Raises
    ------
    ModelError
        Where Newton's method finds no motion within the clearances.
    """
    require_positive("speed", speed, "rad/s")
    system = ModalSystem.of(parameters, modes)
    frame = _TurningFrame(system, speed)
    rest = np.zeros(4, np.complex128)
    found = frame.solve(rest if start is None else np.concatenate((start.journals, start.rings)), 1.0)
    if found is None:
        found = _follow(rest, ((frame, float(part)) for part in np.linspace(0.05, 1.0, 20)))
    if found is None:
        speeds = np.geomspace(speed / 20, speed, 60)
        found = _follow(rest, ((_TurningFrame(system, float(lower)), 1.0) for lower in speeds))
    if found is None:
        raise ModelError(f"synchronous motion at {speed:.1f} rad/s: none found within the clearances")
    circle = frame.probe(found)
    growth_rate, whirl_order = frame.least_stable(found)
    angles = np.asarray(parameters.probe_angles)
    return SynchronousResponse(
        speed=speed,
        vectors=circle * np.exp(-1j * angles),  # Re[z exp(-i alpha)] is the displacement along a probe at alpha
        circle=circle,
        journals=found[:2],
        rings=found[2:],
        growth_rate=growth_rate,
        whirl_order=whirl_order,
    )


def _follow(found: ComplexArray, steps: "Iterable[tuple[_TurningFrame, float]]") -> ComplexArray | None:
    """Solve for one frame and part of the imbalance after the other, each from the one before; None where one fails."""
    for frame, part in steps:
        following = frame.solve(found, part)
        if following is None:
            return None
        found = following
    return found


class _TurningFrame:
    """The equations of motion in the frame that turns with the shaft."""

    def __init__(self, system: ModalSystem, speed: float) -> None:
        self._shaft, self._films, self._speed = system.shaft, system.films, speed
        shaft = system.shaft
        # w² - Omega² + Omega² G, from M z'' - i Omega J z' + K z with z = Z exp(i Omega t)
        dynamic = np.diag(shaft.squares - speed**2) + speed**2 * shaft.gyroscopic
        self._compliance = np.linalg.inv(dynamic)
        self._receptance = shaft.journals @ self._compliance @ shaft.journals.T
        self._unloaded = shaft.journals @ self._compliance @ (speed**2 * shaft.imbalance)

    def _bearings(self, unknowns: ComplexArray) -> list[tuple[complex, complex]]:
        return [(complex(unknowns[b] - unknowns[2 + b]), complex(unknowns[2 + b])) for b in range(2)]

    def _forces(self, unknowns: ComplexArray) -> ComplexArray:
        films, spin = self._films, 1j * self._speed
        forces = np.empty((2, 2), np.complex128)
        for b, (inner, outer) in enumerate(self._bearings(unknowns)):
            forces[0, b] = capone_force(inner, spin * inner, *_inner(films, self._speed))
            forces[1, b] = capone_force(outer, spin * outer, *_outer(films, self._speed))
        return forces

    def _slopes(self, unknowns: ComplexArray, drag: complex) -> tuple[list[FloatArray], list[FloatArray]]:
        films, spin = self._films, 1j * self._speed
        inner_slopes, outer_slopes = [], []
        for inner, outer in self._bearings(unknowns):
            inner_slopes.append(_matrix(film_stiffness(inner, spin * inner, drag, *_inner(films, self._speed))))
            outer_slopes.append(_matrix(film_stiffness(outer, spin * outer, drag, *_outer(films, self._speed))))
        return inner_slopes, outer_slopes

    def _residual(self, unknowns: ComplexArray, part: float) -> ComplexArray:
        forces = self._forces(unknowns)
        ring_factor = -1 / (self._films.ring_mass * self._speed**2)
        of_journals = unknowns[:2] - part * self._unloaded - self._receptance @ forces[0]
        of_rings = unknowns[2:] - ring_factor * (forces[1] - forces[0])
        return np.concatenate((of_journals, of_rings))

    def _jacobian(self, unknowns: ComplexArray) -> FloatArray:
        inner, outer = self._slopes(unknowns, 1j * self._speed)
        ring_factor = -1 / (self._films.ring_mass * self._speed**2)
        matrix = np.eye(8)
        for c in range(2):
            own, ring = slice(2 * c, 2 * c + 2), slice(4 + 2 * c, 6 + 2 * c)
            for b in range(2):
                through = _turn(complex(self._receptance[b, c])) @ inner[c]
                matrix[2 * b : 2 * b + 2, own] -= through
                matrix[2 * b : 2 * b + 2, ring] += through
            matrix[ring, own] += ring_factor * inner[c]
            matrix[ring, ring] -= ring_factor * (inner[c] + outer[c])
        return matrix

    def solve(self, unknowns: ComplexArray, part: float) -> ComplexArray | None:
        """Return journals and rings, (4,), for a part of the imbalance; None where Newton's method fails."""
        if self._eccentricity(unknowns) >= WALL:
            unknowns = np.zeros(4, np.complex128)
        residual = self._residual(unknowns, part)
        for _ in range(ITERATIONS):
            if np.max(np.abs(residual)) < 1e-10 * self._films.inner_clearance:
                return unknowns
            change = np.linalg.solve(self._jacobian(unknowns), -_real(residual)).view(np.complex128)
            fraction = 1.0
            while fraction > 1e-6:
                trial = unknowns + fraction * change
                if self._eccentricity(trial) < WALL:
                    following = self._residual(trial, part)
                    if np.linalg.norm(following) < np.linalg.norm(residual):
                        break
                fraction /= 2
            else:
                return None
            unknowns, residual = trial, following
        return None

    def _eccentricity(self, unknowns: ComplexArray) -> float:
        films = self._films
        return max(
            max(abs(inner) / films.inner_clearance, abs(outer) / films.outer_clearance)
            for inner, outer in self._bearings(unknowns)
        )

    def probe(self, unknowns: ComplexArray) -> complex:
        """Return the displacement at the probes' station, m."""
        shaft = self._shaft
        pushed = self._speed**2 * shaft.imbalance + shaft.journals.T @ self._forces(unknowns)[0]
        return complex(shaft.probe @ self._compliance @ pushed)

    def least_stable(self, unknowns: ComplexArray) -> tuple[float, float]:
        """Return growth rate, 1/s, and order of the whirl about this motion that grows fastest."""
        shaft, films, speed = self._shaft, self._films, self._speed
        modes = shaft.squares.size
        size = modes + 2  # complex coordinates: modes, rings
        inner_k, outer_k = self._slopes(unknowns, 1j * speed)
        inner_v, outer_v = self._slopes(unknowns, (1 + 1j) * speed)
        inner_c = [(v - k) / speed for v, k in zip(inner_v, inner_k, strict=True)]
        outer_c = [(v - k) / speed for v, k in zip(outer_v, outer_k, strict=True)]
        # q'' + i Omega (2 - G) q' + (w² - Omega² + Omega² G) q = forces ; rings: 1/m
        damping = np.zeros((size, size), np.complex128)
        stiffness = np.zeros((size, size), np.complex128)
        damping[:modes, :modes] = 1j * speed * (2 * np.eye(modes) - shaft.gyroscopic)
        stiffness[:modes, :modes] = np.diag(shaft.squares - speed**2) + speed**2 * shaft.gyroscopic
        for b in range(2):
            damping[modes + b, modes + b] = 2j * speed
            stiffness[modes + b, modes + b] = -(speed**2)
        damping_real, stiffness_real = _expand(damping), _expand(stiffness)
        for b in range(2):
            seen = np.zeros(size)  # journal minus ring
            seen[:modes], seen[modes + b] = shaft.journals[b], -1
            pushed = np.zeros(size)
            pushed[:modes], pushed[modes + b] = shaft.journals[b], -1 / films.ring_mass
            ring = np.zeros(size)
            ring[modes + b] = 1
            through_inner, through_outer = np.outer(pushed, seen), np.outer(ring, ring) / films.ring_mass
            stiffness_real -= _kron(through_inner, inner_k[b]) + _kron(through_outer, outer_k[b])
            damping_real -= _kron(through_inner, inner_c[b]) + _kron(through_outer, outer_c[b])
        n = 2 * size
        first_order = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness_real, -damping_real]])
        values, vectors = np.linalg.eig(first_order)
        worst = int(np.argmax(values.real))
        places = vectors[:n, worst].reshape(size, 2)
        forward = np.linalg.norm(places[:, 0] + 1j * places[:, 1])  # part that turns with +Im
        backward = np.linalg.norm(places[:, 0] - 1j * places[:, 1])
        turning = values[worst].imag if forward >= backward else -values[worst].imag
        return float(values[worst].real), float(1 + turning / speed)


def _inner(films: Films, speed: float) -> tuple[float, float, float]:
    return films.inner_clearance, films.inner_speed * speed, films.inner_factor


def _outer(films: Films, speed: float) -> tuple[float, float, float]:
    return films.outer_clearance, films.outer_speed * speed, films.outer_factor


def _real(vector: ComplexArray) -> FloatArray:
    return np.ascontiguousarray(vector).view(np.float64)


def _turn(factor: complex) -> FloatArray:
    return np.array([[factor.real, -factor.imag], [factor.imag, factor.real]])


def _expand(matrix: ComplexArray) -> FloatArray:
    """Write a complex matrix as a real one on (Re, Im) pairs."""
    turned = np.array([[0.0, -1.0], [1.0, 0.0]])
    return _kron(matrix.real, np.eye(2)) + _kron(matrix.imag, turned)


def _kron(matrix: FloatArray, pair: FloatArray) -> FloatArray:
    """Return Kronecker's product with a 2 by 2 matrix, much faster than NumPy's for any two."""
    size = matrix.shape[0]
    return np.asarray((matrix[:, None, :, None] * pair[None, :, None, :]).reshape(2 * size, 2 * size), np.float64)


def _matrix(slopes: tuple[complex, complex]) -> FloatArray:
    of_x, of_y = slopes
    return np.array([[of_x.real, of_y.real], [of_x.imag, of_y.imag]])
