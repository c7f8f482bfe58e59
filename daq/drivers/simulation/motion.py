"""Components of the simulated shaft's motion at the probes: run-out, synchronous motion, prescribed whirl."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from daq.drivers.simulation.speed import SpeedProfile

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

FULL_GROWTH = 0.1  # a whirl reaches its full amplitude at this fraction of its onset speed above the onset
FADE = 0.01  # fraction of its end speed over which it vanishes


@dataclass(frozen=True, slots=True, eq=False)
class SamplingInstants:
    """The sampling instants of the two probes, with angle and speed of the shaft.

    Parameters
    ----------
    time : ndarray of float64, shape (2, n)
        Time at each probe, s.
    angle : ndarray of float64, shape (2, n)
        Angle turned, rad.
    speed : ndarray of float64, shape (n,)
        Shaft speed, rad/s; its change between the two probes' instants is negligible.
    cosine, sine : ndarray of float64, shape (2, n)
        Cosine and sine of the angle.
    """

    time: FloatArray
    angle: FloatArray
    speed: FloatArray
    cosine: FloatArray
    sine: FloatArray

    @classmethod
    def along(cls, speed_profile: SpeedProfile, time: FloatArray, lags: FloatArray) -> "SamplingInstants":
        """Return the instants of samples at times, s, each probe delayed by its lag, s."""
        angle, speed = speed_profile.angle_and_speed(time)
        late = lags[:, np.newaxis]
        angles = angle + speed * late
        return cls(time=time + late, angle=angles, speed=speed, cosine=np.cos(angles), sine=np.sin(angles))


class MotionComponent(Protocol):
    """A component of the shaft's motion."""

    def advance(self, instants: SamplingInstants) -> FloatArray:
        """Return the displacement towards each probe, m, shape (2, n); instants continue those of the last call."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class RunOut:
    """Run-out of an uneven surface: 1X and 2X that do not depend on speed.

    Parameters
    ----------
    first, second : ndarray of complex128, shape (2,)
        1X and 2X vector at each probe, m peak; x(t) = Re[X exp(i k theta)].
    """

    first: ComplexArray
    second: ComplexArray

    def advance(self, instants: SamplingInstants) -> FloatArray:
        """Return the displacement towards each probe, m; see `MotionComponent`."""
        first, second = self.first[:, np.newaxis], self.second[:, np.newaxis]
        cosine, sine = instants.cosine, instants.sine
        # cos 2 theta = 2 cos² - 1, sin 2 theta = 2 sin cos
        once = cosine * (first.real + 2.0 * (second.real * cosine - second.imag * sine)) - first.imag * sine
        return np.asarray(once - second.real, dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class SynchronousMotion:
    """Synchronous (1X) motion with a speed-dependent vector, about a steady position.

    Parameters
    ----------
    speeds : ndarray of float64, shape (m,)
        Speed grid, rad/s, rising.
    vectors : ndarray of complex128, shape (2, m)
        1X vector at each probe over the grid, m peak; x(t) = Re[X exp(i theta)].
    static : ndarray of float64, shape (2,)
        Steady displacement towards each probe, m.
    """

    speeds: FloatArray
    vectors: ComplexArray
    static: FloatArray

    def advance(self, instants: SamplingInstants) -> FloatArray:
        """Return the displacement towards each probe, m; see `MotionComponent`."""
        displacement = np.empty_like(instants.angle)
        for probe, vector in enumerate(self.vectors):
            real = np.interp(instants.speed, self.speeds, vector.real)
            imag = np.interp(instants.speed, self.speeds, vector.imag)
            once = real * instants.cosine[probe] - imag * instants.sine[probe]
            displacement[probe] = self.static[probe] + once
        return displacement


@dataclass(frozen=True, slots=True)
class PrescribedWhirl:
    """A sub-synchronous whirl with prescribed order and amplitude.

    Parameters
    ----------
    angles : tuple of float
        Probe angles, rad.
    order : float
        Its frequency relative to the shaft's.
    onset, end : float
        Shaft speeds between which it exists, rad/s.
    amplitude : float
        Amplitude from `FULL_GROWTH` above the onset on, m peak.
    forward : bool
        Whether it whirls in the direction of rotation.
    phase : float
        Its phase at shaft angle 0, rad.
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

        It rises with the square root of the distance from the onset, as a limit cycle after a Hopf bifurcation, up to
        the full amplitude.
        """
        growth = np.sqrt(np.clip((speed - self.onset) / (FULL_GROWTH * self.onset), 0.0, 1.0))
        fade = np.clip((self.end - speed) / (FADE * self.end), 0.0, 1.0)
        return np.asarray(self.amplitude * growth * fade, dtype=np.float64)

    def advance(self, instants: SamplingInstants) -> FloatArray:
        """Return the displacement towards each probe, m; see `MotionComponent`."""
        envelope = self.envelope(instants.speed)
        if not np.any(envelope):
            return np.zeros_like(instants.angle)
        seats = np.array(self.angles)[:, np.newaxis] * (1.0 if self.forward else -1.0)
        return np.asarray(envelope * np.cos(self.order * instants.angle + (self.phase - seats)), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class MotionSum:
    """The sum of several components.

    Parameters
    ----------
    parts : sequence of MotionComponent
        At least one.
    """

    parts: Sequence[MotionComponent]

    def advance(self, instants: SamplingInstants) -> FloatArray:
        """Return the displacement towards each probe, m; see `MotionComponent`."""
        total = self.parts[0].advance(instants)
        for part in self.parts[1:]:
            total += part.advance(instants)
        return total


def circular_vectors(amplitude: float, phase: float, angles: tuple[float, float]) -> ComplexArray:
    """Return the vectors at two probes of a forward circular motion with given amplitude, m peak, and phase, rad."""
    return np.asarray(amplitude * np.exp(1j * (phase - np.array(angles))), dtype=np.complex128)


def towards_probes(angles: tuple[float, float], displacement: FloatArray) -> FloatArray:
    """Return a displacement's projections on two probe axes, m; its first axis (2,) holds the bench's X and Y."""
    x, y = displacement
    # Not a matrix product: its rounding depends on the array's length, and so would the codes on the block size.
    return np.stack([x * np.cos(angle) + y * np.sin(angle) for angle in angles])
