"""The motion of the simulated shaft at the probes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

FULL_GROWTH = 0.1  # a whirl has its full amplitude this part of its onset speed above the onset
FADE = 0.01  # and is gone over this part of its end speed


class Motion(Protocol):
    """Where the shaft is when each probe is sampled."""

    def advance(self, angle: FloatArray, speed: FloatArray) -> FloatArray:
        """Return the displacement towards each probe, m, at the next samples.

        Parameters
        ----------
        angle : ndarray of float64, shape (2, n)
            Angle turned when each probe is sampled, rad.
        speed : ndarray of float64, shape (n,)
            Shaft speed, rad/s.
        """
        ...


@dataclass(frozen=True, slots=True)
class ToldWhirl:
    """A sub-synchronous component that the bench shows because it is told to.

    Parameters
    ----------
    order : float
        Its frequency over the shaft's.
    onset, end : float
        Shaft speeds between which it lives, rad/s.
    amplitude : float
        At `FULL_GROWTH` above the onset, m peak.
    forward : bool
        Whether it goes round with the shaft.
    phase : float
        Where it is when the shaft's angle is 0, rad.
    """

    order: float
    onset: float
    end: float
    amplitude: float
    forward: bool
    phase: float

    def envelope(self, speed: FloatArray) -> FloatArray:
        """Return its amplitude, m peak, at speeds, rad/s.

        It rises with the square root of the distance from the onset, as a limit cycle born in a Hopf bifurcation does.
        """
        growth = np.sqrt(np.maximum((speed - self.onset) / (FULL_GROWTH * self.onset), 0.0))
        fade = np.clip((self.end - speed) / (FADE * self.end), 0.0, 1.0)
        return np.asarray(self.amplitude * growth * fade, dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class ToldMotion:
    """What the bench is told to show at the probes.

    Parameters
    ----------
    angles : tuple of float
        Where the probes sit, rad.
    speeds : ndarray of float64, shape (m,)
        Grid of speeds, rad/s, rising.
    first : ndarray of complex128, shape (2, m)
        1X vector at each probe over the grid, m peak; x(t) = Re[X exp(i theta)].
    second : ndarray of complex128, shape (2,)
        2X vector at each probe, m peak.
    static : ndarray of float64, shape (2,)
        Steady displacement towards each probe, m.
    whirls : sequence of ToldWhirl
        Sub-synchronous components.
    """

    angles: tuple[float, float]
    speeds: FloatArray
    first: ComplexArray
    second: ComplexArray
    static: FloatArray
    whirls: Sequence[ToldWhirl]

    def advance(self, angle: FloatArray, speed: FloatArray) -> FloatArray:
        """Return the displacement towards each probe, m; see `Motion`."""
        displacement = np.empty_like(angle)
        living = [(whirl, envelope) for whirl in self.whirls if np.any(envelope := whirl.envelope(speed))]
        for probe, seat in enumerate(self.angles):
            theta = angle[probe]
            cosine, sine = np.cos(theta), np.sin(theta)
            first_real = np.interp(speed, self.speeds, self.first[probe].real)
            first_imag = np.interp(speed, self.speeds, self.first[probe].imag)
            second = self.second[probe]
            # Re[X e^ik theta], with cos 2 theta and sin 2 theta from the first order's
            along = cosine * (first_real + 2.0 * (second.real * cosine - second.imag * sine)) - sine * first_imag
            along += self.static[probe] - second.real
            for whirl, envelope in living:
                sense = seat if whirl.forward else -seat
                along += envelope * np.cos(whirl.order * theta + (whirl.phase - sense))
            displacement[probe] = along
        return displacement


def circular(amplitude: float, phase: float, angles: tuple[float, float]) -> ComplexArray:
    """Return the vectors at two probes of a forward circular motion of an amplitude, m peak, and phase, rad."""
    return np.asarray(amplitude * np.exp(1j * (phase - np.array(angles))), dtype=np.complex128)


def along(angles: tuple[float, float], displacement: FloatArray) -> FloatArray:
    """Return the parts towards two probes of a displacement in the bench's X and Y, first axis (2,), m."""
    directions = np.array([[np.cos(angle), np.sin(angle)] for angle in angles])
    return directions @ displacement
