import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.header import AnalysisSettings
from analysis.signals.units import RPM
from model.prediction.prediction_map import (
    PredictionMap,
    compute_prediction_map,
    default_map_speeds,
    prediction_map_key,
)
from model.rotor.gj90c import gj90c
from model.rotor.parameters import FilmModel, Imbalance, ModelParameters

SETTINGS = AnalysisSettings(revolutions=16, points_per_revolution=32, highest_order=4.0, orbit_revolutions=3)
SPEEDS = np.array([600.0, 700.0, 1150.0, 1200.0])
FULL_SOMMERFELD = replace(gj90c(), bearing=replace(gj90c().floating_ring, film_model=FilmModel.FULL_SOMMERFELD))


def silent(done: int, total: int) -> None:
    assert 0 < done <= total


@pytest.fixture(scope="module")
def computed() -> PredictionMap:
    return compute_prediction_map(gj90c(), SPEEDS, SETTINGS, silent)


def test_map_has_order_axis_and_orbit_of_the_measurement(computed: PredictionMap) -> None:
    prediction = computed.at(650.0)
    assert prediction.orders == pytest.approx(np.arange(4 * 16 + 1) / 16)
    assert prediction.spectrum.shape == (2, 65)
    assert prediction.orbit.shape == (2, 3 * 32)
    assert prediction.orbit.mean(axis=1) == pytest.approx([0, 0], abs=1e-12)


def test_stable_speed_has_only_1x(computed: PredictionMap) -> None:
    prediction = computed.at(600.0)
    assert prediction.growth_rate < 0
    assert math.isnan(prediction.whirl_order)
    assert prediction.whirl_amplitude == 0
    assert np.abs(prediction.vectors[0]) == pytest.approx(prediction.spectrum[:, 16], rel=1e-6)
    assert np.argmax(prediction.spectrum[0]) == 16
    # the orbit starts at theta = 0 and is almost only 1X
    theta = 2 * math.pi * np.arange(32) / 32
    one = np.real(prediction.vectors[0][:, None] * np.exp(1j * theta))
    assert np.abs(prediction.orbit[:, :32] - one).max() < 0.15 * np.abs(one).max()


def test_unstable_speed_has_inner_film_whirl(computed: PredictionMap) -> None:
    prediction = computed.at(1150.0)
    assert prediction.growth_rate > 0
    assert prediction.whirl_order == pytest.approx(0.70, abs=0.02)
    assert 5e-6 < prediction.whirl_amplitude < 20e-6
    assert prediction.peak_to_peak.min() > 2 * prediction.whirl_amplitude


def test_between_speeds_spectrum_and_vectors_are_interpolated(computed: PredictionMap) -> None:
    below, middle, above = computed.at(600.0), computed.at(625.0), computed.at(700.0)
    for name in ("spectrum", "vectors", "peak_to_peak", "growth_rate"):
        expected = 0.75 * getattr(below, name) + 0.25 * getattr(above, name)
        assert getattr(middle, name) == pytest.approx(expected, rel=1e-9)
    assert np.array_equal(middle.orbit, below.orbit)
    assert np.array_equal(computed.at(680.0).orbit, above.orbit)
    assert middle.speed == 625.0


def test_whirl_is_interpolated_only_between_equal_whirls(computed: PredictionMap) -> None:
    both = (computed.whirl_order[2] + computed.whirl_order[3]) / 2
    assert computed.at(1175.0).whirl_order == pytest.approx(both, rel=1e-9)
    assert math.isnan(computed.at(710.0).whirl_order)
    assert computed.at(1149.0).whirl_order == computed.whirl_order[2]


@pytest.mark.parametrize("speed", [599.9, 1200.1, math.nan])
def test_speed_outside_the_map_is_refused(computed: PredictionMap, speed: float) -> None:
    with pytest.raises(ValueError, match=r"speed: .* rad/s, expected 600 to 1200 rad/s, the map's range"):
        computed.at(speed)


def test_map_survives_the_round_trip_through_arrays(computed: PredictionMap) -> None:
    again = PredictionMap.from_arrays(computed.to_arrays())
    for name, array in computed.to_arrays().items():
        assert np.array_equal(getattr(again, name), array, equal_nan=True)


