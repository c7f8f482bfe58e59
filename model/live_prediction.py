"""The prediction at exactly one speed, fast enough to follow the operator: begun from the map's nearest motion."""

import numpy as np

from analysis.run import AnalysisSettings
from model.motion import ShaftMotion
from model.parameters import ModelParameters
from model.prediction import Prediction
from model.prediction_map import PredictionMap, look_at

TURNS_TO_SETTLE = 16  # from a speed 1 % away: peak-to-peak within 1 % of where it ends


def predict(
    parameters: ModelParameters, speed: float, prediction_map: PredictionMap, settings: AnalysisSettings
) -> Prediction:
    """Return the motion at a speed, integrated there and not interpolated.

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
        Settled for a few turns from the map's motion at the nearest speed; the growth rate is the map's.

    Raises
    ------
    ValueError
        Outside the map.
    WallContactError
        Where the motion reaches a wall.
    """
    growth_rate = prediction_map.at(speed).growth_rate
    nearest = int(np.argmin(np.abs(prediction_map.speeds - speed)))
    motion = ShaftMotion(parameters, speed, 0)
    motion.resume(prediction_map.states[nearest], float(prediction_map.speeds[nearest]))
    motion.turns(TURNS_TO_SETTLE)
    return look_at(motion, parameters, settings, growth_rate)
