"""The speed of the simulated shaft and the angle it has turned, as functions of time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

FloatArray = NDArray[np.float64]

KNOT_STEP = 0.02  # s; speed is linear between knots
BEFORE = 2.0  # s of motion before the first sample: the tacho has a past
AFTER = 2.0  # s of motion after the last


@dataclass(frozen=True, slots=True, eq=False)
class SpeedCourse:
    """Speed as a function of time, linear between evenly spaced knots, and its exact integral.

    Parameters
    ----------
    start : float
        Time of the first knot, s.
    step : float
        Between knots, s.
    speeds : ndarray of float64, shape (n,)
        Shaft speed at the knots, rad/s, not negative.
    angles : ndarray of float64, shape (n,)
        Angle turned at the knots, rad.
    """

    start: float
    step: float
    speeds: FloatArray
    angles: FloatArray

    def at(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return angle, rad, and speed, rad/s, at times, s, within the course."""
        position = (time - self.start) / self.step
        knot = np.clip(position.astype(np.int64), 0, self.speeds.size - 2)
        since = (position - knot) * self.step
        speed_at_knot = self.speeds[knot]
        acceleration = (self.speeds[knot + 1] - speed_at_knot) / self.step
        gained = acceleration * since
        return self.angles[knot] + since * (speed_at_knot + 0.5 * gained), speed_at_knot + gained

    def time_of(self, angle: FloatArray) -> FloatArray:
        """Return the times, s, at which the shaft first reaches angles, rad; NaN for those outside the course."""
        after = np.searchsorted(self.angles, angle, side="left")
        inside = (after > 0) & (after < self.angles.size)
        knot = np.where(inside, after - 1, 0)
        speed = self.speeds[knot]
        acceleration = (self.speeds[knot + 1] - speed) / self.step
        left = np.where(inside, angle - self.angles[knot], 1.0)
        # left = speed t + acceleration t² / 2, solved in the form that keeps its digits
        root = np.sqrt(np.maximum(speed**2 + 2.0 * acceleration * left, 0.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            since = 2.0 * left / (speed + root)
        return np.where(inside, self.start + knot * self.step + since, np.nan)


def fluctuation(rng: np.random.Generator, n: int, correlation: float) -> FloatArray:
    """Return slow noise of unit rms.

    White noise through two equal first-order filters: the air wanders, the rotor's inertia smooths it.

    Parameters
    ----------
    rng : Generator
        Draws from it.
    n : int
        How many values.
    correlation : float
        Time constant of each filter, in values.
    """
    pole = np.exp(-1.0 / correlation)
    settle = int(12 * correlation) + 1
    white = rng.standard_normal(settle + n)
    slow = lfilter([1.0], [1.0, -2.0 * pole, pole**2], white)[settle:]
    variance = (1.0 + pole**2) / (1.0 - pole**2) ** 3  # sum of (k + 1)² pole^2k
    return np.asarray(slow / np.sqrt(variance), dtype=np.float64)


def speed_course(
    times: Sequence[float],
    speeds: Sequence[float],
    rng: np.random.Generator,
    *,
    rms: float,
    correlation_time: float,
    drift: float,
) -> SpeedCourse:
    """Return the course of a run along a profile.

    Parameters
    ----------
    times, speeds : sequence of float
        Corners of the profile, s (rising, from 0) and rad/s.
    rng : Generator
        Draws the fluctuation.
    rms : float
        Of the fluctuation, relative to the speed.
    correlation_time : float
        Of the fluctuation, s.
    drift : float
        Relative change of speed per second.
    """
    knots = int(np.ceil((times[-1] + BEFORE + AFTER) / KNOT_STEP)) + 1
    time = -BEFORE + KNOT_STEP * np.arange(knots)
    noise = fluctuation(rng, knots, correlation_time / KNOT_STEP)
    speed = np.interp(time, times, speeds) * (1.0 + rms * noise) * (1.0 + drift * np.maximum(time, 0.0))
    speed = np.maximum(speed, 0.0)
    turned = np.concatenate(([0.0], np.cumsum(0.5 * KNOT_STEP * (speed[1:] + speed[:-1]))))
    return SpeedCourse(start=-BEFORE, step=KNOT_STEP, speeds=speed, angles=rng.uniform(0.0, 2.0 * np.pi) + turned)
