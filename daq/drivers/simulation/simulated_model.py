"""The shaft moved by the rotor model: integrated in time, coarser than it is sampled, and interpolated."""

import numpy as np
from numpy.typing import NDArray

from daq.drivers.simulation.motion import Instants, towards
from daq.drivers.simulation.speed import SpeedCourse
from model.dynamics.motion import STEPS_PER_TURN, ShaftMotion
from model.rotor.parameters import ModelParameters

FloatArray = NDArray[np.float64]

BEFORE, AFTER = 1, 2  # steps on either side of a sample that the cubic through four of them needs


class ModelMotion:
    """The model's motion at the samples.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    course : SpeedCourse
        Speed and angle of the shaft.
    rate : float
        Sample rate, Hz; a step of the integration is a whole number of samples.
    angles : tuple of float
        Where the probes sit, rad.

    Raises
    ------
    WallContactError
        The shaft reaches a wall while it settles at its first speed.
    """

    def __init__(
        self, parameters: ModelParameters, course: SpeedCourse, rate: float, angles: tuple[float, float]
    ) -> None:
        fastest = max(float(course.speeds.max()), 1.0)
        self._step = max(int(rate * 2.0 * np.pi / (STEPS_PER_TURN * fastest)), 1) / rate
        self._course = course
        self._angles = angles
        self._next = -BEFORE  # number of the first step that is not integrated yet
        angle, speed = course.at(np.array([(self._next - 1) * self._step]))
        self._shaft = ShaftMotion(parameters, float(speed[0]), angle=float(angle[0]))
        self._path = np.empty((2, 0))  # X and Y at the last steps, the last of them number `_next - 1`

    def advance(self, instants: Instants) -> FloatArray:
        """Return the displacement towards each probe, m; see `Motion`.

        Raises
        ------
        WallContactError
            The shaft reaches a wall; it cannot be continued then.
        """
        position = instants.time / self._step
        whole = np.floor(position).astype(np.int64)
        self._integrate(int(whole.min()) - BEFORE, int(whole.max()) + AFTER)
        path = towards(self._angles, self._path)
        place = whole - (self._next - self._path.shape[1])
        weights = _cubic(position - whole)
        displacement = np.zeros_like(position)
        for probe in range(2):
            for offset, weight in zip(range(-BEFORE, AFTER + 1), weights, strict=True):
                displacement[probe] += weight[probe] * path[probe, place[probe] + offset]
        return displacement

    def _integrate(self, first: int, last: int) -> None:
        """Follow the shaft up to a step, and forget what lies before another."""
        steps = np.arange(self._next, last + 1)
        angle, speed = self._course.at(self._step * steps.astype(np.float64))
        further = self._shaft.advance(angle, speed, self._step)
        keep = max(self._next - first, 0)
        kept = self._path[:, self._path.shape[1] - min(keep, self._path.shape[1]) :]
        self._path = np.concatenate([kept, further], axis=1)
        self._next = last + 1


def _cubic(part: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return Lagrange's weights of the four steps about a sample, ``part`` of a step after the second."""
    past, left, after = part + 1.0, 1.0 - part, 2.0 - part
    return -part * left * after / 6.0, past * left * after / 2.0, past * part * after / 2.0, -past * part * left / 6.0
