"""Prediction at an exact speed by integration, started from the prediction map and refined in steps."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import AnalysisSettings
from model.dynamics.motion import ShaftMotion
from model.prediction.prediction import Prediction
from model.prediction.prediction_map import PredictionMap, analyse_motion
from model.rotor.parameters import ModelParameters

ComplexArray = NDArray[np.complex128]

SETTLING_TURNS = 6  # before the first prediction: 1X is then within 1 %, mostly 0.1 %, of its final value
REFINEMENT_TURNS = 64  # between predictions: a whirl changes over hundreds of turns
MAX_REFINEMENTS = 12
SETTLED_CHANGE = 1e-3  # relative change of peak-to-peak below which the motion has settled


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
    motion.integrate_turns(SETTLING_TURNS)
    size = 0.0
    for _ in range(MAX_REFINEMENTS):
        prediction = analyse_motion(motion, parameters, settings, interpolated.growth_rate)
        yield prediction
        last, size = size, float(prediction.peak_to_peak.max())
        if abs(size - last) < SETTLED_CHANGE * size:
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
