import numpy as np
import pytest

from analysis.run import AnalysisSettings
from model.gj90c import gj90c
from model.live_prediction import predict
from model.motion import ShaftMotion
from model.prediction_map import PredictionMap, compute_prediction_map

SETTINGS = AnalysisSettings()


@pytest.fixture(scope="module")
def coarse() -> PredictionMap:
    return compute_prediction_map(gj90c(), np.array([600.0, 626.0, 1040.0, 1066.0]), SETTINGS, lambda _a, _b: None)


@pytest.mark.parametrize("speed", [607.0, 1047.0, 1060.0])
def test_prediction_at_a_speed_is_what_a_long_settled_motion_shows(coarse: PredictionMap, speed: float) -> None:
    near = predict(gj90c(), speed, coarse, SETTINGS)
    (exact,) = np.flatnonzero(np.array([600.0, speed]) == speed)
    settled = compute_prediction_map(gj90c(), np.array([speed - 7.0, speed]), SETTINGS, lambda _a, _b: None)
    assert near.speed == speed
    assert near.peak_to_peak == pytest.approx(settled.peak_to_peak[exact], rel=0.05)
    assert np.abs(near.vectors[0]) == pytest.approx(np.abs(settled.vectors[exact, 0]), rel=0.02)
    if speed > 1000:
        assert near.whirl_order == pytest.approx(settled.whirl_order[exact], abs=0.01)


def test_prediction_outside_the_map_is_refused(coarse: PredictionMap) -> None:
    with pytest.raises(ValueError, match="speed: 500 rad/s, expected 600 to 1066 rad/s"):
        predict(gj90c(), 500.0, coarse, SETTINGS)


def test_motion_goes_on_from_a_state_as_if_it_had_not_stopped() -> None:
    whole = ShaftMotion(gj90c(), 900.0, 20)
    later = ShaftMotion(gj90c(), 900.0, 0)
    later.resume(whole.state, 900.0)
    assert later.turns(2) == pytest.approx(whole.turns(2), abs=1e-12)
    with pytest.raises(ValueError, match=r"state: shape \(3, 4\), expected \(3, 8\)"):
        later.resume(np.zeros((3, 4), np.complex128), 900.0)
