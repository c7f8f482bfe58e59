"""The cache of prediction maps: one process computes a map, the others wait for it."""

import math
import multiprocessing
import os
import signal
import sys
import threading
import time
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import pytest
from filelock import FileLock

from daq.session.prediction_maps import OnProgress, load_or_compute_map, read_map
from model.prediction.prediction_map import PredictionMap

DEADLINE = 60.0  # s


def make_map(size: float = 1.0) -> PredictionMap:
    """Return a map of arbitrary values."""
    n = 4
    return PredictionMap(
        speeds=np.arange(1.0, n + 1),
        orders=np.arange(5) / 4,
        spectrum=np.zeros((n, 2, 5)),
        vectors=np.full((n, 2, 2), size, np.complex128),
        whirl_order=np.full(n, math.nan),
        whirl_amplitude=np.zeros(n),
        peak_to_peak=np.zeros((n, 2)),
        orbit=np.zeros((n, 2, 8)),
        growth_rate=np.zeros(n),
        states=np.zeros((n, 3, 8), np.complex128),
    )


class GatedComputation:
    """Computes a map when ``go_on`` is set; counts its calls."""

    def __init__(self, size: float = 1.0) -> None:
        self.size = size
        self.started = threading.Event()
        self.go_on = threading.Event()
        self.calls = 0

    def __call__(self, on_progress: OnProgress) -> PredictionMap:
        self.calls += 1
        on_progress(1, 2)
        self.started.set()
        assert self.go_on.wait(DEADLINE)
        on_progress(2, 2)
        return make_map(self.size)


class Requester(threading.Thread):
    """Requests a map and records the reported progress."""

    def __init__(self, file: Path, computing: GatedComputation) -> None:
        super().__init__(daemon=True)
        self.file = file
        self.computing = computing
        self.progress_reports: list[tuple[int, int]] = []
        self.found: PredictionMap | None = None
        self.start()

    def run(self) -> None:
        self.found = load_or_compute_map(
            self.file, self.computing, lambda *progress: self.progress_reports.append(progress)
        )


def test_second_request_waits_for_the_first_and_reports_its_progress(tmp_path: Path) -> None:
    first, second = GatedComputation(1.0), GatedComputation(2.0)
    computing = Requester(tmp_path / "new" / "map.npz", first)
    assert first.started.wait(DEADLINE)
    waiting = Requester(tmp_path / "new" / "map.npz", second)
    until = time.monotonic() + DEADLINE
    while not waiting.progress_reports:
        assert time.monotonic() < until
        time.sleep(0.01)
    assert waiting.progress_reports == [(1, 2)]
    first.go_on.set()
    for thread in (computing, waiting):
        thread.join(DEADLINE)
        assert thread.found is not None
        assert thread.found.vectors[0, 0, 0] == 1.0
    assert (first.calls, second.calls) == (1, 0)
    assert {path.name for path in (tmp_path / "new").iterdir()} - {"map.lock"} == {"map.npz"}


def hold_lock(path: Path, pipe: Connection) -> None:
    """Acquire a lock and hold it."""
    FileLock(path).acquire()
    pipe.send("held")
    time.sleep(10 * DEADLINE)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP] if sys.platform != "win32" else [signal.SIGTERM])
def test_killed_or_suspended_holder_of_the_lock_is_not_waited_for(tmp_path: Path, number: int) -> None:
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    holder = context.Process(target=hold_lock, args=(tmp_path / "map.lock", there), daemon=True)
    holder.start()
    try:
        assert here.poll(DEADLINE)
        os.kill(holder.pid or 0, number)
        computing = GatedComputation(3.0)
        computing.go_on.set()
        found = load_or_compute_map(tmp_path / "map.npz", computing, lambda *_progress: None, stall_timeout=0.5)
        assert found.vectors[0, 0, 0] == 3.0
        cached, _ = read_map(tmp_path / "map.npz")
        assert cached is not None
    finally:
        holder.kill()
        holder.join(DEADLINE)


def test_map_is_computed_without_a_writable_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    computing = GatedComputation()
    computing.go_on.set()
    found = load_or_compute_map(tmp_path / "file" / "map.npz", computing, lambda *_progress: None)
    assert found.vectors[0, 0, 0] == 1.0


def test_lock_is_released_after_a_failed_computation(tmp_path: Path) -> None:
    def fail(_on_progress: OnProgress) -> PredictionMap:
        raise ValueError("no motion")

    for _ in range(2):
        with pytest.raises(ValueError, match="no motion"):
            load_or_compute_map(tmp_path / "map.npz", fail, lambda *_progress: None)
    assert not {path.name for path in tmp_path.iterdir()} - {"map.lock"}
