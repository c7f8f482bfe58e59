"""The simulated shaft's motion from the rig's configuration, including the rotor model integrated in time."""

import math

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import Acquisition, Role
from analysis.signals.units import MICROMETRE, RPM
from daq.config.rig import Rig
from daq.config.rotor import model_parameters
from daq.config.schema import SimulationSection
from daq.drivers.simulation.motion import (
    MotionComponent,
    MotionSum,
    PrescribedWhirl,
    RunOut,
    SamplingInstants,
    SynchronousMotion,
    circular_vectors,
    towards_probes,
)
from daq.drivers.simulation.random_streams import StreamPurpose, random_stream
from daq.drivers.simulation.speed import SpeedProfile
from model.dynamics.motion import STEPS_PER_TURN, ShaftMotion
from model.dynamics.synchronous import synchronous_response
from model.rotor.parameters import ModelParameters

FloatArray = NDArray[np.float64]

STEPS_BEFORE, STEPS_AFTER = 1, 2  # steps on either side of a sample that the cubic interpolation needs


class ModelMotion:
    """The motion of the rotor model: integrated with a step longer than the sample interval, and interpolated.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    speed_profile : SpeedProfile
        Speed and angle of the shaft.
    rate : float
        Sample rate, Hz; an integration step is a whole number of samples.
    angles : tuple of float
        Probe angles, rad.

    Raises
    ------
    WallContactError
        The shaft reaches a wall while it settles at its first speed.
    """

    def __init__(
        self, parameters: ModelParameters, speed_profile: SpeedProfile, rate: float, angles: tuple[float, float]
    ) -> None:
        highest_speed = max(float(speed_profile.speeds.max()), 1.0)
        self._step = max(int(rate * 2.0 * np.pi / (STEPS_PER_TURN * highest_speed)), 1) / rate
        self._speed_profile = speed_profile
        self._angles = angles
        self._next = -STEPS_BEFORE  # number of the first step that is not integrated yet
        angle, speed = speed_profile.angle_and_speed(np.array([(self._next - 1) * self._step]))
        self._shaft = ShaftMotion(parameters, float(speed[0]), angle=float(angle[0]))
        self._path = np.empty((2, 0))  # X and Y at the latest steps, up to number `_next - 1`

    def advance(self, instants: SamplingInstants) -> FloatArray:
        """Return the displacement towards each probe, m; see `MotionComponent`.

        Raises
        ------
        WallContactError
            The shaft reaches a wall; the motion cannot be continued then.
        """
        position = instants.time / self._step
        whole = np.floor(position).astype(np.int64)
        self._integrate(int(whole.min()) - STEPS_BEFORE, int(whole.max()) + STEPS_AFTER)
        path = towards_probes(self._angles, self._path)
        index = whole - (self._next - self._path.shape[1])
        weights = _cubic(position - whole)
        displacement = np.zeros_like(position)
        for probe in range(2):
            for offset, weight in zip(range(-STEPS_BEFORE, STEPS_AFTER + 1), weights, strict=True):
                displacement[probe] += weight[probe] * path[probe, index[probe] + offset]
        return displacement

    def _integrate(self, first: int, last: int) -> None:
        """Integrate up to step `last`, and discard the steps before `first`."""
        steps = np.arange(self._next, last + 1)
        angle, speed = self._speed_profile.angle_and_speed(self._step * steps.astype(np.float64))
        further = self._shaft.advance(angle, speed, self._step)
        n_needed = min(max(self._next - first, 0), self._path.shape[1])
        needed = self._path[:, self._path.shape[1] - n_needed :]
        self._path = np.concatenate([needed, further], axis=1)
        self._next = last + 1


def _cubic(part: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the Lagrange weights of the four steps about a sample that lies ``part`` of a step after the second."""
    past, left, after = part + 1.0, 1.0 - part, 2.0 - part
    return -part * left * after / 6.0, past * left * after / 2.0, past * part * after / 2.0, -past * part * left / 6.0


N_SPEEDS = 48  # at which the synchronous response is computed
MIN_SPEED = 50.0  # rad/s: below it the response is assumed to fall to zero


def shaft_motion(rig: Rig, speed_profile: SpeedProfile, acquisition: Acquisition) -> MotionComponent:
    """Return the motion that `[simulation]` configures.

    Parameters
    ----------
    rig : Rig
        The rig.
    speed_profile : SpeedProfile
        Speed of the shaft.
    acquisition : Acquisition
        Acquisition of the card.

    Raises
    ------
    ModelError
        The model's shaft reaches a wall at its first speed, or has no synchronous motion.
    """
    bench = rig.config.simulation
    angle_x, angle_y = (acquisition.channels[acquisition.row(role)].angle for role in (Role.PROBE_X, Role.PROBE_Y))
    angles = (angle_x, angle_y)
    first, second, *phases = random_stream(bench.seed, StreamPurpose.PHASES).uniform(
        0.0, math.tau, size=2 + len(bench.whirl)
    )
    run_out = RunOut(
        first=circular_vectors(bench.run_out_um * MICROMETRE, first, angles),
        second=circular_vectors(bench.second_order_um * MICROMETRE, second, angles),
    )
    if bench.motion == "model":
        return MotionSum([run_out, ModelMotion(model_parameters(rig.config), speed_profile, acquisition.rate, angles)])
    return MotionSum([run_out, _synchronous(rig, speed_profile, angles), *_whirls(bench, angles, phases)])


def _whirls(bench: SimulationSection, angles: tuple[float, float], phases: list[float]) -> list[PrescribedWhirl]:
    return [
        PrescribedWhirl(
            angles=angles,
            order=whirl.order,
            onset=whirl.onset_rpm * RPM,
            end=whirl.end_rpm * RPM,
            amplitude=whirl.amplitude_um * MICROMETRE,
            forward=whirl.forward,
            phase=phase,
        )
        for whirl, phase in zip(bench.whirl, phases, strict=True)
    ]


def _synchronous(rig: Rig, speed_profile: SpeedProfile, angles: tuple[float, float]) -> SynchronousMotion:
    """Return the model's synchronous motion over the run's speeds, on the branch that starts at the lowest speed."""
    parameters = model_parameters(rig.config)
    highest = 1.01 * max(float(speed_profile.speeds.max()), MIN_SPEED)  # so that a run at one speed has a grid too
    speeds = np.linspace(max(float(speed_profile.speeds.min()), MIN_SPEED), highest, N_SPEEDS)
    responses = [synchronous_response(parameters, float(speeds[0]))]
    for speed in speeds[1:]:
        responses.append(synchronous_response(parameters, float(speed), responses[-1]))
    vectors = np.stack([response.vectors for response in responses], axis=1)
    return SynchronousMotion(
        speeds=np.concatenate([[0.0], speeds]),
        vectors=np.concatenate([np.zeros((2, 1)), vectors], axis=1),
        static=towards_probes(angles, np.array([0.0, -rig.config.simulation.sag_um * MICROMETRE])),
    )
