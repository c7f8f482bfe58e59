"""Which motion the simulated shaft makes, from the rig's configuration.

The shaft moved by the rotor model: integrated in time, coarser than it is sampled, and interpolated.
"""

import math

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import Acquisition, Role
from daq.config.rig import MICRO, RPM, Rig
from daq.config.rotor import model_parameters
from daq.config.schema import SimulationSection
from daq.drivers.simulation.motion import (
    Instants,
    Motion,
    RunOut,
    SynchronousMotion,
    Together,
    ToldWhirl,
    circular,
    towards,
)
from daq.drivers.simulation.random_streams import Purpose, draws
from daq.drivers.simulation.speed import SpeedCourse
from model.dynamics.motion import STEPS_PER_TURN, ShaftMotion
from model.dynamics.synchronous import synchronous_response
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


GRID = 48  # speeds at which the synchronous response is computed
SLOWEST = 50.0  # rad/s: below it the response is taken to fall to nothing


def shaft_motion(rig: Rig, course: SpeedCourse, acquisition: Acquisition) -> Motion:
    """Return the motion that the rig's simulation asks for.

    Parameters
    ----------
    rig : Rig
        The rig.
    course : SpeedCourse
        Speed of the shaft.
    acquisition : Acquisition
        Of the card that samples it.

    Raises
    ------
    ModelError
        The model's shaft reaches a wall at its first speed, or has no synchronous motion.
    """
    bench = rig.config.simulation
    angle_x, angle_y = (acquisition.channels[acquisition.row(role)].angle for role in (Role.PROBE_X, Role.PROBE_Y))
    angles = (angle_x, angle_y)
    first, second, *phases = draws(bench.seed, Purpose.PHASES).uniform(0.0, math.tau, size=2 + len(bench.whirl))
    run_out = RunOut(
        first=circular(bench.run_out_um * MICRO, first, angles),
        second=circular(bench.second_order_um * MICRO, second, angles),
    )
    if bench.motion == "model":
        return Together([run_out, ModelMotion(model_parameters(rig.config), course, acquisition.rate, angles)])
    return Together([run_out, _synchronous(rig, course, angles), *_whirls(bench, angles, phases)])


def _whirls(bench: SimulationSection, angles: tuple[float, float], phases: list[float]) -> list[ToldWhirl]:
    return [
        ToldWhirl(
            angles=angles,
            order=whirl.order,
            onset=whirl.onset_rpm * RPM,
            end=whirl.end_rpm * RPM,
            amplitude=whirl.amplitude_um * MICRO,
            forward=whirl.forward,
            phase=phase,
        )
        for whirl, phase in zip(bench.whirl, phases, strict=True)
    ]


def _synchronous(rig: Rig, course: SpeedCourse, angles: tuple[float, float]) -> SynchronousMotion:
    """Return the model's synchronous motion over the speeds of the run, one branch followed from the lowest up."""
    parameters = model_parameters(rig.config)
    highest = 1.01 * max(float(course.speeds.max()), SLOWEST)  # a grid also for a run at one speed
    speeds = np.linspace(max(float(course.speeds.min()), SLOWEST), highest, GRID)
    responses = [synchronous_response(parameters, float(speeds[0]))]
    for speed in speeds[1:]:
        responses.append(synchronous_response(parameters, float(speed), responses[-1]))
    vectors = np.stack([response.vectors for response in responses], axis=1)
    return SynchronousMotion(
        speeds=np.concatenate([[0.0], speeds]),
        vectors=np.concatenate([np.zeros((2, 1)), vectors], axis=1),
        static=towards(angles, np.array([0.0, -rig.config.simulation.sag_um * MICRO])),
    )
