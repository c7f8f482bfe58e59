import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.live.summary import RunSummary
from analysis.signals.blocks import RampDirection, TimeInRun
from analysis.vectors.speed_curve import SpeedRow
from analysis.whirl.findings import WhirlFinding
from model.prediction.comparison import compare, instability_onset, predicted_whirls
from model.prediction.prediction_map import PredictionMap

SPEEDS = np.arange(200.0, 2001.0, 100.0)


@pytest.fixture
def model() -> PredictionMap:
    """Synthetic map: 1X of 3 µm whose phase rotates with speed, inner whirl from 1000, outer from 1800 rad/s."""
    n = SPEEDS.size
    vectors = np.zeros((n, 2, 2), np.complex128)
    vectors[:, 0, 0] = 3e-6 * np.exp(-1j * SPEEDS / 2000)
    vectors[:, 0, 1] = -1j * vectors[:, 0, 0]
    order = np.full(n, math.nan)
    order[SPEEDS >= 1000] = 0.70 - 1e-5 * (SPEEDS[SPEEDS >= 1000] - 1000)
    order[SPEEDS >= 1800] = 0.20
    return PredictionMap(
        speeds=SPEEDS,
        orders=np.arange(5) / 4,
        spectrum=np.zeros((n, 2, 5)),
        vectors=vectors,
        whirl_order=order,
        whirl_amplitude=np.where(np.isnan(order), 0.0, 1e-8 * SPEEDS),
        peak_to_peak=np.zeros((n, 2)),
        orbit=np.zeros((n, 2, 8)),
        growth_rate=(SPEEDS - 950) / 100,
        states=np.zeros((n, 3, 8), np.complex128),
    )


def row(model: PredictionMap, speed: float, factor: complex = 1.0) -> SpeedRow:
    """Summary row of a run whose 1X is ``factor`` times the prediction."""
    predicted = model.at(speed).vectors if 200 <= speed <= 2000 else np.full((2, 2), 1e-6 + 0j)
    return SpeedRow(
        direction=RampDirection.RUN_UP,
        speed=speed,
        frames=3,
        vectors=predicted * factor,
        scatter=np.zeros((2, 2)),
        mean_overall=np.zeros((1, 2)),
        largest_overall=np.zeros((1, 2)),
        noise=1e-8,
        whirl_amplitude=0.0,
        whirl_order=math.nan,
        compensated=np.full((2, 2), complex(math.nan)),
    )


def whirl(order: float, begin: float, end: float, *, is_forward: bool = True) -> WhirlFinding:
    return WhirlFinding(
        order=order,
        order_at_onset=order,
        onset=TimeInRun(0, 1.0, begin),
        end=TimeInRun(0, 2.0, end),
        amplitude=12e-6,
        largest_at=TimeInRun(0, 1.5, end),
        is_forward=is_forward,
        frames=20,
    )


def run(rows: list[SpeedRow], whirls: list[WhirlFinding] | None = None, highest: float = 1900.0) -> RunSummary:
    return RunSummary(
        run="r",
        rig="g",
        note="",
        started_ns=0,
        duration=1.0,
        samples=1,
        lost=0,
        lost_is_exact=True,
        segments=(),
        lowest_speed=200.0,
        highest_speed=highest,
        probes=(),
        clipped=(0, 0, 0),
        snapshots=1,
        frames=1,
        tacho=None,
        tacho_states={},
        rows=tuple(rows),
        whirls=tuple(whirls or ()),
    )


def test_run_equal_to_the_model_agrees_at_all_speeds(model: PredictionMap) -> None:
    found = compare(run([row(model, speed) for speed in (300.0, 777.0, 1900.0)]), model).synchronous
    assert found is not None
    assert found.speeds == 3
    assert (found.median_ratio, found.worst_ratio) == pytest.approx((1, 1))
    assert (found.median_phase, found.worst_phase) == pytest.approx((0, 0), abs=1e-12)
    assert found.agrees_to == 1900.0
    assert (found.within_ratio, found.within_phase) == pytest.approx((0, 0), abs=1e-12)


