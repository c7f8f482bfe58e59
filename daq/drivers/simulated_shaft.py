"""Which motion the simulated shaft makes, from the rig's configuration."""

import math

import numpy as np

from analysis.run import Acquisition, Role
from daq.config.rig import MICRO, RPM, Rig
from daq.config.rotor import rotor_parameters
from daq.config.schema import SimulationSection
from daq.drivers.simulated_draws import Purpose, draws
from daq.drivers.simulated_model import ModelMotion
from daq.drivers.simulated_motion import Motion, RunOut, SynchronousMotion, Together, ToldWhirl, circular, towards
from daq.drivers.simulated_speed import SpeedCourse

GRID = 48  # speeds at which the synchronous response is computed


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
    WallContactError
        The model's shaft reaches a wall at its first speed.
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
    speeds = np.linspace(0.0, max(float(course.speeds.max()), 100.0), GRID)
    unbalance = 2.5 * MICRO * (speeds / 1000.0) ** 2 / (1.0 + (speeds / 1000.0) ** 2)
    return SynchronousMotion(
        speeds=speeds,
        vectors=unbalance * circular(1.0, -0.3, angles)[:, np.newaxis],
        static=towards(angles, np.array([0.0, -rig.config.simulation.sag_um * MICRO])),
    )
