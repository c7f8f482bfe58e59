"""Motion of the shaft in time under imbalance and weight, on films, supports and walls.

Newmark's method (beta = 1/4, gamma = 1/2: second order, no numerical damping) in complex modal coordinates. Each step
is condensed to the points where films, supports and walls act, and Newton's method solves for their forces.
"""

import math

import numpy as np

from analysis.signals import ComplexArray, FloatArray
from analysis.signals.units import MICROMETRE
from model.dynamics.modal_system import NO_LEVEL, ModalSystem
from model.dynamics.newmark import MAX_SUBSTEP_ANGLE, NO_FAILURE, integrate
from model.errors import ParameterError, WallContactError
from model.rotor.parameters import ModelParameters

STEPS_PER_TURN = 64
MIN_SPEED = 50.0  # rad/s: at lower speeds time steps and settling do not scale with the revolution
WALL_CONTACT_ECCENTRICITY = 0.99  # eccentricity ratio above which a failed step is a contact with the film wall
MAX_STEP_ANGLE = 64 * MAX_SUBSTEP_ANGLE  # rad: three divisions by four reach the largest substep


class ShaftMotion:
    """Motion of the shaft along any time history of angle and speed.

    The state is preserved between calls, so the result does not depend, bit for bit, on how a time history is divided
    into calls. The angular acceleration of a step is that of its speeds; in the gyroscopic moments it is neglected.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    speed : float
        Speed at the start, rad/s, 0 or more.
    turns_to_settle : int
        Turns at ``speed`` before the start, from rest in the bearing centre.
    angle : float
        Of the shaft at the start, rad: the first step goes from there to the first angle passed to ``advance``.

    Raises
    ------
    ValueError
        If speed or turns are negative.
    WallContactError
        If the motion reaches a film wall while it settles, or is driven unstable by friction at a wall.
    """

    def __init__(
        self, parameters: ModelParameters, speed: float, turns_to_settle: int = 300, *, angle: float = 0.0
    ) -> None:
        if turns_to_settle < 0:
            raise ValueError(f"turns_to_settle: {turns_to_settle}, expected 0 or more")
        if not math.isfinite(angle):
            raise ValueError(f"angle: {angle} rad, expected a finite value")
        _require_speed(speed)
        self._system, self._rubs = ModalSystem.from_parameters(parameters), parameters.rubs
        turning = max(speed, MIN_SPEED)
        step = 2 * math.pi / (STEPS_PER_TURN * turning)
        elapsed = step * np.arange(1 - turns_to_settle * STEPS_PER_TURN, 1, dtype=np.float64)
        self._state = self._system.at_rest(angle=angle - speed * step * elapsed.size, speed=speed)
        self._matrices = self._system.matrices(step)
        self.advance(angle + speed * elapsed, np.full(elapsed.size, float(speed)), step)

    @property
    def speed(self) -> float:
        """Present speed of the shaft, rad/s."""
        return float(self._state.speed[0])

    @property
    def displacement(self) -> FloatArray:
        """Present displacement at the station of the probes, (2,), in X and Y, m."""
        now = complex(self._system.shaft.probe @ self._modal)
        return np.array([now.real, now.imag])

    @property
    def state(self) -> ComplexArray:
        """Present state: displacements, velocities, accelerations of modes and rings, (3, n_modes + n_rings)."""
        return self._state.motion.copy()

    @property
    def _modal(self) -> ComplexArray:
        """Present displacements of the modes."""
        return self._state.motion[0, : self._system.shaft.squared_frequencies.size]

    def resume(self, state: ComplexArray, speed: float) -> None:
        """Continue at the present angle and speed from a `state` of the same rotor at another speed, rad/s.

        Raises ValueError for an invalid state and WallContactError for one at or beyond a film wall; the motion is then
        unchanged.
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
        """Change the speed, rad/s, above 0, at once: positions stay, velocities scale with the speed."""
        _require_speed(speed)
        ratio = speed / max(self.speed, MIN_SPEED)
        self._state.motion[1] *= ratio
        self._state.motion[2] *= ratio**2
        self._state.speed[0] = speed

    def set_initial_state(self, initial_state: FloatArray) -> None:
        """Set the motion to the initial state of a `SynchronousOrbit`, exact from the next step on.

        Raises WallContactError at or beyond a film wall; the motion cannot be continued then.
        """
        self._state.set_initial_state(initial_state)
        self._require_within(self._state.motion, self.speed)

    def disturb(self, disturbance: FloatArray) -> None:
        """Add a fraction of a disturbance of a `SynchronousOrbit`; raises the errors of `set_initial_state`."""
        self._state.disturb(disturbance)
        self._require_within(self._state.motion, self.speed)

    def integrate_turns(self, count: int, points_per_turn: int = STEPS_PER_TURN) -> FloatArray:
        """Integrate over whole turns at the present speed, which must not be 0.

        Parameters
        ----------
        count : int
            Number of turns.
        points_per_turn : int
            Steps per turn.

        Returns
        -------
        ndarray of float64, shape (2, count * points_per_turn)
            Displacement at the station of the probes in X and Y, m, from the present angle on, without the end of the
            last turn.
        """
        return np.asarray(self._integrate_turns(self._system.shaft.probe[None, :], count, points_per_turn)[0])

    def integrate_stations(self, count: int, points_per_turn: int = STEPS_PER_TURN) -> FloatArray:
        """Integrate as `integrate_turns` does; return the displacement of all stations, (n_stations, 2, n), m."""
        return self._integrate_turns(self._system.stations, count, points_per_turn)

    def integrate_stations_and_films(
        self, count: int, points_per_turn: int = STEPS_PER_TURN
    ) -> tuple[FloatArray, FloatArray]:
        """Integrate as `integrate_turns` does; return the motion of all stations and films.

        Returns
        -------
        stations : ndarray of float64, shape (n_stations, 2, n)
            Displacement in X and Y, m.
        eccentricities : ndarray of float64, shape (4, 2, n)
            Eccentricity ratios of the films in X and Y: journals in their rings, then rings in the housing.
        """
        system = self._system
        stations, modes = system.stations.shape
        outputs = np.concatenate((np.zeros((stations, system.eccentricities.shape[1])), system.eccentricities))
        outputs[:stations, :modes] = system.stations
        displacements = self._integrate_turns(outputs, count, points_per_turn)
        return displacements[:stations], displacements[stations:]

    def _integrate_turns(self, outputs: FloatArray, count: int, points_per_turn: int) -> FloatArray:
        if self.speed == 0:
            raise ValueError("speed: 0 rad/s, expected a turning shaft")
        turn = 2 * math.pi / points_per_turn
        angle = self._state.angle[0] + turn * np.arange(1, count * points_per_turn + 1)
        now = np.array(
            [sum(row * self._state.motion[0, : row.size]) for row in outputs]
        )  # same order of summation as in `newmark.integrate`
        later = self._advance(angle, np.full(angle.size, self.speed), turn / self.speed, outputs)
        first = np.stack((now.real, now.imag), axis=-1)[..., None]
        return np.concatenate((first, later[..., :-1]), axis=-1)

    def advance(self, angle: FloatArray, speed: FloatArray, step: float) -> FloatArray:
        """Integrate over further time steps.

        Parameters
        ----------
        angle : ndarray of float64, shape (n,)
            Angle of the shaft at the ends of the steps, rad.
        speed : ndarray of float64, shape (n,)
            Speed of the shaft at the ends of the steps, rad/s, 0 or more.
        step : float
            Time step, s. Steps of more than 1/48 turn, or in contact with a wall, are divided internally.

        Returns
        -------
        ndarray of float64, shape (2, n)
            Displacement from the bearing centre at the station of the probes, in X and Y, m.

        Raises
        ------
        ValueError
            If shapes, speeds or the step are invalid.
        WallContactError
            If the motion reaches a film wall, or is driven unstable by friction at a wall; it cannot be continued then.
        """
        return np.asarray(self._advance(angle, speed, step, self._system.shaft.probe[None, :])[0])

    def _advance(self, angle: FloatArray, speed: FloatArray, step: float, outputs: FloatArray) -> FloatArray:
        angle, speed = np.asarray(angle, np.float64), np.asarray(speed, np.float64)
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
        history = np.stack((angle, speed))
        failed = integrate(system.parts, system.constraints, self._matrices, self._state, history, outputs, path)
        if failed != NO_FAILURE:
            raise WallContactError(self._failure_message(float(speed[failed])))
        return np.stack((path.real, path.imag), axis=1)

    def _require_within(self, motion: ComplexArray, speed: float) -> None:
        """Raise WallContactError if a film wall is reached."""
        if not self._system.is_inside_clearances(motion):
            raise WallContactError(self._max_eccentricity(motion, speed)[1])

    def _failure_message(self, speed: float) -> str:
        """Return the message for a failed step."""
        eccentricity, message = self._max_eccentricity(self._state.motion, speed)
        if not self._rubs or eccentricity >= WALL_CONTACT_ECCENTRICITY:
            return message
        rates = np.abs(self._system.stations @ self._state.motion[1, : self._modal.size])
        rub = max(self._rubs, key=lambda rub: float(rates[rub.station - 1]))
        return (
            f"rub: the shaft bounces at {rates[rub.station - 1]:.3g} m/s on the wall of station {rub.station} at "
            f"{speed:.1f} rad/s, faster than the shortest time step resolves, expected less "
            f"friction than {rub.friction:g}"
        )

    def _max_eccentricity(self, motion: ComplexArray, speed: float) -> tuple[float, str]:
        """Return the largest eccentricity ratio of a motion, and a message naming the film; 0 without films."""
        films, ratios = self._system.films, np.abs(self._system.eccentricities @ motion[0])
        if films is None:
            return 0.0, ""
        closest = int(np.argmax(ratios))
        film, body, clearance = (
            ("inner", "journal", films.inner_clearance) if closest < 2 else ("outer", "ring", films.outer_clearance)
        )
        return float(ratios[closest]), (
            f"eccentricity: the {body} reached {ratios[closest] * clearance / MICROMETRE:.2f} µm of the {film} film's "
            f"clearance of {clearance / MICROMETRE:g} µm at {speed:.1f} rad/s, expected less than the clearance: "
            "the shaft touches the wall"
        )


def _require_speed(speed: float) -> None:
    if not (math.isfinite(speed) and speed >= 0):
        raise ParameterError(f"speed: {speed:g} rad/s, expected a finite value, 0 or more")
