"""Which motion the simulated shaft makes, from the rig's configuration."""

import math

import numpy as np

from analysis.run import Acquisition, Role
from daq.config.rig import MICRO, RPM, Rig
from daq.drivers.simulated_draws import Purpose, draws
from daq.drivers.simulated_motion import Motion, ToldMotion, ToldWhirl, along, circular
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
    """
    angle_x, angle_y = (acquisition.channels[acquisition.row(role)].angle for role in (Role.PROBE_X, Role.PROBE_Y))
    return _told(rig, course, (angle_x, angle_y))


def _told(rig: Rig, course: SpeedCourse, angles: tuple[float, float]) -> ToldMotion:
    bench = rig.config.simulation
    speeds = np.linspace(0.0, max(float(course.speeds.max()), 100.0), GRID)
    unbalance = 2.5 * MICRO * (speeds / 1000.0) ** 2 / (1.0 + (speeds / 1000.0) ** 2)
    first = unbalance * circular(1.0, -0.3, angles)[:, np.newaxis]
    run_out, second, *whirl_phases = draws(bench.seed, Purpose.PHASES).uniform(0.0, math.tau, size=2 + len(bench.whirl))
    return ToldMotion(
        angles=angles,
        speeds=speeds,
        first=first + circular(bench.run_out_um * MICRO, run_out, angles)[:, np.newaxis],
        second=circular(bench.second_order_um * MICRO, second, angles),
        static=along(angles, np.array([0.0, -bench.sag_um * MICRO])),
        whirls=[
            ToldWhirl(
                order=whirl.order,
                onset=whirl.onset_rpm * RPM,
                end=whirl.end_rpm * RPM,
                amplitude=whirl.amplitude_um * MICRO,
                forward=whirl.forward,
                phase=phase,
            )
            for whirl, phase in zip(bench.whirl, whirl_phases, strict=True)
        ],
    )
