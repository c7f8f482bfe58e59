"""Synchronous response to imbalance on the films, without weight, and its stability.

Without weight the synchronous motion is an equilibrium in the frame rotating with the shaft: a few complex unknowns
(two journals, two rings, other points with supports or walls) instead of an integration in time, and its stability is
an eigenvalue problem. Weight would shift the centre of the motion and make it elliptic; without it a shaft with little
imbalance looks less stable at low speed than it is. Anisotropic supports make the motion elliptic too: in that case it
is the periodic orbit of `model.dynamics.stability`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.signals import ComplexArray, FloatArray
from model.dynamics.modal_system import ModalSystem
from model.dynamics.motion import ShaftMotion
from model.dynamics.rotating_frame import disturbance, rotating_motion
from model.dynamics.stability import FilmName, SynchronousOrbit, Whirl, synchronous_orbit
from model.errors import NoSolutionError
from model.rotor.parameters import ModelParameters
from model.rotor.rotor import require_positive

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
    _ = parameters.floating_ring
    system = ModalSystem.from_parameters(parameters, modes)
    if not system.is_isotropic:
        return _elliptic(parameters, speed, None if start is None else start.orbit)
    rest = np.zeros(system.shaft.points.shape[0] + system.rings.mass.size, np.complex128)
    solution = _continued(system, rest if start is None else start.bodies, [(speed, 1.0)])
    if solution is None:
        solution = _continued(system, rest, [(speed, float(fraction)) for fraction in np.linspace(0.05, 1.0, 20)])
    if solution is None:
        solution = _continued(system, rest, [(float(lower), 1.0) for lower in np.geomspace(speed / 20, speed, 60)])
    if solution is None:
        raise NoSolutionError(f"synchronous motion at {speed:.1f} rad/s: none found within the clearances")
    positions, modal, matrix = solution
    circles = system.stations @ modal
    circle = complex(system.shaft.probe @ modal)
    return SynchronousResponse(
        speed=speed,
        vectors=_probe_vectors(parameters, circle, 0j),
        circle=circle,
        stations=np.stack((circles, -1j * circles)),
        bodies=positions,
        whirls=_whirls(matrix, system.eccentricities, speed),
    )


def _continued(
    system: ModalSystem, start: ComplexArray, steps: Sequence[tuple[float, float]]
) -> tuple[ComplexArray, ComplexArray, FloatArray] | None:
    """Solve for successive speeds and fractions of the excitation, each from the one before; None if one fails.

    Returns positions, modal displacements and first-order matrix of the last.
    """
    positions, parts = start.copy(), system.parts
    for speed, fraction in steps:
        is_solved, modal, matrix = rotating_motion(parts, system.constraints, speed, fraction, positions)
        if not is_solved:
            return None
    return positions, modal, matrix


def _whirls(matrix: FloatArray, eccentricities: FloatArray, speed: float) -> tuple[Whirl, ...]:
    """Return the least stable whirl of each film, the less stable first, from the first-order matrix.

    Only the few eigenvectors that are needed are computed, by inverse iteration: all would take as long as the rest.
    """
    values = np.linalg.eigvals(matrix)
    values = values[values.imag >= 0]  # one of each conjugate pair
    whirl_of_film: dict[FilmName, Whirl] = {}
    for value in values[np.argsort(-values.real, kind="stable")]:
        if len(whirl_of_film) == len(FilmName):
            break
        is_reverse, share = disturbance(matrix, complex(value), eccentricities)
        order = 1 + (-value.imag if is_reverse else value.imag) / speed
        whirl = Whirl(float(value.real), float(order), share)
        whirl_of_film.setdefault(whirl.film, whirl)
    return tuple(whirl_of_film.values())


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
