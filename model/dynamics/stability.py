"""Whether the synchronous motion is stable when the rotor has weight: the periodic orbit and its Floquet multipliers.

Newmark's step sees of displacement q, velocity v and acceleration a only ``4/h² q + 4/h v + a`` and ``2/h q + v``: two
numbers a coordinate say where the motion stands. They are written here as a displacement and a velocity, divided by
the speed, without acceleration. The map of one turn in these coordinates is differentiated (32 numbers for six modes
and two rings) and its fixed point is found by Newton's method, also where it is unstable.
"""

import cmath
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.dynamics.modal_system import ModalSystem
from model.dynamics.motion import STEPS_PER_TURN
from model.dynamics.newmark import NO_FAILURE, integrate
from model.dynamics.whirl import FilmName, Whirl, order_and_share
from model.errors import ModelError
from model.rotor.parameters import ModelParameters
from model.rotor.rotor import require_positive

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

SETTLING_TURNS = 60  # from rest towards the orbit, before Newton's method
MAX_ITERATIONS = 40
TOLERANCE = 1e-5  # of the inner clearance
PERTURBATION = 1e-4  # of the inner clearance
MIN_MULTIPLIER = 1e-6  # of a disturbance after a turn: less than that is no whirl


@dataclass(frozen=True, slots=True, eq=False)
class SynchronousOrbit:
    """The motion that repeats itself every turn, stable or not.

    Parameters
    ----------
    speed : float
        rad/s.
    initial_state : ndarray of float64, shape (4 (n_modes + n_rings),)
        Where it stands at theta = 0, in the coordinates above, to begin from at a neighbouring speed.
    whirls : tuple of Whirl
        What grows fastest or decays slowest in the one film, and in the other: the least stable first.
    disturbances : ndarray of float64, shape (n_whirls, 4 (n_modes + n_rings))
        These at one moment, in the same coordinates: each moves a journal or ring by 1 m.
    """

    speed: float
    initial_state: FloatArray
    whirls: tuple[Whirl, ...]
    disturbances: FloatArray

    @property
    def disturbance(self) -> FloatArray:
        """What grows fastest or decays slowest, (4 (n_modes + n_rings),)."""
        return np.asarray(self.disturbances[0])

    @property
    def growth_rate(self) -> float:
        """Of that disturbance, 1/s; positive where the motion is unstable."""
        return self.whirls[0].growth_rate

    @property
    def whirl_order(self) -> float:
        """Frequency of that disturbance over the shaft's; negative where it goes against the shaft."""
        return self.whirls[0].order


def synchronous_orbit(
    parameters: ModelParameters, speed: float, start: SynchronousOrbit | None = None, *, steps: int = STEPS_PER_TURN
) -> SynchronousOrbit:
    """Return the synchronous motion under imbalance and weight, and how its disturbances grow.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    speed : float
        rad/s, above 0.
    start : SynchronousOrbit, optional
        At a neighbouring speed; without it the motion is begun from rest.
    steps : int
        Of the integration in a turn.

    Returns
    -------
    SynchronousOrbit
        The periodic motion.

    Raises
    ------
    ModelError
        Where none is found within the clearances.
    """
    require_positive("speed", speed, "rad/s")
    turn = _PoincareMap(ModalSystem.of(parameters), speed, steps)
    initial_state = turn.after(np.zeros(turn.size), SETTLING_TURNS) if start is None else start.initial_state
    jacobian, following = turn.differentiate(initial_state)
    begun_at, last = initial_state, math.inf
    for _ in range(MAX_ITERATIONS):
        miss = following - initial_state
        error = float(np.max(np.abs(miss))) / turn.unit
        if error < TOLERANCE:
            break
        if error > 0.3 * last:
            jacobian, following = turn.differentiate(initial_state)
            begun_at = initial_state
        last = error
        initial_state = initial_state + np.linalg.solve(np.eye(turn.size) - jacobian, miss)
        following = turn.after(initial_state, 1)
    else:
        raise ModelError(f"synchronous motion at {speed:.1f} rad/s: none found that repeats itself every turn")
    if np.max(np.abs(initial_state - begun_at)) > 100 * PERTURBATION * turn.unit:
        jacobian, _ = turn.differentiate(initial_state)
    whirls, disturbances = turn.whirls(initial_state, jacobian)
    return SynchronousOrbit(speed=speed, initial_state=initial_state, whirls=whirls, disturbances=disturbances)


