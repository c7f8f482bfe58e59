"""Predicted vibration at the probes: a map over speed, computed once and interpolated, and refinement at one speed.

Predictions have the same form as measurements: order spectrum, vectors, whirl component, orbit.
"""

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, fields
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from analysis.signals import ComplexArray, FloatArray
from analysis.signals.header import AnalysisSettings
from analysis.signals.probes import ProbePair
from analysis.signals.units import NUMBER, PEAK_TO_PEAK, RATE, RPM, SPEED
from analysis.spectra.order_map import order_spectrum, order_vectors
from analysis.spectra.windows import WINDOWS
from analysis.whirl.components import find_whirl, noise_floor
from model.dynamics.motion import STEPS_PER_TURN, ShaftMotion
from model.dynamics.stability import SynchronousOrbit, synchronous_orbit
from model.errors import NoSolutionError, ParameterError
from model.rotor.parameters import ModelParameters
from model.rotor.rotor import require_rising

MODEL_VERSION = 5  # increase with every change of the model's results
NUMERICAL_FLOOR = 5e-9  # m peak: noise of rounding and incomplete settling between the lines
SETTLING_TURNS = 200  # to settle at the lowest speed
CHECK_TURNS = 32  # turns between two checks whether the motion has settled
SETTLED_CHANGE = 0.01  # relative change of peak-to-peak below which the motion has settled
DISTURBANCE = 0.1  # of the inner clearance: size of the disturbance of an unstable motion
FIRST_TURNS = 6  # before the first prediction: 1X is then within 1 %, mostly 0.1 %, of its final value
REFINEMENT_TURNS = 64  # between predictions: a whirl changes over hundreds of turns
MAX_REFINEMENTS = 12
REFINED_CHANGE = 1e-3  # relative change of peak-to-peak below which the motion has settled


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Predicted steady-state vibration at the probes.

    Parameters
    ----------
    orders : ndarray of float64, shape (n_orders,)
        Order axis, from 0.
    spectrum : ndarray of float64, shape (2, n_orders)
        Order spectrum at the probes x and y with the window of the settings, m peak.
    vectors : ndarray of complex128, shape (2, 2)
        ``vectors[k - 1, probe]``: the kX vector, k = 1, 2, m peak, x(t) = Re[X exp(i k theta)].
    whirl_amplitude : float
        Semi-major axis of this component, m peak; 0 without one.
    orbit : ndarray of float64, shape (2, n_points)
        Motion in X and Y over a few whole revolutions from theta = 0, mean removed, m.
    """

    speed: Annotated[float, SPEED.of("Shaft speed")]
    orders: FloatArray
    spectrum: FloatArray
    vectors: ComplexArray
    whirl_order: Annotated[float, NUMBER.of("Order of the strongest component below 1X; unknown without one")]
    whirl_amplitude: float
    peak_to_peak: Annotated[FloatArray, PEAK_TO_PEAK.of("Overall vibration", at_probes=True)]
    orbit: FloatArray
    growth_rate: Annotated[
        float, RATE.of("Growth rate of the least stable whirl about the 1X motion; positive: unstable")
    ]
    is_exact: Annotated[
        bool, NUMBER.of("True where the motion is integrated at this speed, false where interpolated")
    ] = False


MIN_CHECKS_STABLE, MIN_CHECKS_UNSTABLE, MAX_CHECKS = 2, 6, 24  # checks at a speed


@dataclass(frozen=True, slots=True, eq=False)
class PredictionMap:
    """Predictions at rising speeds, with interpolation.

    Parameters
    ----------
    speeds : ndarray of float64, shape (n,)
        Rising, rad/s.
    orders : ndarray of float64, shape (n_orders,)
        Order axis, from 0.
    spectrum : ndarray of float64, shape (n, 2, n_orders)
        Order spectra at the probes, m peak.
    vectors : ndarray of complex128, shape (n, 2, 2)
        kX vectors by order and probe, m peak.
    whirl_order, whirl_amplitude : ndarray of float64, shape (n,)
        Strongest sub-synchronous component: order, NaN without one, and semi-major axis, m peak.
    peak_to_peak : ndarray of float64, shape (n, 2)
        Overall vibration at the probes, m peak-to-peak.
    orbit : ndarray of float64, shape (n, 2, n_points)
        Motion in X and Y over a few whole revolutions from theta = 0, mean removed, m.
    growth_rate : ndarray of float64, shape (n,)
        Growth rate of the least stable whirl of the synchronous motion, 1/s.
    states : ndarray of complex128, shape (n, 3, n_modes + 2)
        State of the motion at theta = 0, to continue from (`model.dynamics.motion.ShaftMotion.state`).
    """

    speeds: FloatArray
    orders: FloatArray
    spectrum: FloatArray
    vectors: ComplexArray
    whirl_order: FloatArray
    whirl_amplitude: FloatArray
    peak_to_peak: FloatArray
    orbit: FloatArray
    growth_rate: FloatArray
    states: ComplexArray

    def __post_init__(self) -> None:
        n, n_orders = self.speeds.size, self.orders.size
        shapes: dict[str, tuple[int, ...]] = {
            "speeds": (n,),
            "orders": (n_orders,),
            "spectrum": (n, 2, n_orders),
            "vectors": (n, 2, 2),
            "whirl_order": (n,),
            "whirl_amplitude": (n,),
            "peak_to_peak": (n, 2),
            "orbit": (n, 2, self.orbit.shape[-1]),
            "growth_rate": (n,),
            "states": (n, 3, self.states.shape[-1]),
        }
        for name, shape in shapes.items():
            array = getattr(self, name)
            if array.shape != shape or array.dtype != (np.complex128 if name in {"vectors", "states"} else np.float64):
                raise ValueError(f"{name}: {array.dtype} of shape {array.shape}, expected shape {shape}")
        require_rising(self.speeds)

    def at(self, speed: float) -> Prediction:
        """Return the prediction at a speed.

        Parameters
        ----------
        speed : float
            rad/s, within the map.

        Returns
        -------
        Prediction
            Spectrum, vectors and peak-to-peak interpolated linearly; the orbit is that of the nearest speed.

        Raises
        ------
        ParameterError
            If the speed is outside the map.
        """
        lowest, highest = float(self.speeds[0]), float(self.speeds[-1])
        if not lowest <= speed <= highest:
            raise ParameterError(f"speed: {speed:g} rad/s, expected {lowest:g} to {highest:g} rad/s, the map's range")
        above = max(int(np.searchsorted(self.speeds, speed)), 1)
        below = above - 1
        part = (speed - self.speeds[below]) / (self.speeds[above] - self.speeds[below])
        nearest = above if part > 0.5 else below

        def between(array: NDArray[np.generic]) -> NDArray[np.generic]:
            return np.asarray((1 - part) * array[below] + part * array[above])

        same_whirl = abs(self.whirl_order[above] - self.whirl_order[below]) < 0.1  # false where one is NaN
        return Prediction(
            speed=float(speed),
            orders=self.orders,
            spectrum=np.asarray(between(self.spectrum), np.float64),
            vectors=np.asarray(between(self.vectors), np.complex128),
            whirl_order=float(between(self.whirl_order) if same_whirl else self.whirl_order[nearest]),
            whirl_amplitude=float(between(self.whirl_amplitude) if same_whirl else self.whirl_amplitude[nearest]),
            peak_to_peak=np.asarray(between(self.peak_to_peak), np.float64),
            orbit=self.orbit[nearest],
            growth_rate=float(between(self.growth_rate)),
        )

    def to_arrays(self) -> dict[str, NDArray[np.generic]]:
        """Return the map as arrays by name, for storage."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[np.generic]]) -> "PredictionMap":
        """Return the map from the arrays of `to_arrays`; ValueError if an array is missing or has a wrong shape."""
        names = [field.name for field in fields(cls)]
        missing = [name for name in names if name not in arrays]
        if missing:
            raise ValueError(f"prediction map: {', '.join(missing)} missing, expected {', '.join(names)}")
        return cls(**{name: np.asarray(arrays[name]) for name in names})


