"""The prediction at exactly one speed: at once, begun from the map's motions, and then ever better settled."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import AnalysisSettings
from model.dynamics.motion import ShaftMotion
from model.prediction.prediction_map import Prediction, PredictionMap, analyse_motion
from model.rotor.parameters import ModelParameters

ComplexArray = NDArray[np.complex128]

SETTLING_TURNS = 6  # before the first look: what goes round with the shaft is then within 1 %, mostly 0.1 %, of its end
REFINEMENT_TURNS = 64  # before every further one: a whirl changes over hundreds of turns
MAX_REFINEMENTS = 12
SETTLED_CHANGE = 1e-3  # of peak-to-peak from look to look, below which the motion has settled


def predict(
    parameters: ModelParameters, speed: float, prediction_map: PredictionMap, settings: AnalysisSettings
) -> Prediction:
    """Return the motion at a speed, integrated there and not interpolated, as the first of `refine`'s looks shows it.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    speed : float
        rad/s, within the map.
    prediction_map : PredictionMap
        Of the same rotor.
    settings : AnalysisSettings
        The measurement's.

    Returns
    -------
    Prediction
        The growth rate is the map's.

    Raises
    ------
    ValueError
        Outside the map.
    WallContactError
        Where the motion reaches a wall.
    """
    return next(refine(parameters, speed, prediction_map, settings))


def refine(
    parameters: ModelParameters, speed: float, prediction_map: PredictionMap, settings: AnalysisSettings
) -> Iterator[Prediction]:
    """Yield the motion at a speed, first as a few turns show it, then better and better settled until it stays.

    Parameters, units and errors are those of `predict`. Whoever has better to do may leave off after any of them.
    """
    interpolated = prediction_map.at(speed)
    motion = ShaftMotion(parameters, speed, 0)
    motion.resume(*_start(prediction_map, speed, is_whirl_due=interpolated.growth_rate > 0))
    motion.integrate_turns(SETTLING_TURNS)
    size = 0.0
    for _ in range(MAX_REFINEMENTS):
        seen = analyse_motion(motion, parameters, settings, interpolated.growth_rate)
        yield seen
        last, size = size, float(seen.peak_to_peak.max())
        if abs(size - last) < SETTLED_CHANGE * size:
            return
        motion.integrate_turns(REFINEMENT_TURNS)


def _start(prediction_map: PredictionMap, speed: float, *, is_whirl_due: bool) -> tuple[ComplexArray, float]:
    """Return the state to begin from, and its speed, rad/s: between two calm motions, else like the one at hand."""
    speeds, states = prediction_map.speeds, prediction_map.states
    above = max(int(np.searchsorted(speeds, speed)), 1)
    part = (speed - speeds[above - 1]) / (speeds[above] - speeds[above - 1])
    near, far = (above, above - 1) if part > 0.5 else (above - 1, above)
    near_whirls, far_whirls = (bool(np.isfinite(prediction_map.whirl_order[place])) for place in (near, far))
    if not near_whirls and not far_whirls:
        return np.asarray((1 - part) * states[above - 1] + part * states[above]), speed
    start = far if near_whirls != is_whirl_due and far_whirls == is_whirl_due else near
    return states[start], float(speeds[start])
