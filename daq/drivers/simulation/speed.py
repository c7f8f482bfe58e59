"""Speed and angle of the simulated shaft as functions of time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from analysis.signals.units import RPM
from daq.config.schema import SimulationSection
from daq.drivers.simulation import StreamPurpose, random_stream

FloatArray = NDArray[np.float64]

KNOT_STEP = 0.02  # s; speed is linear between knots
LEAD_IN = 2.0  # s of motion before the first sample, so that the tacho has earlier edges
LEAD_OUT = 2.0  # s of motion after the last sample


@dataclass(frozen=True, slots=True, eq=False)
class SpeedProfile:
    """The shaft's speed over time, linear between evenly spaced knots, and its exact integral, the angle.

    Parameters
    ----------
    start : float
        Time of the first knot, s.
    step : float
        Time between knots, s.
    speeds : ndarray of float64, shape (n,)
        Shaft speed at the knots, rad/s, not negative.
    angles : ndarray of float64, shape (n,)
        Angle turned at the knots, rad.
    """

    start: float
    step: float
    speeds: FloatArray
    angles: FloatArray

    def angle_and_speed(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return angle, rad, and speed, rad/s, at times, s, within the profile."""
        position = (time - self.start) / self.step
        knot = np.clip(position.astype(np.int64), 0, self.speeds.size - 2)
        since = (position - knot) * self.step
        speed_at_knot = self.speeds[knot]
        acceleration = (self.speeds[knot + 1] - speed_at_knot) / self.step
        gained = acceleration * since
        return self.angles[knot] + since * (speed_at_knot + 0.5 * gained), speed_at_knot + gained

    def time_at(self, angle: FloatArray) -> FloatArray:
        """Return the times, s, at which the shaft first reaches angles, rad; NaN outside the profile."""
        after = np.searchsorted(self.angles, angle, side="left")
        inside = (after > 0) & (after < self.angles.size)
        knot = np.where(inside, after - 1, 0)
        speed = self.speeds[knot]
        acceleration = (self.speeds[knot + 1] - speed) / self.step
        left = np.where(inside, angle - self.angles[knot], 1.0)
        # left = speed t + acceleration t² / 2, solved in the form without cancellation
        root = np.sqrt(np.maximum(speed**2 + 2.0 * acceleration * left, 0.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            since = 2.0 * left / (speed + root)
        return np.where(inside, self.start + knot * self.step + since, np.nan)


def fluctuation(rng: np.random.Generator, n: int, correlation: float) -> FloatArray:
    """Return slow noise of unit rms: white noise through two equal first-order filters.

    One filter represents the drive air's slow variation, the other the rotor's inertia.

    Parameters
    ----------
    rng : Generator
        Source of the noise.
    n : int
        Number of values.
    correlation : float
        Time constant of each filter, in values.
    """
    pole = np.exp(-1.0 / correlation)
    settle = int(12 * correlation) + 1
    white = rng.standard_normal(settle + n)
    slow = lfilter([1.0], [1.0, -2.0 * pole, pole**2], white)[settle:]
    variance = (1.0 + pole**2) / (1.0 - pole**2) ** 3  # sum of (k + 1)² pole^2k
    return np.asarray(slow / np.sqrt(variance), dtype=np.float64)


def make_speed_profile(bench: SimulationSection) -> SpeedProfile:
    """Return the speed profile through the corners in `[simulation]`, with random fluctuation and drift."""
    rng = random_stream(bench.seed, StreamPurpose.SPEED)
    times, speeds = [point.time_s for point in bench.profile], [point.speed_rpm * RPM for point in bench.profile]
    knots = int(np.ceil((times[-1] + LEAD_IN + LEAD_OUT) / KNOT_STEP)) + 1
    time = -LEAD_IN + KNOT_STEP * np.arange(knots)
    noise = fluctuation(rng, knots, bench.fluctuation_time_s / KNOT_STEP)
    drift = 1.0 + bench.speed_drift / 60.0 * np.maximum(time, 0.0)
    speed = np.maximum(np.interp(time, times, speeds) * (1.0 + bench.speed_fluctuation * noise) * drift, 0.0)
    turned = np.concatenate(([0.0], np.cumsum(0.5 * KNOT_STEP * (speed[1:] + speed[:-1]))))
    return SpeedProfile(start=-LEAD_IN, step=KNOT_STEP, speeds=speed, angles=rng.uniform(0.0, 2.0 * np.pi) + turned)
