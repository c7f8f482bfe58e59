"""The refiner with its real child process."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from analysis.signals.header import AnalysisSettings
from daq.session.prediction.refiner import DISPLAY_TOLERANCE, RECOMPUTE_TOLERANCE, Refiner
from model.errors import ModelError
from model.prediction.prediction_map import Prediction, PredictionMap, compute_prediction_map, predict, refine
from model.rotor.gj90c import gj90c
from tests.daq.support.recording import wait_until

SETTINGS = AnalysisSettings(revolutions=8)
TIMEOUT = 60.0  # s, includes process start and compilation on a new machine


@pytest.fixture(scope="module")
def prediction_map() -> PredictionMap:
    return compute_prediction_map(gj90c(), np.array([500.0, 526.0, 552.0]), SETTINGS, lambda _done, _total: None)


@pytest.fixture
def refiner(prediction_map: PredictionMap) -> Iterator[Refiner]:
    refiner = Refiner(gj90c(), SETTINGS, prediction_map)
    yield refiner
    refiner.close()


def refined(refiner: Refiner, speed: float) -> Prediction:
    """Return the converged prediction at a speed."""
    wait_until(lambda: refiner.at(speed) is not None and refiner._requested is None)
    exact = refiner.at(speed)
    assert exact is not None
    return exact


def test_steady_speed_is_computed_exactly(refiner: Refiner, prediction_map: PredictionMap) -> None:
    assert refiner.at(511.0) is None
    exact = refined(refiner, 511.0)
    *_, expected = refine(gj90c(), 511.0, prediction_map, SETTINGS)
    assert exact.is_exact
    assert exact.speed == 511.0
    assert np.array_equal(exact.orbit, expected.orbit)
    assert np.array_equal(exact.vectors, expected.vectors)
    assert not np.array_equal(exact.vectors, prediction_map.at(511.0).vectors)
    assert refiner.at(511.0 * (1 + 0.9 * DISPLAY_TOLERANCE)) is exact
    assert refiner.at(511.0 * (1 + 1.1 * DISPLAY_TOLERANCE)) is None
    assert refiner.failure == ""


def test_last_prediction_is_returned_while_a_drifting_speed_is_computed(refiner: Refiner) -> None:
    first = refined(refiner, 511.0)
    slightly = 511.0 * (1 + 0.5 * RECOMPUTE_TOLERANCE)
    assert refiner.at(slightly) is first
    assert not refiner._requested
    further = 511.0 * (1 + 2 * RECOMPUTE_TOLERANCE)
    assert refiner.at(further) is first
    assert refiner._requested == further
    assert refined(refiner, further).speed == further


def test_changing_speed_is_not_computed(refiner: Refiner) -> None:
    for speed in np.linspace(500.0, 550.0, 30):
        assert refiner.at(float(speed)) is None
    assert refiner._requested is None
    assert refiner._process is None


def test_latest_requested_speed_is_computed_first(refiner: Refiner) -> None:
    for speed in (505.0, 520.0, 535.0, 545.0):
        refiner.at(speed)
        refiner.at(speed)
    assert refiner._requested == 545.0
    assert refined(refiner, 545.0).speed == 545.0
    assert refined(refiner, 505.0).speed == 505.0


def test_killed_process_is_reported(refiner: Refiner) -> None:
    refined(refiner, 511.0)
    process = refiner._process
    assert process is not None
    process.kill()
    refiner.at(530.0)
    refiner.at(530.0)
    wait_until(lambda: refiner.failure != "")
    assert refiner.failure.startswith("the process that computes it ended")
    refiner._thread.join(TIMEOUT)
    assert not refiner._thread.is_alive()
    assert refiner.at(530.0) is None


def test_speed_without_solution_is_reported_and_other_speeds_are_computed(prediction_map: PredictionMap) -> None:
    beyond_the_wall = replace(prediction_map, states=100 * prediction_map.states)
    with pytest.raises((ModelError, ValueError)) as raised:
        predict(gj90c(), 511.0, beyond_the_wall, SETTINGS)
    failing = Refiner(gj90c(), SETTINGS, beyond_the_wall)
    try:
        failing.at(511.0)
        failing.at(511.0)
        wait_until(lambda: failing.failure != "")
        assert failing.failure == str(raised.value)
        assert failing.at(511.0) is None
        assert failing._requested is None
        process = failing._process
        assert process is not None
        assert process.is_alive()
        failing.at(530.0)
        failing.at(530.0)
        assert failing._requested == 530.0
    finally:
        failing.close()


@pytest.mark.parametrize("n_calls", [0, 2])
def test_closing_joins_thread_and_process(prediction_map: PredictionMap, n_calls: int) -> None:
    refiner = Refiner(gj90c(), SETTINGS, prediction_map)
    for _ in range(n_calls):
        refiner.at(511.0)
    refiner.close()
    refiner.close()
    assert not refiner._thread.is_alive()
    assert refiner._process is None


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_suspended_process_is_ended(prediction_map: PredictionMap) -> None:
    refiner = Refiner(gj90c(), SETTINGS, prediction_map)
    refined(refiner, 511.0)
    process = refiner._process
    assert process is not None
    pid = process.pid
    assert pid is not None
    os.kill(pid, signal.SIGSTOP)
    refiner.at(530.0)
    assert refiner.at(530.0) is None
    assert refiner.failure == ""
    refiner.close()
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
    assert "refiner" not in {thread.name for thread in threading.enumerate()}


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_suspended_process_is_given_up_after_the_timeout(prediction_map: PredictionMap) -> None:
    refiner = Refiner(gj90c(), SETTINGS, prediction_map)
    refined(refiner, 511.0)
    process = refiner._process
    assert process is not None
    assert process.pid is not None
    os.kill(process.pid, signal.SIGSTOP)
    refiner._answer_timeout = 0.1
    refiner.at(530.0)
    assert refiner.at(530.0) is None
    wait_until(lambda: refiner.failure == "the process that computes it has not answered for 0.1 s")
    refiner._thread.join(TIMEOUT)
    assert not refiner._thread.is_alive()
    assert not process.is_alive()