def default_map_speeds(highest: float) -> FloatArray:
    """Return the speeds of a map up to ``highest``, rad/s: from 500 r/min in steps of about 250 r/min."""
    lowest = 500 * RPM
    if not (math.isfinite(highest) and highest > lowest):
        raise ParameterError(f"highest: {highest:g} rad/s, expected more than {lowest:g} rad/s")
    steps = max(1, math.ceil((highest - lowest) / (250 * RPM) - 1e-9))
    return np.linspace(lowest, highest, steps + 1)


def prediction_map_key(parameters: ModelParameters, speeds: FloatArray, settings: AnalysisSettings) -> str:
    """Return a hexadecimal hash of all inputs of a map and of the model version: the cache key."""
    inputs = {
        "version": MODEL_VERSION,
        "parameters": asdict(parameters),
        "settings": {name: value for name, value in asdict(settings).items() if name != "runout"},
        "speeds": [float(speed) for speed in speeds],
    }
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


def compute_prediction_map(
    parameters: ModelParameters,
    speeds: FloatArray,
    settings: AnalysisSettings,
    on_progress: Callable[[int, int], None],
) -> PredictionMap:
    """Compute a prediction map: the settled motion at each speed, started from that at the previous speed.

    A shaft that did not whirl at the previous speed starts on the synchronous orbit. An unstable orbit is disturbed
    along its unstable whirl: a real rotor is always disturbed, while rounding alone takes thousands of turns.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    speeds : ndarray of float64, shape (n,)
        Rising, above 0, at least two, rad/s.
    settings : AnalysisSettings
        Analysis settings of the measurement: they define order axis and window.
    on_progress : callable
        Called after each speed with the numbers of finished and of all speeds.

    Returns
    -------
    PredictionMap
        Predictions of a slow run-up.

    Raises
    ------
    ParameterError
        If the speeds are not rising.
    WallContactError
        If the motion reaches a wall.
    """
    speeds = np.asarray(speeds, np.float64)
    require_rising(speeds)
    motion = ShaftMotion(parameters, float(speeds[0]), SETTLING_TURNS)
    disturbance = DISTURBANCE * parameters.floating_ring.inner_clearance
    synchronous: SynchronousOrbit | None = None
    is_whirling = False
    predictions, states = [], []
    for done, speed in enumerate(speeds, 1):
        try:
            synchronous = synchronous_orbit(parameters, float(speed), synchronous)
        except NoSolutionError:  # far above the onset there may be no orbit within the clearances
            synchronous = None
        growth_rate = math.nan if synchronous is None else synchronous.growth_rate
        motion.change_speed(float(speed))
        if synchronous is not None and not is_whirling:
            motion.set_initial_state(
                synchronous.initial_state + (disturbance if growth_rate > 0 else 0.0) * synchronous.disturbance
            )
        is_whirling = _settle(motion, MIN_CHECKS_UNSTABLE if growth_rate > 0 else MIN_CHECKS_STABLE, disturbance)
        predictions.append(analyse_motion(motion, parameters, settings, growth_rate))
        states.append(motion.state)
        on_progress(done, speeds.size)
    return PredictionMap(
        speeds=speeds,
        orders=predictions[0].orders,
        spectrum=np.stack([one.spectrum for one in predictions]),
        vectors=np.stack([one.vectors for one in predictions]),
        whirl_order=np.array([one.whirl_order for one in predictions]),
        whirl_amplitude=np.array([one.whirl_amplitude for one in predictions]),
        peak_to_peak=np.stack([one.peak_to_peak for one in predictions]),
        orbit=np.stack([one.orbit for one in predictions]),
        growth_rate=np.array([one.growth_rate for one in predictions]),
        states=np.stack(states),
    )


