"""The simulated shaft's motion at the probes: run-out, synchronous motion, prescribed whirl, or the rotor model's."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import Acquisition, Role
from analysis.signals.units import MICROMETRE, RPM
from daq.config.rig import Rig, model_parameters
from daq.drivers.simulation import StreamPurpose, random_stream
from daq.drivers.simulation.speed import SpeedProfile
from model.dynamics.motion import STEPS_PER_TURN, ShaftMotion
from model.dynamics.synchronous import synchronous_response
from model.rotor.parameters import ModelParameters

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


def circular_vectors(amplitude: float, phase: float, angles: tuple[float, float]) -> ComplexArray:
    """Return the vectors at two probes of a forward circular motion with given amplitude, m peak, and phase, rad."""
    return np.asarray(amplitude * np.exp(1j * (phase - np.array(angles))), dtype=np.complex128)


def towards_probes(angles: tuple[float, float], displacement: FloatArray) -> FloatArray:
    """Return a displacement's projections on two probe axes, m; its first axis (2,) holds the bench's X and Y."""
    x, y = displacement
    # Not a matrix product: its rounding depends on the array's length, and so would the codes on the block size.
    return np.stack([x * np.cos(angle) + y * np.sin(angle) for angle in angles])


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


def shaft_motion(rig: Rig, speed_profile: SpeedProfile, acquisition: Acquisition) -> list[MotionComponent]:
    """Return the components of the motion that `[simulation]` configures.

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
        return [run_out, ModelMotion(model_parameters(rig.config), speed_profile, acquisition.rate, angles)]
    whirls = [
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
    return [run_out, _synchronous(rig, speed_profile, angles), *whirls]


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
