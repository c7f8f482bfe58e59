"""The pulse train: correct counts with missing and double pulses, and rejection of noise."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.header import Tacho
from analysis.signals.snapshot import TachoState
from analysis.tacho.pulse_train import PulseTrain

FloatArray = NDArray[np.float64]

RATE = 100_000.0
TACHO = Tacho(threshold=2.0, hysteresis=1.0)


def fed(train: PulseTrain, edges: FloatArray, until: float, step: float = 0.1) -> PulseTrain:
    for hop in range(round(until / step)):
        advance(train, edges, hop, step)
    return train


def advance(train: PulseTrain, edges: FloatArray, hop: int, step: float = 0.1) -> None:
    begin, end = np.searchsorted(edges, [hop * step, (hop + 1) * step])
    train.advance(edges[begin:end], (hop + 1) * step, step, RATE)


def run_up(turns: int) -> FloatArray:
    """Return the times of the marks in a linear run-up from 20 to 200 revolutions per second in 10 s."""
    return np.asarray((np.sqrt(20.0**2 + 2 * 18.0 * np.arange(turns)) - 20.0) / 18.0)


def spoiled(marks: FloatArray, missing: float, double: float, seed: int) -> FloatArray:
    """Return the marks with a fraction missing and a number of extra edges, both after the first ten."""
    random = np.random.default_rng(seed)
    keep = random.random(marks.size) >= missing
    keep[:10] = True
    extra = np.flatnonzero(random.random(marks.size - 1) < double)
    extra = extra[extra > 10]
    where = marks[extra] + random.uniform(0.02, 0.98, extra.size) * np.diff(marks)[extra]
    return np.asarray(np.sort(np.concatenate([marks[keep], where])))


def test_clean_run_up_is_counted_and_timed() -> None:
    marks = run_up(1000)
    train = fed(PulseTrain(TACHO, 40), marks, 9.0)
    turns, times = train.marks
    np.testing.assert_array_equal(times, marks[turns])
    state = train.state(9.0, train.speed(0.1), np.nan)
    report = train.report(state, np.nan)
    assert (state, report.filled, report.rejected) == (TachoState.GOOD, 0, 0)
    assert train.speed(0.1) == pytest.approx(2 * np.pi * (20 + 18.0 * 8.95), rel=0.002)


@pytest.mark.parametrize("seed", range(5))
def test_missing_and_double_pulses_do_not_change_the_count(seed: int) -> None:
    marks = run_up(1000)
    edges = spoiled(marks, 0.02, 0.02, seed)
    train = PulseTrain(TACHO, 40)
    slips = wrong = 0
    for hop in range(90):
        advance(train, edges, hop)
        turns, times = train.marks
        slips += int(np.count_nonzero(np.abs(times[:-1] - marks[turns[:-1]]) > 0.3 / 200))  # the last may be taken back
        wrong += int(np.count_nonzero(times[:-1] != marks[turns[:-1]]))
    report = train.report(TachoState.GOOD, np.nan)
    assert slips == 0
    assert wrong < 40 * 4  # few doubles stand so near a missing mark that they pass for it
    assert report.filled > 5
    assert report.rejected > 5


@pytest.mark.parametrize("part", [2, 3])
def test_sensor_that_begins_to_miss_every_second_pulse_is_too_fast(part: int) -> None:
    marks = 0.005 + np.arange(0.0, 6.0, 0.01)
    edges = np.concatenate([marks[:100], marks[100:400:part], marks[400:]])
    train = PulseTrain(TACHO, 40)
    states = []
    for hop in range(60):
        advance(train, edges, hop)
        states.append(train.state(0.1 * (hop + 1), train.speed(0.1), np.nan))
    assert states[5] is TachoState.GOOD
    assert set(states[15:39]) == {TachoState.TOO_FAST}
    assert set(states[50:]) == {TachoState.GOOD}
    assert train.speed(0.1) == pytest.approx(2 * np.pi * 100)


def test_two_unequal_marks_are_no_train() -> None:
    edges = np.sort(np.concatenate([np.arange(0.0, 2.0, 0.01), np.arange(0.003, 2.0, 0.01)]))
    train = fed(PulseTrain(TACHO, 40), edges, 2.0)
    assert train.state(2.0, train.speed(0.1), np.nan) is TachoState.IRREGULAR
    assert np.isnan(train.speed(0.1))


@pytest.mark.parametrize("edge_rate", [50.0, 1000.0, 20_000.0])
def test_noise_is_irregular(edge_rate: float) -> None:
    edges = np.cumsum(np.random.default_rng(5).exponential(1 / edge_rate, int(3 * edge_rate)))
    train = PulseTrain(TACHO, 40)
    states = []
    for hop in range(30):
        advance(train, edges, hop)
        states.append(train.state(0.1 * (hop + 1), train.speed(0.1), np.nan))
    assert TachoState.GOOD not in states
    assert states[-1] is TachoState.IRREGULAR


def test_stopped_shaft_has_no_pulses() -> None:
    train = fed(PulseTrain(TACHO, 40), np.arange(0.0, 1.0, 0.01), 1.2)
    assert np.isnan(train.speed(0.1))
    assert train.state(1.2, np.nan, np.nan) is TachoState.NO_PULSES
    fed_on = fed(train, np.empty(0), 5.0)
    assert fed_on.state(5.0, np.nan, np.nan) is TachoState.NO_PULSES


def test_mark_shorter_than_the_response_is_too_fast() -> None:
    tacho = Tacho(threshold=2.0, hysteresis=1.0, mark_fraction=0.1, response_time=1e-3)
    for turn_rate, state in [(95.0, TachoState.GOOD), (105.0, TachoState.TOO_FAST)]:
        train = fed(PulseTrain(tacho, 40), np.arange(0.0, 1.0, 1 / turn_rate), 1.0)
        assert train.state(1.0, train.speed(0.1), np.nan) is state


def test_many_repairs_or_much_jitter_are_irregular() -> None:
    marks = np.arange(0.0, 2.0, 0.01)
    train = fed(PulseTrain(TACHO, 40), marks, 2.0)
    assert train.state(2.0, train.speed(0.1), 0.0004) is TachoState.GOOD
    assert train.state(2.0, train.speed(0.1), 0.0006) is TachoState.IRREGULAR
    every_sixth = np.delete(marks, np.arange(12, marks.size, 6))
    train = fed(PulseTrain(TACHO, 40), every_sixth, 2.0)
    assert train.state(2.0, train.speed(0.1), 0.0) is TachoState.IRREGULAR


def test_several_marks_give_one_reference_mark_per_revolution() -> None:
    tacho = Tacho(threshold=2.0, hysteresis=1.0, pulses_per_revolution=4)
    train = fed(PulseTrain(tacho, 10), np.arange(0.0, 2.0, 0.01), 2.0)
    turns, times = train.marks
    assert turns.size == 10
    np.testing.assert_allclose(np.diff(times), 0.04)
    assert train.speed(0.1) == pytest.approx(2 * np.pi * 25)


def test_edge_nearer_to_the_prediction_replaces_the_accepted_one() -> None:
    marks = np.arange(0.0, 1.0, 0.01)
    edges = np.sort(np.append(marks, marks[50] - 0.0028))  # inside the gate, before the true one
    train = fed(PulseTrain(TACHO, 200), edges, 1.0)
    turns, times = train.marks
    np.testing.assert_allclose(times, marks[turns])
    assert train.report(TachoState.GOOD, 0.0).rejected == 1


def test_bouncing_edges_end_the_train() -> None:
    marks = np.arange(0.0, 1.0, 0.01)
    bounces = (marks[40:, None] + np.random.default_rng(1).uniform(0, 2e-3, (60, 6))).ravel()
    train = fed(PulseTrain(TACHO, 40), np.sort(np.concatenate([marks[:40], bounces])), 1.0)
    assert train.state(1.0, train.speed(0.1), np.nan) is TachoState.IRREGULAR


@pytest.mark.parametrize("marks_a_turn", [1, 3])
def test_pulses_added_together_or_one_by_one_give_the_same_train(marks_a_turn: int) -> None:
    tacho = replace(TACHO, pulses_per_revolution=marks_a_turn)
    marks = run_up(1500) + 2e-5 * np.random.default_rng(0).standard_normal(1500)
    marks = np.delete(marks, [400, 800])
    many, single = PulseTrain(tacho, 60), PulseTrain(tacho, 60)
    for begin in range(0, marks.size, 100):
        many.advance(marks[begin : begin + 100], float(marks[begin : begin + 100][-1]), 1.0, RATE)
    for mark in marks:
        single.advance(np.array([mark]), float(mark), 1.0, RATE)
    for one, other in zip(many.marks, single.marks, strict=True):
        np.testing.assert_array_equal(one, other)
    reports = [train.report(train.state(float(marks[-1]), train.speed(0.1), np.nan), 0.0) for train in (many, single)]
    assert reports[0] == reports[1]
    assert many.speed(0.1) == single.speed(0.1)
    assert reports[0].filled == 2