def _settle(motion: ShaftMotion, min_checks: int, disturbance: float) -> bool:
    """Integrate until the vibration has settled; return whether the motion is not only synchronous."""
    last = 0.0
    for check in range(1, MAX_CHECKS + 1):
        path = motion.integrate_turns(CHECK_TURNS)
        size = float(np.ptp(path, axis=1).max())
        if check >= min_checks and abs(size - last) < SETTLED_CHANGE * size:
            break
        last = size
    once_per_turn = path[:, ::STEPS_PER_TURN]
    return float(np.ptp(once_per_turn, axis=1).max()) > disturbance


def analyse_motion(
    motion: ShaftMotion, parameters: ModelParameters, settings: AnalysisSettings, growth_rate: float
) -> Prediction:
    """Integrate some turns and return their prediction, with the analysis used for measurements.

    Parameters
    ----------
    motion : ShaftMotion
        Settled, at theta = 0; advanced by whole turns.
    parameters, settings : ModelParameters, AnalysisSettings
        The rotor and the analysis settings of the measurement.
    growth_rate : float
        Growth rate to store in the prediction, 1/s.

    Returns
    -------
    Prediction
        Prediction at the speed of the motion.
    """
    pair = ProbePair(*parameters.probe_angles)
    revolutions = settings.revolutions
    points = settings.points_per_revolution * math.ceil(STEPS_PER_TURN / settings.points_per_revolution)
    stride = points // settings.points_per_revolution
    path = motion.integrate_turns(revolutions, points)
    path -= path.mean(axis=1, keepdims=True)
    waveform = pair.to_probes(path)
    orders, spectrum = order_spectrum(waveform[:, ::stride], revolutions, WINDOWS[settings.window])
    wanted = int(np.searchsorted(orders, settings.highest_order, side="right"))
    orders, spectrum = orders[:wanted], spectrum[:, :wanted]
    hann = order_spectrum(waveform[:, ::stride], revolutions)[1][:, :wanted]  # the window of the search below 1X
    whirl = find_whirl(hann, revolutions, max(NUMERICAL_FLOOR, noise_floor(hann, revolutions)), pair)
    orbit = path[:, -min(settings.orbit_revolutions, revolutions) * points :: stride]
    return Prediction(
        speed=motion.speed,
        orders=orders,
        spectrum=np.abs(spectrum),
        vectors=order_vectors(spectrum, revolutions, 2),
        whirl_order=math.nan if whirl is None else whirl.order,
        whirl_amplitude=0.0 if whirl is None else whirl.amplitude,
        peak_to_peak=np.ptp(waveform, axis=1),
        orbit=np.ascontiguousarray(orbit - orbit.mean(axis=1, keepdims=True)),
        growth_rate=growth_rate,
        is_exact=True,
    )