def test_invalid_arrays_are_refused(computed: PredictionMap) -> None:
    arrays = computed.to_arrays()
    with pytest.raises(ValueError, match="prediction map: orbit missing"):
        PredictionMap.from_arrays({name: array for name, array in arrays.items() if name != "orbit"})
    wrong: dict[str, NDArray[np.generic]] = {**arrays, "spectrum": arrays["spectrum"][:, :, :-1]}
    with pytest.raises(ValueError, match=r"spectrum: float64 of shape \(4, 2, 64\), expected shape \(4, 2, 65\)"):
        PredictionMap.from_arrays(wrong)


def test_probes_at_other_angles_measure_the_same_motion(computed: PredictionMap) -> None:
    turned = replace(gj90c(), probe_angles=(math.pi / 2, math.pi))
    other = compute_prediction_map(turned, SPEEDS[:2], SETTINGS, silent)
    assert other.spectrum[:, 0] == pytest.approx(computed.spectrum[:2, 1], abs=1e-12)
    assert other.vectors[:, 0, 1] == pytest.approx(-computed.vectors[:2, 0, 0], abs=1e-12)
    assert other.orbit == pytest.approx(computed.orbit[:2], abs=1e-12)


def test_progress_is_reported_after_each_speed() -> None:
    progress: list[tuple[int, int]] = []
    compute_prediction_map(gj90c(), SPEEDS[:2], SETTINGS, lambda done, total: progress.append((done, total)))
    assert progress == [(1, 2), (2, 2)]


def test_growth_rate_is_nan_without_synchronous_orbit() -> None:
    # viscosity so low that the shaft bounces: a motion exists, but no periodic one
    thin = gj90c(viscosity=1e-4, imbalance=1.8e-5)
    found = compute_prediction_map(thin, np.array([5000.0, 5010.0]), SETTINGS, silent)
    assert np.isnan(found.growth_rate).all()
    assert np.isfinite(found.peak_to_peak).all()


@pytest.mark.parametrize("speeds", [[100.0], [200.0, 100.0], [0.0, 100.0], [100.0, math.nan]])
def test_speeds_that_do_not_rise_are_refused(speeds: list[float]) -> None:
    with pytest.raises(ValueError, match=r"speeds: .* rad/s, expected two or more, rising, above 0"):
        compute_prediction_map(gj90c(), np.array(speeds), SETTINGS, silent)


def test_default_speeds_reach_the_rigs_limit_in_steps_of_250_rpm() -> None:
    rpm = default_map_speeds(20_000 * RPM) / RPM
    assert rpm[[0, -1]] == pytest.approx([500, 20_000])
    assert np.diff(rpm) == pytest.approx(np.full(rpm.size - 1, 250.0))
    with pytest.raises(ValueError, match="highest: 10 rad/s, expected more than"):
        default_map_speeds(10.0)


@pytest.mark.parametrize(
    ("parameters", "speeds", "settings"),
    [
        (gj90c(viscosity=0.016), SPEEDS, SETTINGS),
        (gj90c(imbalance_phase=0.1), SPEEDS, SETTINGS),
        (replace(gj90c(), imbalances=(Imbalance(5, 5e-7), Imbalance(2, 1e-8))), SPEEDS, SETTINGS),
        (FULL_SOMMERFELD, SPEEDS, SETTINGS),
        (gj90c(), SPEEDS[1:], SETTINGS),
        (gj90c(), SPEEDS, replace(SETTINGS, revolutions=32)),
    ],
)
def test_key_depends_on_every_input(
    parameters: ModelParameters, speeds: NDArray[np.float64], settings: AnalysisSettings
) -> None:
    assert prediction_map_key(parameters, speeds, settings) != prediction_map_key(gj90c(), SPEEDS, SETTINGS)


def test_key_is_the_same_for_the_same_inputs() -> None:
    key = prediction_map_key(gj90c(), SPEEDS, SETTINGS)
    assert key == prediction_map_key(gj90c(), SPEEDS.copy(), replace(SETTINGS))
    assert len(key) == 64
    assert int(key, 16) > 0
