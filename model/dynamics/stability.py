"""Stability of the synchronous motion under imbalance and weight: periodic orbit, Floquet multipliers, oil whirl.

Newmark's step depends on displacement q, velocity v and acceleration a only through ``4/h² q + 4/h v + a`` and
``2/h q + v``, so two numbers per coordinate define the state. They are expressed as a displacement and a velocity over
speed, without acceleration. The Poincaré map over one turn in these coordinates (32 numbers for six modes and two
rings) is differentiated, and Newton's method finds its fixed point, stable or not.

A whirl is assigned to the film whose surfaces move more relative to each other, in units of the film clearance: the
journal in the ring (inner film) or the ring in the housing (outer film). The work done by the films is no criterion: at
the onset of outer-film whirl the inner film feeds the whirl, because the whirl frequency is just half the sum of the
surface speeds of the outer film.
"""

import cmath
import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from analysis.signals import ComplexArray, FloatArray
from model.dynamics.modal_system import ModalSystem
from model.dynamics.motion import STEPS_PER_TURN
from model.dynamics.newmark import NO_FAILURE, Tangent, integrate
from model.errors import NoSolutionError
from model.rotor.parameters import ModelParameters
from model.rotor.rotor import require_positive

SETTLING_TURNS = 60  # from rest, before Newton's method
MAX_ITERATIONS = 40
TOLERANCE = 1e-5  # of the inner clearance: error of the fixed point
MAX_ORDER = 0.25  # of the steps per turn: higher orders are bending modes that the steps do not resolve
MIN_MULTIPLIER = 1e-6  # smaller Floquet multipliers are numerical noise


class FilmName(StrEnum):
    """The two films in series."""

    INNER = "inner"  # journal in ring
    OUTER = "outer"  # ring in housing


@dataclass(frozen=True, slots=True)
class Whirl:
    """A whirl disturbance of the synchronous motion.

    Parameters
    ----------
    growth_rate : float
        1/s; positive if it grows.
    order : float
        Frequency over shaft speed; negative for reverse whirl.
    inner_share : float
        Share of the inner films in the motion of all films, in units of their clearances, 0 to 1.
    """

    growth_rate: float
    order: float
    inner_share: float

    @property
    def film(self) -> FilmName:
        """The film with the larger share of the whirl."""
        return dominant_film(self.inner_share)


def dominant_film(share: float) -> FilmName:
    """Return the film with the larger share of a whirl, given the share of the inner film."""
    return FilmName.INNER if share > 0.5 else FilmName.OUTER


def inner_shares(eccentricities: NDArray[np.generic]) -> FloatArray:
    """Return the share of the inner films, (...), of eccentricity ratios, (4, ...), inner films first."""
    inner, outer = (np.linalg.norm(films, axis=0) for films in (eccentricities[:2], eccentricities[2:]))
    both = inner + outer
    return np.asarray(np.divide(inner, both, out=np.full_like(both, 0.5), where=both > 0))


def order_and_share(eccentricities: ComplexArray, exponent: complex) -> tuple[float, float]:
    """Return order and inner share of a disturbance from its time history over a turn.

    Parameters
    ----------
    eccentricities : ndarray of complex128, shape (4, 2, n)
        Eccentricity ratios of the films, inner films first, in X and Y at the ends of n equal steps; the disturbance is
        the real part.
    exponent : complex
        Floquet exponent per radian of shaft angle, exp(exponent theta); its imaginary part is known up to an
        integer.

    Returns
    -------
    order : float
        Order of the largest circular component of the disturbance; negative for reverse whirl.
    inner_share : float
        Inner share of that component.
    """
    n = eccentricities.shape[-1]
    theta = 2 * math.pi * np.arange(1, n + 1) / n
    x, y = eccentricities[:, 0], eccentricities[:, 1]
    # Re[X] + i Re[Y] consists of a forward circle (X + i Y)/2 and a reverse circle (X - i Y)/2
    circles = np.fft.fft(np.stack((x + 1j * y, x - 1j * y)) * np.exp(-exponent * theta), axis=-1)
    direction, line = np.unravel_index(int(np.argmax(np.linalg.norm(circles, axis=1))), (2, n))
    order = exponent.imag + float(np.fft.fftfreq(n, 1 / n)[line])
    return (order if direction == 0 else -order), float(inner_shares(circles[direction, :, line]))


