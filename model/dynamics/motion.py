"""Motion of the shaft in time: modes, gyroscopic moments, films, supports, walls, imbalance and weight.

Newmark's method (beta = 1/4, gamma = 1/2: second order, no numerical damping) in complex modal coordinates; each step
is condensed to where films, supports and walls act on shaft and rings, and Newton's method finds their forces.
"""

import math

import numpy as np
from numpy.typing import NDArray

from model.dynamics.modal_system import ModalSystem
from model.dynamics.newmark import MAX_SUBSTEP_ANGLE, NO_FAILURE, integrate
from model.dynamics.state import NO_LEVEL
from model.errors import WallContactError
from model.rotor.parameters import ModelParameters

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

STEPS_PER_TURN = 64
MIN_SPEED = 50.0  # rad/s: below it a turn's time is no measure for settling or for the step
WALL_CONTACT_ECCENTRICITY = 0.99  # of a film's clearance: the wall is what stops a motion there
MAX_STEP_ANGLE = 64 * MAX_SUBSTEP_ANGLE  # what three divisions by four make small enough, rad


class ShaftMotion:
    """The shaft's motion along any course of angle and speed.

    All state is kept between calls: the result does not depend on how a course is cut into calls, bit for bit. The
    imbalance's term with the angular acceleration, smaller than the kept one by acceleration / speed², is left out.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    speed : float
        Speed at the start, rad/s, 0 or more.
    turns_to_settle : int
        Turns at ``speed`` before the start, from rest in the bearings' centre.
    angle : float
        Of the shaft at the start, rad: the first step leads from there to the first angle given to ``advance``.

    Raises
    ------
    ValueError
        Where speed or turns are negative.
    WallContactError
        Where the motion reaches a wall while it settles, or friction at one drives it without end.
    """

    def __init__(
        self, parameters: ModelParameters, speed: float, turns_to_settle: int = 300, *, angle: float = 0.0
    ) -> None:
        if turns_to_settle < 0:
            raise ValueError(f"turns_to_settle: {turns_to_settle}, expected 0 or more")
        if not math.isfinite(angle):
            raise ValueError(f"angle: {angle} rad, expected a finite value")
        _require_speed(speed)
        self._system, self._rubs = ModalSystem.of(parameters), parameters.rubs
        turning = max(speed, MIN_SPEED)
        step = 2 * math.pi / (STEPS_PER_TURN * turning)
        elapsed = step * np.arange(1 - turns_to_settle * STEPS_PER_TURN, 1, dtype=np.float64)
        self._state = self._system.at_rest(angle=angle - speed * step * elapsed.size, speed=speed)
        self._matrices = self._system.matrices(step)
        self.advance(angle + speed * elapsed, np.full(elapsed.size, float(speed)), step)

    @property
    def speed(self) -> float:
        """Speed of the shaft now, rad/s."""
        return float(self._state.speed[0])

    @property
    def displacement(self) -> FloatArray:
        """Displacement at the probes' station now, (2,), in X and Y, m."""
        now = complex(self._system.shaft.probe @ self._modal)
        return np.array([now.real, now.imag])

    @property
    def state(self) -> ComplexArray:
        """Where the motion is: (3, n_modes + n_rings) displacements, velocities, accelerations of modes and rings."""
        return self._state.motion.copy()

    @property
    def _modal(self) -> ComplexArray:
        """Displacements of the modes now."""
        return self._state.motion[0, : self._system.shaft.squared_frequencies.size]

    def resume(self, state: ComplexArray, speed: float) -> None:
        """Go on at the present angle and speed from a `state` that the same rotor had at another speed, rad/s.

        ValueError where its shape or numbers make no sense, WallContactError where it lies at or beyond a film's wall;
        the motion stays as it was then.
        """
        if state.shape != self._state.motion.shape:
            raise ValueError(f"state: shape {state.shape}, expected {self._state.motion.shape}")
        if not np.isfinite(state).all():
            raise ValueError("state: expected finite values, m, m/s, m/s²")
        _require_speed(speed)
        self._require_within(state, speed)
        self._state.motion[:] = state
        self._state.level[0] = NO_LEVEL
        present, self._state.speed[0] = self.speed, speed
        self.change_speed(present)

    def change_speed(self, speed: float) -> None:
        """Go on at another speed, rad/s, above 0, at once: velocities grow with the speed, places stay."""
        _require_speed(speed)
        ratio = speed / max(self.speed, MIN_SPEED)
        self._state.motion[1] *= ratio
        self._state.motion[2] *= ratio**2
        self._state.speed[0] = speed

    def set_initial_state(self, initial_state: FloatArray) -> None:
        """Put the motion where a `SynchronousOrbit` stands; exact from the next step on.

        WallContactError where that is at or beyond a film's wall: the motion cannot be continued then.
        """
        self._state.set_initial_state(initial_state)
        self._require_within(self._state.motion, self.speed)

    def disturb(self, disturbance: FloatArray) -> None:
        """Move the motion by a part of a `SynchronousOrbit`'s disturbance; errors are `set_initial_state`'s."""
        self._state.disturb(disturbance)
        self._require_within(self._state.motion, self.speed)

    def integrate_turns(self, count: int, points_per_turn: int = STEPS_PER_TURN) -> FloatArray:
        """Follow the shaft through whole turns at its present speed, which must not be 0.

        Parameters
        ----------
        count : int
            Turns.
        points_per_turn : int
            Steps in a turn.

        Returns
        -------
        ndarray of float64, shape (2, count * points_per_turn)
            Displacement at the probes' station in X and Y, m, from the present angle on (the end of the last turn is
            not in it).
        """
        return np.asarray(self._integrate_turns(self._system.shaft.probe[None, :], count, points_per_turn)[0])

    def integrate_stations(self, count: int, points_per_turn: int = STEPS_PER_TURN) -> FloatArray:
        """Follow the shaft as `turns` does and return what every station does, (n_stations, 2, n), m."""
        return self._integrate_turns(self._system.stations, count, points_per_turn)

    def integrate_stations_and_films(
        self, count: int, points_per_turn: int = STEPS_PER_TURN
    ) -> tuple[FloatArray, FloatArray]:
        """Follow the shaft as `turns` does and return what every station and every film does.

        Returns
        -------
        stations : ndarray of float64, shape (n_stations, 2, n)
            Displacement in X and Y, m.
        eccentricities : ndarray of float64, shape (4, 2, n)
            Of the films in X and Y, in parts of their clearances: journals in their rings, then rings in the housing.
        """
        system = self._system
        stations, modes = system.stations.shape
        outputs = np.concatenate((np.zeros((stations, system.eccentricities.shape[1])), system.eccentricities))
        outputs[:stations, :modes] = system.stations
        whole = self._integrate_turns(outputs, count, points_per_turn)
        return whole[:stations], whole[stations:]

    def _integrate_turns(self, outputs: FloatArray, count: int, points_per_turn: int) -> FloatArray:
        if self.speed == 0:
            raise ValueError("speed: 0 rad/s, expected a turning shaft")
        turn = 2 * math.pi / points_per_turn
        angle = self._state.angle[0] + turn * np.arange(1, count * points_per_turn + 1)
        now = np.array([sum(row * self._state.motion[0, : row.size]) for row in outputs])  # in the march's order
        later = self._advance(angle, np.full(angle.size, self.speed), turn / self.speed, outputs)
        first = np.stack((now.real, now.imag), axis=-1)[..., None]
        return np.concatenate((first, later[..., :-1]), axis=-1)

    def advance(self, angle: FloatArray, speed: FloatArray, step: float) -> FloatArray:
        """Follow the shaft through further time steps.

        Parameters
        ----------
        angle : ndarray of float64, shape (n,)
            Of the shaft at the ends of the steps, rad.
        speed : ndarray of float64, shape (n,)
            Of the shaft there, rad/s, 0 or more.
        step : float
            Time step, s. Steps in which the shaft makes more than 1/48 turn, or touches a wall, are divided inside.

        Returns
        -------
        ndarray of float64, shape (2, n)
            Displacement at the probes' station in the bench's directions X and Y, m, from the bearings' centre.

        Raises
        ------
        ValueError
            Where shapes, speeds or the step make no sense.
        WallContactError
            Where the motion reaches a bearing's wall, or friction at a wall drives it without end; it cannot be
            continued then.
        """
        return np.asarray(self._advance(angle, speed, step, self._system.shaft.probe[None, :])[0])

    def _advance(self, angle: FloatArray, speed: FloatArray, step: float, outputs: FloatArray) -> FloatArray:
        angle, speed = np.ascontiguousarray(angle, np.float64), np.ascontiguousarray(speed, np.float64)
        if angle.ndim != 1 or angle.shape != speed.shape:
            raise ValueError(f"angle, speed: shapes {angle.shape} and {speed.shape}, expected (n,) twice")
        if not (math.isfinite(step) and step > 0):
            raise ValueError(f"step: {step:g} s, expected a finite value above 0")
        if not np.isfinite(angle).all():
            raise ValueError("angle: expected finite values, rad")
        if angle.size:
            _require_speed(float(speed[np.argmin(speed)]))
            _require_speed(float(speed[np.argmax(speed)]))
            fastest = max(float(speed.max()), self.speed)
            if step * fastest > MAX_STEP_ANGLE:
                raise ValueError(
                    f"step: {step:g} s, expected at most {MAX_STEP_ANGLE / fastest:g} s at {fastest:g} rad/s "
                    f"({MAX_STEP_ANGLE / (2 * math.pi):.1f} turns)"
                )
        if step != self._matrices.steps[0]:
            self._matrices = self._system.matrices(step)
        path = np.empty((outputs.shape[0], angle.size), np.complex128)
        system = self._system
        failed = integrate(system.parts, system.constraints, self._matrices, self._state, angle, speed, outputs, path)
        if failed != NO_FAILURE:
            raise WallContactError(self._failure_message(float(speed[failed])))
        return np.stack((path.real, path.imag), axis=1)

    def _require_within(self, motion: ComplexArray, speed: float) -> None:
        """Raise WallContactError where a film's wall is reached."""
        if not self._system.is_inside_clearances(motion):
            raise WallContactError(self._max_eccentricity(motion, speed)[1])

    def _failure_message(self, speed: float) -> str:
        """Return why a motion ends that could not be continued."""
        eccentricity, said = self._max_eccentricity(self._state.motion, speed)
        if not self._rubs or eccentricity >= WALL_CONTACT_ECCENTRICITY:
            return said
        rates = np.abs(self._system.stations @ self._state.motion[1, : self._modal.size])
        rub = max(self._rubs, key=lambda rub: float(rates[rub.station - 1]))
        return (
            f"rub: the shaft bounces at {rates[rub.station - 1]:.3g} m/s on the wall of station {rub.station} at "
            f"{speed:.1f} rad/s, faster than any step follows, expected less friction than {rub.friction:g}"
        )

    def _max_eccentricity(self, motion: ComplexArray, speed: float) -> tuple[float, str]:
        """Return the largest eccentricity ratio of a motion, and in words where that is."""
        films, ratios = self._system.films, np.abs(self._system.eccentricities @ motion[0])
        closest = int(np.argmax(ratios))
        film, body, clearance = (
            ("inner", "journal", films.inner_clearance) if closest < 2 else ("outer", "ring", films.outer_clearance)
        )
        return float(ratios[closest]), (
            f"eccentricity: the {body} came to {ratios[closest] * clearance * 1e6:.2f} µm of the {film} film's "
            f"clearance of {clearance * 1e6:g} µm at {speed:.1f} rad/s, expected less than the clearance: the shaft "
            "touches the wall"
        )


def _require_speed(speed: float) -> None:
    if not (math.isfinite(speed) and speed >= 0):
        raise ValueError(f"speed: {speed:g} rad/s, expected a finite value, 0 or more")
