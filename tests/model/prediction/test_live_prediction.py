import numpy as np
import pytest

from analysis.signals.header import AnalysisSettings
from model.dynamics.motion import ShaftMotion
from model.prediction.comparison import instability_onset
from model.prediction.prediction_map import PredictionMap, analyse_motion, compute_prediction_map, predict, refine
from model.rotor.gj90c import gj90c

SETTINGS = AnalysisSettings()


@pytest.fixture(scope="module")
def coarse() -> PredictionMap:
    return compute_prediction_map(gj90c(), np.array([600.0, 626.0, 1040.0, 1066.0]), SETTINGS, lambda _a, _b: None)


@pytest.mark.parametrize("speed", [607.0, 1047.0, 1060.0])
def test_prediction_at_a_speed_equals_a_long_settled_motion(coarse: PredictionMap, speed: float) -> None:
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


def test_resumed_motion_equals_the_uninterrupted_one() -> None:
    whole = ShaftMotion(gj90c(), 900.0, 20)
    later = ShaftMotion(gj90c(), 900.0, 0)
    later.resume(whole.state, 900.0)
    assert later.integrate_turns(2) == pytest.approx(whole.integrate_turns(2), abs=1e-12)
    with pytest.raises(ValueError, match=r"state: shape \(3, 4\), expected \(3, 8\)"):
        later.resume(np.zeros((3, 4), np.complex128), 900.0)


def test_refined_predictions_converge_without_whirl(coarse: PredictionMap) -> None:
    first, *_, last = refine(gj90c(), 613.0, coarse, SETTINGS)
    settled = ShaftMotion(gj90c(), 613.0, 600).integrate_turns(1)
    expected = np.ptp(settled, axis=1)
    ends = np.abs(last.peak_to_peak - expected) / expected
    assert ends.max() < 1e-3
    assert (np.abs(first.peak_to_peak - expected) / expected).max() < 0.01
    assert last.is_exact
    assert not coarse.at(613.0).is_exact


def test_refined_whirl_equals_a_long_settled_motion(coarse: PredictionMap) -> None:
    *_, last = refine(gj90c(), 1052.0, coarse, SETTINGS)
    motion = ShaftMotion(gj90c(), 1052.0, 0)
    motion.resume(coarse.states[2], 1040.0)
    motion.integrate_turns(3000)
    long = analyse_motion(motion, gj90c(), SETTINGS, 0.0)
    assert last.whirl_order == pytest.approx(long.whirl_order, abs=2e-3)
    assert last.whirl_amplitude == pytest.approx(long.whirl_amplitude, rel=0.01)
    assert last.peak_to_peak == pytest.approx(long.peak_to_peak, rel=0.01)


def test_start_state_is_on_the_same_side_of_the_onset(coarse: PredictionMap) -> None:
    onset = instability_onset(coarse)
    assert 626.0 < onset < 1040.0
    calm, whirling = (predict(gj90c(), speed, coarse, SETTINGS) for speed in (onset - 5.0, onset + 5.0))
    assert calm.whirl_amplitude < 0.5e-6  # residual of a start more than 200 rad/s below
    assert whirling.whirl_amplitude > 10e-6