def predict(
    parameters: ModelParameters, speed: float, prediction_map: PredictionMap, settings: AnalysisSettings
) -> Prediction:
    """Return the prediction at a speed by integration, not interpolation: the first one of `refine`.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    speed : float
        rad/s, within the map.
    prediction_map : PredictionMap
        Prediction map of the same rotor.
    settings : AnalysisSettings
        Analysis settings of the measurement.

    Returns
    -------
    Prediction
        The growth rate is that of the map.

    Raises
    ------
    ParameterError
        If the speed is outside the map.
    WallContactError
        If the motion reaches a wall.
    """
    return next(refine(parameters, speed, prediction_map, settings))


def refine(
    parameters: ModelParameters, speed: float, prediction_map: PredictionMap, settings: AnalysisSettings
) -> Iterator[Prediction]:
    """Yield predictions at a speed, the first after a few turns, then refined until the motion has settled.

    Parameters, units and errors are those of `predict`. The caller may stop after any prediction.
    """
    interpolated = prediction_map.at(speed)
    motion = ShaftMotion(parameters, speed, 0)
    motion.resume(*_start(prediction_map, speed, is_whirl_due=interpolated.growth_rate > 0))
    motion.integrate_turns(FIRST_TURNS)
    size = 0.0
    for _ in range(MAX_REFINEMENTS):
        prediction = analyse_motion(motion, parameters, settings, interpolated.growth_rate)
        yield prediction
        last, size = size, float(prediction.peak_to_peak.max())
        if abs(size - last) < REFINED_CHANGE * size:
            return
        motion.integrate_turns(REFINEMENT_TURNS)


def _start(prediction_map: PredictionMap, speed: float, *, is_whirl_due: bool) -> tuple[ComplexArray, float]:
    """Return the start state and its speed, rad/s: interpolated without whirl, else the state of a neighbour.

    Of the two neighbours, the nearest is taken unless only the other one whirls, or does not, as expected.
    """
    speeds, states = prediction_map.speeds, prediction_map.states
    above = max(int(np.searchsorted(speeds, speed)), 1)
    part = (speed - speeds[above - 1]) / (speeds[above] - speeds[above - 1])
    near, far = (above, above - 1) if part > 0.5 else (above - 1, above)
    near_whirls, far_whirls = (bool(np.isfinite(prediction_map.whirl_order[index])) for index in (near, far))
    if not near_whirls and not far_whirls:
        return np.asarray((1 - part) * states[above - 1] + part * states[above]), speed
    start = far if near_whirls != is_whirl_due and far_whirls == is_whirl_due else near
    return states[start], float(speeds[start])
