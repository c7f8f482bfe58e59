"""Synchronous response to imbalance on the films, without weight, and its stability.

Without weight the synchronous motion is an equilibrium in the frame rotating with the shaft: a few complex unknowns
(two journals, two rings, other points with supports or walls) instead of an integration in time, and its stability is
an eigenvalue problem. Weight would shift the centre of the motion and make it elliptic; without it a shaft with little
imbalance looks less stable at low speed than it is. Anisotropic supports make the motion elliptic too: in that case it
is the periodic orbit of `model.dynamics.stability`.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from analysis.signals import ComplexArray, FloatArray
from model.dynamics.condensed import bearing_force_derivatives, bearing_forces
from model.dynamics.modal_system import ModalSystem
from model.dynamics.motion import ShaftMotion
from model.dynamics.stability import FilmName, SynchronousOrbit, Whirl, inner_shares, synchronous_orbit
from model.errors import NoSolutionError
from model.rotor.parameters import ModelParameters
from model.rotor.rotor import require_positive

MAX_ITERATIONS = 60
MAX_ECCENTRICITY = 0.9999  # eccentricity ratio accepted in Newton's method
ELLIPTIC_STEPS = 256  # time steps per turn of an elliptic motion: 1X within 0.02 %


@dataclass(frozen=True, slots=True, eq=False)
class SynchronousResponse:
    """Synchronous response at one speed.

    Parameters
    ----------
    speed : float
        rad/s.
    vectors : ndarray of complex128, shape (2,)
        1X at the probes x and y, m peak, x(t) = Re[X exp(i theta)].
    circle : complex
        Displacement at the station of the probes at theta = 0, X + i Y, m: the radius vector of the circular motion, or
        the forward component of an elliptic motion.
    stations : ndarray of complex128, shape (2, n_stations)
        1X at every station in X and Y, m peak.
    bodies : ndarray of complex128, shape (n_bodies,)
        Circles of the two journals, other points where forces act, and rings, m; empty for an elliptic motion.
    whirls : tuple of Whirl
        Least stable whirl of each film about this motion, the less stable first.
    orbit : SynchronousOrbit, optional
        The periodic orbit, if the motion is elliptic.
    """

    speed: float
    vectors: ComplexArray
    circle: complex
    stations: ComplexArray
    bodies: ComplexArray
    whirls: tuple[Whirl, ...]
    orbit: SynchronousOrbit | None = None

    @property
    def growth_rate(self) -> float:
        """Growth rate of the least stable whirl, 1/s; positive if the motion is unstable."""
        return self.whirls[0].growth_rate

    @property
    def whirl_order(self) -> float:
        """Order of the least stable whirl, frequency over shaft speed; negative for reverse whirl."""
        return self.whirls[0].order

    @property
    def journals(self) -> ComplexArray:
        """Circles of the two journals, (2,), m."""
        return self.bodies[:2]


def synchronous_response(
    parameters: ModelParameters, speed: float, start: SynchronousResponse | None = None, *, modes: int | None = None
) -> SynchronousResponse:
    """Return the synchronous response at a speed and its least stable whirls.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor; its weight and other constant loads are ignored.
    speed : float
        rad/s, above 0.
    start : SynchronousResponse, optional
        Response at a neighbouring speed, to follow one branch of several.
    modes : int, optional
        Number of free modes of the rotor.

    Returns
    -------
    SynchronousResponse
        The motion reached from ``start``. Without it, or if that fails, continuation in the imbalance, then in the
        speed.

    Raises
    ------
    NoSolutionError
        If Newton's method finds no motion within the clearances.
    """
    require_positive("speed", speed, "rad/s")
    system = ModalSystem.from_parameters(parameters, modes)
    if not system.is_isotropic:
        return _elliptic(parameters, speed, None if start is None else start.orbit)
    frame = _RotatingFrame(system, speed)
    rest = np.zeros(frame.bodies, np.complex128)
    found = frame.solve(rest if start is None else start.bodies, 1.0)
    if found is None:
        found = _continuation(
            rest, ((frame, float(imbalance_fraction)) for imbalance_fraction in np.linspace(0.05, 1.0, 20))
        )
    if found is None:
        speeds = np.geomspace(speed / 20, speed, 60)
        found = _continuation(rest, ((_RotatingFrame(system, float(lower)), 1.0) for lower in speeds))
    if found is None:
        raise NoSolutionError(f"synchronous motion at {speed:.1f} rad/s: none found within the clearances")
    modal = frame.modal(found)
    circles = system.stations @ modal
    circle = complex(system.shaft.probe @ modal)
    return SynchronousResponse(
        speed=speed,
        vectors=_probe_vectors(parameters, circle, 0j),
        circle=circle,
        stations=np.stack((circles, -1j * circles)),
        bodies=found,
        whirls=frame.whirls(found),
    )


def _probe_vectors(parameters: ModelParameters, forward: complex, reverse: complex) -> ComplexArray:
    """Return 1X at the probes of ``forward exp(i theta) + reverse exp(-i theta)``, (2,)."""
    towards = np.exp(-1j * np.asarray(parameters.probe_angles))  # Re[z exp(-i alpha)] is along a probe at alpha
    return np.asarray(forward * towards + np.conj(reverse * towards))


def _elliptic(parameters: ModelParameters, speed: float, start: SynchronousOrbit | None) -> SynchronousResponse:
    """Return an elliptic synchronous response from the periodic orbit without weight."""
    bearing = replace(parameters.floating_ring, static_load=0.0)
    unloaded = replace(parameters, bearing=bearing, gravity=0.0, loads=())
    orbit = synchronous_orbit(unloaded, speed, start, steps=ELLIPTIC_STEPS)
    motion = ShaftMotion(unloaded, speed, 0)
    motion.set_initial_state(orbit.initial_state)
    turn = motion.integrate_stations(1, ELLIPTIC_STEPS)
    back = np.exp(-2j * np.pi * np.arange(ELLIPTIC_STEPS) / ELLIPTIC_STEPS)
    path = turn[:, 0] + 1j * turn[:, 1]
    forward, reverse = (path * back).mean(axis=1), (path * back.conj()).mean(axis=1)
    of_probes = parameters.probe_station - 1
    return SynchronousResponse(
        speed=speed,
        vectors=_probe_vectors(parameters, complex(forward[of_probes]), complex(reverse[of_probes])),
        circle=complex(forward[of_probes]),
        stations=2 * (turn * back).mean(axis=2).T,
        bodies=np.empty(0, np.complex128),
        whirls=orbit.whirls,
        orbit=orbit,
    )


def _continuation(found: ComplexArray, steps: "Iterable[tuple[_RotatingFrame, float]]") -> ComplexArray | None:
    """Solve a sequence of frames and fractions of the imbalance, each from the previous; None if one fails."""
    for frame, imbalance_fraction in steps:
        following = frame.solve(found, imbalance_fraction)
        if following is None:
            return None
        found = following
    return found


class _RotatingFrame:
    """Equations of motion in the frame rotating with the shaft; bodies are points of the shaft, then rings."""

    def __init__(self, system: ModalSystem, speed: float) -> None:
        self._system, self._speed = system, speed
        shaft, mass = system.shaft, system.rings.mass
        self._points, self.bodies = shaft.points.shape[0], shaft.points.shape[0] + mass.size
        # w² - Omega² + Omega² G, from M z'' - i Omega J z' + K z with z = Z exp(i Omega t)
        dynamic = np.diag(shaft.squared_frequencies - speed**2) + speed**2 * shaft.gyroscopic
        self._compliance = np.linalg.inv(dynamic)
        n = self._points
        self._receptance = np.zeros((self.bodies, self.bodies))
        self._receptance[:n, :n] = shaft.points @ self._compliance @ shaft.points.T
        self._receptance[n:, n:] = np.diag(-1 / (mass * speed**2))
        self._unloaded = np.zeros(self.bodies, np.complex128)
        self._unloaded[:n] = shaft.points @ self._compliance @ (speed**2 * shaft.imbalance)

    def _state(self, positions: ComplexArray) -> ComplexArray:
        return np.stack((positions, 1j * self._speed * positions))

    def _forces(self, positions: ComplexArray) -> ComplexArray:
        system = self._system
        return bearing_forces(system.films, system.constraints, self._speed, self._state(positions))

    def _force_derivatives(self, positions: ComplexArray, velocity_ratio: complex) -> FloatArray:
        """Return the derivatives of the forces by position, (2 bodies, 2 bodies), X and Y alternately."""
        system, size = self._system, self.bodies
        derivatives = bearing_force_derivatives(
            system.films, system.constraints, self._speed, velocity_ratio, self._state(positions)
        )
        pairs = np.stack((derivatives.real, derivatives.imag), axis=1)  # body, its X or Y, other body, its X or Y
        return np.asarray(pairs.reshape(2 * size, 2 * size))

    def _residual(self, positions: ComplexArray, imbalance_fraction: float) -> ComplexArray:
        return np.asarray(positions - imbalance_fraction * self._unloaded - self._receptance @ self._forces(positions))

    def _jacobian(self, positions: ComplexArray) -> FloatArray:
        through = _kron(self._receptance, np.eye(2)) @ self._force_derivatives(positions, 1j * self._speed)
        return np.asarray(np.eye(2 * self.bodies) - through)

    def solve(self, positions: ComplexArray, imbalance_fraction: float) -> ComplexArray | None:
        """Return the positions, (n_bodies,), for a fraction of the imbalance; None if Newton's method fails."""
        if self._eccentricity(positions) >= MAX_ECCENTRICITY:
            positions = np.zeros(self.bodies, np.complex128)
        residual = self._residual(positions, imbalance_fraction)
        for _ in range(MAX_ITERATIONS):
            if np.max(np.abs(residual)) < 1e-10 * self._system.films.inner_clearance:
                return positions
            change = np.linalg.solve(self._jacobian(positions), -_real(residual)).view(np.complex128)
            fraction = 1.0
            while fraction > 1e-6:
                trial = positions + fraction * change
                if self._eccentricity(trial) < MAX_ECCENTRICITY:
                    following = self._residual(trial, imbalance_fraction)
                    if np.linalg.norm(following) < np.linalg.norm(residual):
                        break
                fraction /= 2
            else:
                return None
            positions, residual = trial, following
        return None

    def _eccentricity(self, positions: ComplexArray) -> float:
        films, journals, rings = self._system.films, positions[:2], positions[self._points : self._points + 2]
        inner, outer = np.abs(journals - rings) / films.inner_clearance, np.abs(rings) / films.outer_clearance
        return float(max(inner.max(), outer.max()))

    def modal(self, positions: ComplexArray) -> ComplexArray:
        """Return the modal displacements, (m,)."""
        shaft, forces = self._system.shaft, self._forces(positions)[: self._points]
        return np.asarray(self._compliance @ (self._speed**2 * shaft.imbalance + shaft.points.T @ forces))

    def whirls(self, positions: ComplexArray) -> tuple[Whirl, ...]:
        """Return the least stable whirl of each film about this motion, the less stable first."""
        shaft, mass, speed = self._system.shaft, self._system.rings.mass, self._speed
        modes, n = shaft.squared_frequencies.size, self._points
        size = modes + mass.size  # complex coordinates: modes, rings
        # q'' + i Omega (2 - G) q' + (w² - Omega² + Omega² G) q = forces ; rings: 1/m
        damping = 2j * speed * np.eye(size, dtype=np.complex128)
        damping[:modes, :modes] -= 1j * speed * shaft.gyroscopic
        stiffness = -(speed**2) * np.eye(size, dtype=np.complex128)
        stiffness[:modes, :modes] += np.diag(shaft.squared_frequencies) + speed**2 * shaft.gyroscopic
        observation, input_matrix = np.zeros((self.bodies, size)), np.zeros((size, self.bodies))
        observation[:n, :modes], observation[n:, modes:] = shaft.points, np.eye(mass.size)
        input_matrix[:modes, :n], input_matrix[modes:, n:] = shaft.points.T, np.diag(1 / mass)
        observation, input_matrix = _kron(observation, np.eye(2)), _kron(input_matrix, np.eye(2))
        still, moving = (
            self._force_derivatives(positions, 1j * speed),
            self._force_derivatives(positions, (1 + 1j) * speed),
        )
        stiffness_real = _expand(stiffness) - input_matrix @ still @ observation
        damping_real = _expand(damping) - input_matrix @ ((moving - still) / speed) @ observation
        n = 2 * size
        first_order = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness_real, -damping_real]])
        values, vectors = np.linalg.eig(first_order)
        films = np.tensordot(self._system.eccentricities, vectors[:n].reshape(size, 2, n * 2), 1)
        circles = np.stack((films[:, 0] + 1j * films[:, 1], films[:, 0] - 1j * films[:, 1]))  # with +Im, and against
        reverse = np.argmax(np.linalg.norm(circles, axis=1), axis=0)
        shares = inner_shares(np.take_along_axis(circles, reverse[None, None], axis=0)[0])
        orders = 1 + np.where(reverse == 0, values.imag, -values.imag) / speed
        found: dict[FilmName, Whirl] = {}
        for index in np.argsort(-values.real, kind="stable"):
            if len(found) == len(FilmName):
                break
            whirl = Whirl(float(values[index].real), float(orders[index]), float(shares[index]))
            found.setdefault(whirl.film, whirl)
        return tuple(found.values())


def _real(vector: ComplexArray) -> FloatArray:
    return np.ascontiguousarray(vector).view(np.float64)


def _expand(matrix: ComplexArray) -> FloatArray:
    """Return a complex matrix as a real one acting on (Re, Im) pairs."""
    turned = np.array([[0.0, -1.0], [1.0, 0.0]])
    return _kron(matrix.real, np.eye(2)) + _kron(matrix.imag, turned)


def _kron(matrix: FloatArray, pair: FloatArray) -> FloatArray:
    """Return the Kronecker product with a 2 by 2 matrix, much faster than `numpy.kron`."""
    rows, columns = matrix.shape
    return np.asarray((matrix[:, None, :, None] * pair[None, :, None, :]).reshape(2 * rows, 2 * columns), np.float64)
