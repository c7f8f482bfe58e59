"""Which motion the simulated shaft makes, from the rig's configuration."""

import math

import numpy as np

from analysis.signals.header import Acquisition, Role
from daq.config.rig import MICRO, RPM, Rig
from daq.config.rotor import rotor_parameters
from daq.config.schema import SimulationSection
from daq.drivers.simulation.motion import Motion, RunOut, SynchronousMotion, Together, ToldWhirl, circular, towards
from daq.drivers.simulation.random_streams import Purpose, draws
from daq.drivers.simulation.simulated_model import ModelMotion
from daq.drivers.simulation.speed import SpeedCourse
from model.dynamics.synchronous import synchronous_response

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
        return Together([run_out, ModelMotion(rotor_parameters(rig), course, acquisition.rate, angles)])
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
    parameters = rotor_parameters(rig)
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