def test_larger_amplitude_and_later_phase_are_positive(model: PredictionMap) -> None:
    found = compare(run([row(model, 500.0, 1.2 * np.exp(-0.3j))]), model).synchronous
    assert found is not None
    assert found.median_ratio == pytest.approx(1.2)
    assert found.median_phase == pytest.approx(0.3)
    assert found.within_ratio == pytest.approx(0.2)
    assert found.within_phase == pytest.approx(0.3)


def test_agreement_ends_before_the_first_disagreeing_speed(model: PredictionMap) -> None:
    rows = [
        row(model, 1500.0, 0.5),
        row(model, 600.0, 0.9),
        row(model, 900.0, np.exp(-1j)),
        row(model, 300.0),
        row(model, 1800.0),
    ]
    found = compare(run(rows), model).synchronous
    assert found is not None
    assert found.agrees_to == 600.0
    assert found.within_ratio == pytest.approx(0.1)
    assert (found.worst_ratio, found.worst_ratio_speed) == pytest.approx((0.5, 1500.0))
    assert (found.worst_phase, found.worst_phase_speed) == pytest.approx((1.0, 900.0))


def test_run_that_disagrees_from_the_start_has_no_agreement_speed(model: PredictionMap) -> None:
    found = compare(run([row(model, 500.0, 3.0), row(model, 900.0)]), model).synchronous
    assert found is not None
    assert math.isnan(found.agrees_to)
    assert math.isnan(found.within_ratio)
    assert math.isnan(found.within_phase)


def test_speeds_outside_the_map_and_tiny_vectors_are_not_compared(model: PredictionMap) -> None:
    rows = [row(model, 150.0), row(model, 500.0, 0.01), row(model, 2100.0)]
    assert compare(run(rows), model).synchronous is None
    assert compare(run([]), model).synchronous is None


def test_predicted_whirls_are_ranges_of_one_order(model: PredictionMap) -> None:
    inner, outer = predicted_whirls(model)
    assert (inner.order, inner.onset, inner.end, inner.amplitude) == pytest.approx((0.70, 1000, 1700, 17e-6))
    assert (outer.order, outer.onset, outer.end, outer.amplitude) == pytest.approx((0.20, 1800, 2000, 20e-6))


def test_interrupted_whirl_is_one_whirl(model: PredictionMap) -> None:
    order = model.whirl_order.copy()
    order[SPEEDS == 1300] = math.nan
    assert [one.onset for one in predicted_whirls(replace(model, whirl_order=order))] == [1000, 1800]


def test_whirls_are_matched_by_their_rank_in_speed(model: PredictionMap) -> None:
    # run-up and run-down, and a reverse component
    whirls = [
        whirl(0.49, 1150, 1500),
        whirl(0.17, 1540, 1900),
        whirl(0.48, 1450, 1100),
        whirl(0.3, 900, 950, is_forward=False),
    ]
    first, second = compare(run([], whirls), model).whirls
    assert first.predicted is not None
    assert first.measured is whirls[0]
    assert first.onset_ratio == pytest.approx(1.15)
    assert second.onset_ratio == pytest.approx(1540 / 1800)
    assert first.was_reached
    assert second.was_reached


def test_whirl_above_the_speeds_of_the_run_is_marked_as_not_reached(model: PredictionMap) -> None:
    first, second = compare(run([], [], highest=1500.0), model).whirls
    assert (first.was_reached, first.measured) == (True, None)
    assert (second.was_reached, second.measured) == (False, None)
    assert math.isnan(first.onset_ratio)


def test_unpredicted_whirl_is_listed(model: PredictionMap) -> None:
    quiet = replace(model, whirl_order=np.full(SPEEDS.size, math.nan))
    (only,) = compare(run([], [whirl(0.49, 1150, 1500)]), quiet).whirls
    assert only.predicted is None
    assert only.was_reached


def test_onset_of_instability_is_the_zero_of_the_growth_rate(model: PredictionMap) -> None:
    assert instability_onset(model) == pytest.approx(950.0)
    assert compare(run([]), model).instability_onset == pytest.approx(950.0)
    assert math.isnan(instability_onset(replace(model, growth_rate=np.full(SPEEDS.size, -1.0))))
    assert instability_onset(replace(model, growth_rate=np.full(SPEEDS.size, 1.0))) == 200.0
    unknown_below = np.where(SPEEDS < 1000, math.nan, 1.0)
    assert instability_onset(replace(model, growth_rate=unknown_below)) == 1000.0
