"""The predictor and its refiner with their real child processes: map cache, states, errors."""

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from multiprocessing.process import BaseProcess
from pathlib import Path

import numpy as np
import pytest

from analysis.signals.header import AnalysisSettings
from daq.session.prediction_maps import cache_folder
from daq.session.predictor import DISPLAY_TOLERANCE, RECOMPUTE_TOLERANCE, Predictor, Refiner
from daq.session.processes import WorkerProcess
from model.errors import ModelError
from model.prediction.prediction_map import Prediction, PredictionMap, compute_prediction_map, predict, refine
from model.rotor.gj90c import gj90c
from tests.daq.support.recording import wait_until

SETTINGS = AnalysisSettings(revolutions=8)
SPEEDS = np.array([500.0, 560.0, 620.0])
TIMEOUT = 100.0  # s, includes compilation on a new machine


def running_process(worker: WorkerProcess) -> BaseProcess:
    """Wait until a worker's process runs, and return it."""
    wait_until(lambda: worker._process is not None)
    assert worker._process is not None
    return worker._process


def predictor(folder: Path, viscosity: float = 0.015, speeds: list[float] | None = None) -> Predictor:
    return Predictor(gj90c(viscosity=viscosity), SETTINGS, SPEEDS if speeds is None else np.array(speeds), folder)


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a cache folder with the map of a predictor."""
    folder = tmp_path_factory.mktemp("cache") / "not" / "there" / "yet"
    with closing(predictor(folder)) as computing:
        assert computing.wait(TIMEOUT) is not None
    return folder


def test_map_is_computed_in_the_background(tmp_path: Path) -> None:
    with closing(predictor(tmp_path)) as computing:
        assert computing.state.startswith("computing")
        assert computing.at(530.0) is None
        assert computing.map is None
        states: list[str] = []
        found = computing.wait(TIMEOUT, states.append)
        assert states[0].startswith("computing")
        assert states[-1] == computing.state == "ready"
        assert found is not None
        expected = compute_prediction_map(gj90c(), SPEEDS, SETTINGS, lambda _done, _total: None)
        assert np.array_equal(found.vectors, expected.vectors)
        assert computing.at(530.0) is not None
        assert computing.at(499.0) is None
        assert computing.at(621.0) is None
        assert computing.at(float("nan")) is None
    assert {file.suffix for file in tmp_path.iterdir()} - {".lock"} == {".npz"}


def test_cached_map_is_ready_immediately(filled: Path) -> None:
    with closing(predictor(filled)) as ready:
        assert ready.state == "ready"
        assert ready.cache_error == ""
        assert ready.at(530.0) is not None
        assert ready.wait(0.0) is ready.map


def test_other_parameters_are_not_read_from_the_cache(filled: Path) -> None:
    with closing(predictor(filled, viscosity=0.016)) as computing:
        assert computing.state.startswith("computing")
    assert computing.state == "off: stopped"


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x03\x04 cut short", b"\x93NUMPY\x01\x00"])
def test_damaged_file_is_reported_and_computed_again(filled: Path, tmp_path: Path, content: bytes) -> None:
    cached = next(filled.glob("*.npz"))
    (tmp_path / cached.name).write_bytes(content)
    with closing(predictor(tmp_path)) as computing:
        assert computing.state.startswith("computing")
        assert "no readable prediction" in computing.cache_error
        states: list[str] = []
        computing.wait(0.0, states.append)
        assert states[0] == computing.cache_error


def test_truncated_file_is_replaced(filled: Path, tmp_path: Path) -> None:
    whole = next(filled.glob("*.npz")).read_bytes()
    damaged = tmp_path / next(filled.glob("*.npz")).name
    damaged.write_bytes(whole[: len(whole) // 2])
    with closing(predictor(tmp_path)) as computing:
        assert computing.cache_error
        assert computing.wait(TIMEOUT) is not None
    with closing(predictor(tmp_path)) as ready:
        assert ready.state == "ready"


def test_closing_ends_the_computation(tmp_path: Path) -> None:
    computing = predictor(tmp_path, speeds=list(np.linspace(200, 2000, 400)))
    process = running_process(computing._worker)
    pid = process.pid
    assert pid is not None
    computing.close()
    computing.close()
    assert computing.state == "off: stopped"
    assert computing.wait(1.0) is None
    if sys.platform != "win32":
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_model_without_solution_is_off_with_the_reason(tmp_path: Path) -> None:
    with closing(predictor(tmp_path, viscosity=1e-10, speeds=[10.0, 11.0])) as failing:
        assert failing.wait(TIMEOUT) is None
        assert failing.state.startswith("off: eccentricity: the ring reached")


def test_model_is_off_after_its_computation_is_killed(tmp_path: Path) -> None:
    with closing(predictor(tmp_path, speeds=list(np.linspace(200, 2000, 400)))) as killed:
        process = running_process(killed._worker)
        process.kill()
        killed.wait(TIMEOUT)
        assert killed.state == "off: the computation ended without a result"


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_suspended_computation_blocks_no_caller_and_is_ended(tmp_path: Path) -> None:
    computing = predictor(tmp_path, speeds=list(np.linspace(200, 2000, 400)))
    process = running_process(computing._worker)
    assert process.pid is not None
    os.kill(process.pid, signal.SIGSTOP)
    assert computing.state.startswith("computing")
    assert computing.at(530.0) is None
    assert computing.wait(0.1) is None
    computing.close()
    assert not process.is_alive()


def test_map_is_computed_without_a_writable_cache_folder(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    with closing(predictor(blocked / "cache")) as computing:
        assert computing.wait(TIMEOUT) is not None
        assert computing.state == "ready"
    assert blocked.read_text() == "no folder"


def test_steady_speed_is_refined_while_the_map_serves(filled: Path) -> None:
    with closing(predictor(filled)) as ready:
        prediction_map = ready.map
        assert prediction_map is not None
        first = ready.at(530.0)
        assert first is not None
        assert not first.is_exact
        assert np.array_equal(first.vectors, prediction_map.at(530.0).vectors)
        end = time.monotonic() + TIMEOUT
        while not (now := ready.at(530.0)) or not now.is_exact:
            assert time.monotonic() < end
            time.sleep(0.01)
        assert now.speed == 530.0
        assert ready.state == "ready"
        nearby = ready.at(540.0)
        assert nearby is not None
        assert not nearby.is_exact
    assert ready.at(530.0) is not None


def test_map_serves_after_the_refiner_failed(filled: Path) -> None:
    with closing(predictor(filled)) as ready:
        ready.at(530.0)
        refiner = ready._refiner
        assert refiner is not None
        refiner.failure = "the process that computes it ended (EOFError)"
        assert ready.state == "ready, not exact: the process that computes it ended (EOFError)"
        assert ready.at(530.0) is not None


def test_state_can_be_read_while_another_thread_waits(tmp_path: Path) -> None:
    with closing(predictor(tmp_path)) as computing:
        waiting = threading.Thread(target=computing.wait, args=(TIMEOUT,))
        waiting.start()
        states = set()
        while waiting.is_alive():
            states.add(computing.state.split()[0])
            time.sleep(0.01)
        assert states <= {"computing", "ready"}
        assert computing.wait(TIMEOUT) is not None


def test_cache_folder_comes_from_the_environment() -> None:
    saved = dict(os.environ)
    try:
        os.environ["RIG_CACHE"] = "somewhere"
        assert cache_folder() == Path("somewhere")
        del os.environ["RIG_CACHE"]
        assert cache_folder().name in {"rig", "cache"}
        assert cache_folder().is_absolute()
    finally:
        os.environ.clear()
        os.environ.update(saved)


# s, includes compilation on a new machine


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
    assert refiner._worker._process is None


def test_latest_requested_speed_is_computed_first(refiner: Refiner) -> None:
    for speed in (505.0, 520.0, 535.0, 545.0):
        refiner.at(speed)
        refiner.at(speed)
    assert refiner._requested == 545.0
    assert refined(refiner, 545.0).speed == 545.0
    assert refined(refiner, 505.0).speed == 505.0


def test_killed_process_is_reported(refiner: Refiner) -> None:
    refined(refiner, 511.0)
    process = running_process(refiner._worker)
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
        process = running_process(failing._worker)
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
    assert refiner._worker._process is None


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_suspended_process_is_ended(prediction_map: PredictionMap) -> None:
    refiner = Refiner(gj90c(), SETTINGS, prediction_map)
    refined(refiner, 511.0)
    process = running_process(refiner._worker)
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
    process = running_process(refiner._worker)
    assert process.pid is not None
    os.kill(process.pid, signal.SIGSTOP)
    refiner._answer_timeout = 0.1
    refiner.at(530.0)
    assert refiner.at(530.0) is None
    wait_until(lambda: refiner.failure == "the process that computes it has not answered for 0.1 s")
    refiner._thread.join(TIMEOUT)
    assert not refiner._thread.is_alive()
    assert not process.is_alive()