class _PoincareMap:
    """The map of where the motion stands at theta = 0 to where it stands a turn later."""

    def __init__(self, system: ModalSystem, speed: float, steps: int) -> None:
        self._system, self._speed = system, speed
        self._modes = system.shaft.squared_frequencies.size
        self._steps = steps
        self._step = 2 * math.pi / (steps * speed)
        self._matrices = system.matrices(self._step)
        self._rings = system.rings.mass.size
        self.size = 4 * (self._modes + self._rings)
        self.unit = system.films.inner_clearance / float(np.abs(system.shaft.journals[:, 0]).max())

    def after(self, initial_state: FloatArray, turns: int) -> FloatArray:
        """Return where the motion stands after whole turns; ModelError where it reaches a wall."""
        (q, v, a), _ = self._integrated(initial_state, turns, np.empty((0, self._modes)))
        h = self._step
        seen = 2 / h * q + v
        rate = h / 2 * (4 / h**2 * q + 4 / h * v + a) - seen
        return np.ascontiguousarray(np.concatenate((h / 2 * (seen - rate), rate / self._speed))).view(np.float64)

    def _integrated(self, initial_state: FloatArray, turns: int, seen: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return the motion after whole turns, and what was seen of it at the ends of the steps."""
        system, state = self._system, self._system.at_rest(angle=0.0, speed=self._speed)
        state.set_initial_state(initial_state)
        angles = 2 * math.pi / self._steps * np.arange(1, turns * self._steps + 1, dtype=np.float64)
        speeds, path = np.full(angles.size, self._speed), np.empty((seen.shape[0], angles.size), np.complex128)
        is_possible = system.is_inside_clearances(state.motion) and (
            integrate(system.parts, system.constraints, self._matrices, state, angles, speeds, seen, path) == NO_FAILURE
        )
        if not is_possible:
            raise ModelError(f"synchronous motion at {self._speed:.1f} rad/s: none found within the clearances")
        return state.motion, path

    def whirls(self, initial_state: FloatArray, jacobian: FloatArray) -> tuple[tuple[Whirl, ...], FloatArray]:
        """Return the least stable whirl of each film, the less stable first, and what each begins with."""
        multipliers, vectors = np.linalg.eig(jacobian)
        orbit, found = self._eccentricities(initial_state), dict[FilmName, tuple[Whirl, FloatArray]]()
        for place in np.argsort(-np.abs(multipliers), kind="stable"):
            multiplier, vector = complex(multipliers[place]), vectors[:, place]
            if len(found) == len(FilmName) or (found and abs(multiplier) < MIN_MULTIPLIER):
                break
            if multiplier.imag < 0:  # the other of a pair
                continue
            exponent = complex(math.log(max(abs(multiplier), 1e-300)), cmath.phase(multiplier)) / (2 * math.pi)
            small = PERTURBATION * self.unit / float(np.abs(vector).max())
            parts = [self._eccentricities(initial_state + small * part) - orbit for part in (vector.real, vector.imag)]
            real, imaginary = (np.stack((part.real, part.imag), axis=1) / small for part in parts)
            order, share = order_and_share(real + 1j * imaginary, exponent)
            whirl = Whirl(growth_rate=exponent.real * self._speed, order=order, inner_share=share)
            found.setdefault(whirl.film, (whirl, self._scaled(vector.real)))
        return tuple(whirl for whirl, _ in found.values()), np.stack([begin for _, begin in found.values()])

    def _eccentricities(self, initial_state: FloatArray) -> ComplexArray:
        """Return the films' eccentricity ratios through a turn, (4, steps)."""
        return self._integrated(initial_state, 1, self._system.eccentricities)[1]

    def _scaled(self, disturbance: FloatArray) -> FloatArray:
        """Return the disturbance of that shape in which the journal or ring that moves most moves by 1 m."""
        place = np.ascontiguousarray(disturbance).view(np.complex128)[: self._modes + self._rings]
        journals = self._system.shaft.journals @ place[: self._modes]
        return disturbance / max(float(np.abs(journals).max()), float(np.abs(place[self._modes :]).max()))

    def differentiate(self, initial_state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the map's derivative, (size, size), and its value."""
        following = self.after(initial_state, 1)
        jacobian = np.empty((self.size, self.size))
        change = PERTURBATION * self.unit
        for column in range(self.size):
            beside = initial_state.copy()
            beside[column] += change
            jacobian[:, column] = (self.after(beside, 1) - following) / change
        return jacobian, following