@dataclass(frozen=True, slots=True, eq=False)
class SynchronousOrbit:
    """Periodic synchronous motion, stable or unstable.

    Parameters
    ----------
    speed : float
        rad/s.
    initial_state : ndarray of float64, shape (4 (n_modes + n_rings),)
        State at theta = 0 in the coordinates above; a start for neighbouring speeds.
    whirls : tuple of Whirl
        Least stable whirl of each film, the less stable first.
    disturbances : ndarray of float64, shape (n_whirls, 4 (n_modes + n_rings))
        Disturbance of the state at theta = 0 for each whirl, scaled to 1 m at the journal or ring that moves most.
    jacobian : ndarray of float64, shape (4 (n_modes + n_rings), 4 (n_modes + n_rings))
        Derivative of the state one turn later with respect to the initial state.
    """

    speed: float
    initial_state: FloatArray
    whirls: tuple[Whirl, ...]
    disturbances: FloatArray
    jacobian: FloatArray

    @property
    def disturbance(self) -> FloatArray:
        """Disturbance of the least stable whirl, (4 (n_modes + n_rings),)."""
        return np.asarray(self.disturbances[0])

    @property
    def growth_rate(self) -> float:
        """Growth rate of the least stable whirl, 1/s; positive if the motion is unstable."""
        return self.whirls[0].growth_rate

    @property
    def whirl_order(self) -> float:
        """Order of the least stable whirl, frequency over shaft speed; negative for reverse whirl."""
        return self.whirls[0].order


def synchronous_orbit(
    parameters: ModelParameters, speed: float, start: SynchronousOrbit | None = None, *, steps: int = STEPS_PER_TURN
) -> SynchronousOrbit:
    """Return the synchronous motion under imbalance and weight, and the growth of its disturbances.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    speed : float
        rad/s, above 0.
    start : SynchronousOrbit, optional
        Orbit at a neighbouring speed; without it the iteration starts from rest.
    steps : int
        Time steps per turn.

    Returns
    -------
    SynchronousOrbit
        The periodic motion and its least stable whirls.

    Raises
    ------
    NoSolutionError
        If none is found within the clearances.
    """
    require_positive("speed", speed, "rad/s")
    _ = parameters.floating_ring
    turn = _PoincareMap(ModalSystem.from_parameters(parameters), speed, steps)
    initial_state = turn.after(np.zeros(turn.size), SETTLING_TURNS) if start is None else start.initial_state
    if start is None:
        following, jacobian, _ = turn.differentiate(initial_state)
    else:  # the derivative at a neighbouring speed is good enough to converge
        following, jacobian = turn.after(initial_state, 1), start.jacobian
    last = math.inf
    for _ in range(MAX_ITERATIONS):
        miss = following - initial_state
        error = float(np.max(np.abs(miss))) / turn.unit
        if error < TOLERANCE:
            break
        if error > 0.3 * last:
            following, jacobian, _ = turn.differentiate(initial_state)
            miss = following - initial_state
        last = error
        initial_state = initial_state + np.linalg.solve(np.eye(turn.size) - jacobian, miss)
        following = turn.after(initial_state, 1)
    else:
        raise NoSolutionError(f"synchronous motion at {speed:.1f} rad/s: no periodic motion found")
    _, jacobian, path = turn.differentiate(initial_state)
    whirls, disturbances = turn.whirls(jacobian, path)
    return SynchronousOrbit(speed, initial_state, whirls, disturbances, jacobian)


