"""Whether the synchronous motion is stable when the rotor has weight: the periodic orbit and its Floquet multipliers.

Newmark's step sees of displacement q, velocity v and acceleration a only ``4/h² q + 4/h v + a`` and ``2/h q + v``: two
numbers a coordinate say where the motion stands. They are written here as a displacement and a velocity, divided by
the speed, without acceleration. The map of one turn in these coordinates is differentiated (32 numbers for six modes
and two rings) and its fixed point is found by Newton's method, also where it is unstable.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.errors import ModelError
from model.kernel import NO_FAILURE, march
from model.motion import STEPS_PER_TURN
from model.parameters import ModelParameters
from model.rotor import require_positive
from model.system import ModalSystem

FloatArray = NDArray[np.float64]

FIRST_TURNS = 60  # from rest towards the orbit, before Newton's method
ITERATIONS = 40
CONVERGED = 1e-5  # of the inner clearance
PERTURBATION = 1e-4  # of the inner clearance


@dataclass(frozen=True, slots=True, eq=False)
class SynchronousOrbit:
    """The motion that repeats itself every turn, stable or not.

    Parameters
    ----------
    speed : float
        rad/s.
    standing : ndarray of float64, shape (4 (n_modes + n_rings),)
        Where it stands at theta = 0, in the coordinates above, to begin from at a neighbouring speed.
    disturbance : ndarray of float64, shape (4 (n_modes + n_rings),)
        What grows fastest or decays slowest, at one moment, in the same coordinates: it moves a journal or ring by 1 m.
    growth_rate : float
        Of the disturbance that grows fastest or decays slowest, 1/s; positive where the motion is unstable.
    whirl_order : float
        Frequency of that disturbance over the shaft's, 0 to 1: known only to whole orders.
    """

    speed: float
    standing: FloatArray
    disturbance: FloatArray
    growth_rate: float
    whirl_order: float


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
    turn = _Turn(ModalSystem.of(parameters), speed, steps)
    standing = turn.after(np.zeros(turn.size), FIRST_TURNS) if start is None else start.standing
    jacobian, following = turn.differentiate(standing)
    begun_at, last = standing, math.inf
    for _ in range(ITERATIONS):
        miss = following - standing
        error = float(np.max(np.abs(miss))) / turn.unit
        if error < CONVERGED:
            break
        if error > 0.3 * last:
            jacobian, following = turn.differentiate(standing)
            begun_at = standing
        last = error
        standing = standing + np.linalg.solve(np.eye(turn.size) - jacobian, miss)
        following = turn.after(standing, 1)
    else:
        raise ModelError(f"synchronous motion at {speed:.1f} rad/s: none found that repeats itself every turn")
    if np.max(np.abs(standing - begun_at)) > 100 * PERTURBATION * turn.unit:
        jacobian, _ = turn.differentiate(standing)
    multipliers, vectors = np.linalg.eig(jacobian)
    worst = int(np.argmax(np.abs(multipliers)))
    places = vectors[:, worst].reshape(2, -1, 2)[0]
    forward = np.linalg.norm(places[:, 0] + 1j * places[:, 1])
    backward = np.linalg.norm(places[:, 0] - 1j * places[:, 1])
    turned = float(np.angle(multipliers[worst])) / (2 * math.pi)
    return SynchronousOrbit(
        speed=speed,
        standing=standing,
        disturbance=turn.scaled(vectors[:, worst].real),
        growth_rate=math.log(max(abs(multipliers[worst]), 1e-300)) * speed / (2 * math.pi),
        whirl_order=(turned if forward >= backward else -turned) % 1.0,
    )


class _Turn:
    """The map of where the motion stands at theta = 0 to where it stands a turn later."""

    def __init__(self, system: ModalSystem, speed: float, steps: int) -> None:
        self._system, self._speed = system, speed
        self._modes = system.shaft.squares.size
        self._steps = steps
        self._step = 2 * math.pi / (steps * speed)
        self._levels = system.levels(self._step)
        self._rings = system.rings.mass.size
        self.size = 4 * (self._modes + self._rings)
        self.unit = system.films.inner_clearance / float(np.abs(system.shaft.journals[:, 0]).max())

    def after(self, standing: FloatArray, turns: int) -> FloatArray:
        """Return where the motion stands after whole turns; ModelError where it reaches a wall."""
        state = self._system.at_rest(angle=0.0, speed=self._speed)
        state.stand(standing)
        angles = 2 * math.pi / self._steps * np.arange(1, turns * self._steps + 1, dtype=np.float64)
        speeds = np.full(angles.size, self._speed)
        system = self._system
        nowhere = np.empty((0, self._modes)), np.empty((0, angles.size), np.complex128)
        if march(system.parts, system.constraints, self._levels, state, angles, speeds, *nowhere) != NO_FAILURE:
            raise ModelError(f"synchronous motion at {self._speed:.1f} rad/s: none found within the clearances")
        q, v, a = state.motion
        h = self._step
        seen = 2 / h * q + v
        rate = h / 2 * (4 / h**2 * q + 4 / h * v + a) - seen
        return np.ascontiguousarray(np.concatenate((h / 2 * (seen - rate), rate / self._speed))).view(np.float64)

    def scaled(self, disturbance: FloatArray) -> FloatArray:
        """Return the disturbance of that shape in which the journal or ring that moves most moves by 1 m."""
        place = np.ascontiguousarray(disturbance).view(np.complex128)[: self._modes + self._rings]
        journals = self._system.shaft.journals @ place[: self._modes]
        return disturbance / max(float(np.abs(journals).max()), float(np.abs(place[self._modes :]).max()))

    def differentiate(self, standing: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the map's derivative, (size, size), and its value."""
        following = self.after(standing, 1)
        jacobian = np.empty((self.size, self.size))
        change = PERTURBATION * self.unit
        for column in range(self.size):
            beside = standing.copy()
            beside[column] += change
            jacobian[:, column] = (self.after(beside, 1) - following) / change
        return jacobian, following
