"""The motion of the simulated shaft at the probes: the sum of what its parts make it do."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from daq.drivers.simulation.speed import SpeedCourse

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

FULL_GROWTH = 0.1  # a whirl has its full amplitude this part of its onset speed above the onset
FADE = 0.01  # and is gone over this part of its end speed


@dataclass(frozen=True, slots=True, eq=False)
class Instants:
    """When the two probes are sampled, and where the shaft is in its turn then.

    Parameters
    ----------
    time : ndarray of float64, shape (2, n)
        Of each probe, s.
    angle : ndarray of float64, shape (2, n)
        Angle turned, rad.
    speed : ndarray of float64, shape (n,)
        Shaft speed, rad/s; the probes' difference in time changes it by nothing that could be seen.
    cosine, sine : ndarray of float64, shape (2, n)
        Of the angle.
    """

    time: FloatArray
    angle: FloatArray
    speed: FloatArray
    cosine: FloatArray
    sine: FloatArray

    @classmethod
    def along(cls, course: SpeedCourse, time: FloatArray, lags: FloatArray) -> "Instants":
        """Return the instants of samples at times, s, each probe late by its lag, s."""
        angle, speed = course.at(time)
        late = lags[:, np.newaxis]
        angles = angle + speed * late
        return cls(time=time + late, angle=angles, speed=speed, cosine=np.cos(angles), sine=np.sin(angles))


class Motion(Protocol):
    """A part of the shaft's motion."""

    def advance(self, instants: Instants) -> FloatArray:
        """Return the displacement towards each probe, m, shape (2, n); instants follow on those of the last call."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class RunOut:
    """What a round-turning but uneven surface shows: 1X and 2X that no speed changes.

    Parameters
    ----------
    first, second : ndarray of complex128, shape (2,)
        1X and 2X vector at each probe, m peak; x(t) = Re[X exp(i k theta)].
    """

    first: ComplexArray
    second: ComplexArray

    def advance(self, instants: Instants) -> FloatArray:
        """Return the displacement towards each probe, m; see `Motion`."""
        first, second = self.first[:, np.newaxis], self.second[:, np.newaxis]
        cosine, sine = instants.cosine, instants.sine
        # cos 2 theta = 2 cos² - 1, sin 2 theta = 2 sin cos
        once = cosine * (first.real + 2.0 * (second.real * cosine - second.imag * sine)) - first.imag * sine
        return np.asarray(once - second.real, dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class SynchronousMotion:
    """Whirl with the shaft's speed, as large as the speed makes it, about a steady place.

    Parameters
    ----------
    speeds : ndarray of float64, shape (m,)
        Grid of speeds, rad/s, rising.
    vectors : ndarray of complex128, shape (2, m)
        1X vector at each probe over the grid, m peak; x(t) = Re[X exp(i theta)].
    static : ndarray of float64, shape (2,)
        Steady displacement towards each probe, m.
    """

    speeds: FloatArray
    vectors: ComplexArray
    static: FloatArray

    def advance(self, instants: Instants) -> FloatArray:
        """Return the displacement towards each probe, m; see `Motion`."""
        displacement = np.empty_like(instants.angle)
        for probe, vector in enumerate(self.vectors):
            real = np.interp(instants.speed, self.speeds, vector.real)
            imag = np.interp(instants.speed, self.speeds, vector.imag)
            once = real * instants.cosine[probe] - imag * instants.sine[probe]
            displacement[probe] = self.static[probe] + once
        return displacement


@dataclass(frozen=True, slots=True)
class ToldWhirl:
    """A sub-synchronous component that the bench shows because it is told to.

    Parameters
    ----------
    angles : tuple of float
        Where the probes sit, rad.
    order : float
        Its frequency over the shaft's.
    onset, end : float
        Shaft speeds between which it lives, rad/s.
    amplitude : float
        From `FULL_GROWTH` above the onset on, m peak.
    forward : bool
        Whether it goes round with the shaft.
    phase : float
        Where it is when the shaft's angle is 0, rad.
    """

    angles: tuple[float, float]
    order: float
    onset: float
    end: float
    amplitude: float
    forward: bool
    phase: float

    def envelope(self, speed: FloatArray) -> FloatArray:
        """Return its amplitude, m peak, at speeds, rad/s.

        It rises with the square root of the distance from the onset, as a limit cycle born in a Hopf bifurcation does,
        until it is full.
        """
        growth = np.sqrt(np.clip((speed - self.onset) / (FULL_GROWTH * self.onset), 0.0, 1.0))
        fade = np.clip((self.end - speed) / (FADE * self.end), 0.0, 1.0)
        return np.asarray(self.amplitude * growth * fade, dtype=np.float64)

    def advance(self, instants: Instants) -> FloatArray:
        """Return the displacement towards each probe, m; see `Motion`."""
        envelope = self.envelope(instants.speed)
        if not np.any(envelope):
            return np.zeros_like(instants.angle)
        seats = np.array(self.angles)[:, np.newaxis] * (1.0 if self.forward else -1.0)
        return np.asarray(envelope * np.cos(self.order * instants.angle + (self.phase - seats)), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Together:
    """Several motions at once.

    Parameters
    ----------
    parts : sequence of Motion
        At least one.
    """

    parts: Sequence[Motion]

    def advance(self, instants: Instants) -> FloatArray:
        """Return the displacement towards each probe, m; see `Motion`."""
        total = self.parts[0].advance(instants)
        for part in self.parts[1:]:
            total += part.advance(instants)
        return total


def circular(amplitude: float, phase: float, angles: tuple[float, float]) -> ComplexArray:
    """Return the vectors at two probes of a forward circular motion of an amplitude, m peak, and phase, rad."""
    return np.asarray(amplitude * np.exp(1j * (phase - np.array(angles))), dtype=np.complex128)


def towards(angles: tuple[float, float], displacement: FloatArray) -> FloatArray:
    """Return the parts towards two probes of a displacement in the bench's X and Y, first axis (2,), m."""
    x, y = displacement
    return np.stack([x * np.cos(angle) + y * np.sin(angle) for angle in angles])  # the same bits for any length