class _PoincareMap:
    """Poincaré map: from the state at theta = 0 to the state one turn later."""

    def __init__(self, system: ModalSystem, speed: float, steps: int) -> None:
        self._system, self._speed = system, speed
        self._modes = system.shaft.squared_frequencies.size
        self._steps = steps
        self._step = 2 * math.pi / (steps * speed)
        self._matrices = system.matrices(self._step)
        self._rings = system.rings.mass.size
        self.size = 4 * (self._modes + self._rings)
        self.unit = system.clearance / float(np.abs(system.shaft.journals[:, 0]).max())

    def after(self, initial_state: FloatArray, turns: int) -> FloatArray:
        """Return the state after whole turns; NoSolutionError if the motion reaches a wall."""
        return self._reduced(self._integrated(initial_state, turns, None).reshape(3, -1, 1))[:, 0]

    def differentiate(self, initial_state: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the state one turn later and the derivative of the map, (size, size).

        The third array is the derivative of the eccentricity ratios of the films in X and Y over the turn,
        (4, steps, 2, size).
        """
        coordinates, size = self.size // 4, self.size
        motion, each = np.zeros((3, coordinates, 2, size)), np.arange(coordinates)
        for row, factor in enumerate((1.0, self._speed)):
            real = 2 * (row * coordinates + each)
            motion[row, each, 0, real] = motion[row, each, 1, real + 1] = factor
        path = np.empty((4, self._steps, 2, size))
        following = self._integrated(initial_state, 1, Tangent(motion, motion.copy(), path))
        return (
            self._reduced(following.reshape(3, -1, 1))[:, 0],
            self._reduced(motion[:, :, 0] + 1j * motion[:, :, 1]),
            path,
        )

    def _reduced(self, motion: ComplexArray) -> FloatArray:
        """Return the numbers that define states, (size, n), of motions, (3, n_modes + n_rings, n)."""
        (q, v, a), h = motion, self._step
        combined = 2 / h * q + v
        rate = h / 2 * (4 / h**2 * q + 4 / h * v + a) - combined
        both = np.concatenate((h / 2 * (combined - rate), rate / self._speed))
        return np.stack((both.real, both.imag), axis=1).reshape(self.size, -1)

    def _integrated(self, initial_state: FloatArray, turns: int, tangent: Tangent | None) -> ComplexArray:
        """Return the motion after whole turns."""
        system, state = self._system, self._system.at_rest(angle=0.0, speed=self._speed)
        state.set_initial_state(initial_state)
        outputs = system.eccentricities
        angles = 2 * math.pi / self._steps * np.arange(1, turns * self._steps + 1, dtype=np.float64)
        history = np.stack((angles, np.full(angles.size, self._speed)))
        path = np.empty((outputs.shape[0], angles.size), np.complex128)
        if (
            not system.is_inside_clearances(state.motion)
            or integrate(system.parts, system.constraints, self._matrices, state, history, outputs, path, tangent)
            != NO_FAILURE
        ):
            raise NoSolutionError(f"synchronous motion at {self._speed:.1f} rad/s: none found within the clearances")
        return state.motion

    def whirls(self, jacobian: FloatArray, path: FloatArray) -> tuple[tuple[Whirl, ...], FloatArray]:
        """Return the least stable whirl of each film, the less stable first, and the disturbance of each."""
        multipliers, vectors = np.linalg.eig(jacobian)
        found = dict[FilmName, tuple[Whirl, FloatArray]]()
        for place in np.argsort(-np.abs(multipliers), kind="stable"):
            multiplier, vector = complex(multipliers[place]), vectors[:, place]
            if len(found) == len(FilmName) or (found and abs(multiplier) < MIN_MULTIPLIER):
                break
            if multiplier.imag < 0:  # conjugate of a pair
                continue
            exponent = complex(math.log(max(abs(multiplier), 1e-300)), cmath.phase(multiplier)) / (2 * math.pi)
            pairs = path.reshape(-1, self.size) @ np.stack((vector.real, vector.imag), axis=1)
            disturbance = pairs.view(np.complex128).reshape(path.shape[:-1]).swapaxes(1, 2)
            order, share = order_and_share(disturbance, exponent)
            if abs(order) > MAX_ORDER * self._steps:
                continue
            whirl = Whirl(growth_rate=exponent.real * self._speed, order=order, inner_share=share)
            found.setdefault(whirl.film, (whirl, self._scaled(vector.real)))
        return tuple(whirl for whirl, _ in found.values()), np.stack([begin for _, begin in found.values()])

    def _scaled(self, disturbance: FloatArray) -> FloatArray:
        """Return the disturbance scaled to 1 m at the journal or ring that moves most."""
        place = np.ascontiguousarray(disturbance).view(np.complex128)[: self._modes + self._rings]
        journals = self._system.shaft.journals @ place[: self._modes]
        return disturbance / max(float(np.abs(journals).max()), float(np.abs(place[self._modes :]).max()))
