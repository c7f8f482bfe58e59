"""The model's maps on disk: of several that want one at once, one computes it and the others wait."""

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

from daq.session.prediction.file_lock import FileLock
from daq.session.prediction.map_cache import OnProgress, load_or_compute_map, read_map
from model.prediction.prediction_map import PredictionMap

DEADLINE = 60.0  # s


def make_map(size: float = 1.0) -> PredictionMap:
    """A map made by hand."""
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


class Computing:
    """Computes when it is let."""

    def __init__(self, size: float = 1.0) -> None:
        self.size = size
        self.begun = threading.Event()
        self.go_on = threading.Event()
        self.times = 0

    def __call__(self, told: OnProgress) -> PredictionMap:
        self.times += 1
        told(1, 2)
        self.begun.set()
        assert self.go_on.wait(DEADLINE)
        told(2, 2)
        return make_map(self.size)


class Wanting(threading.Thread):
    """Wants a map, and keeps what it was told."""

    def __init__(self, file: Path, computing: Computing) -> None:
        super().__init__(daemon=True)
        self.file = file
        self.computing = computing
        self.heard: list[tuple[int, int]] = []
        self.found: PredictionMap | None = None
        self.start()

    def run(self) -> None:
        self.found = load_or_compute_map(self.file, self.computing, lambda *progress: self.heard.append(progress))


def test_one_computes_and_the_other_waits_and_is_told_how_far_it_is(tmp_path: Path) -> None:
    first, second = Computing(1.0), Computing(2.0)
    computing = Wanting(tmp_path / "new" / "map.npz", first)
    assert first.begun.wait(DEADLINE)
    waiting = Wanting(tmp_path / "new" / "map.npz", second)
    until = time.monotonic() + DEADLINE
    while not waiting.heard:
        assert time.monotonic() < until
        time.sleep(0.01)
    assert waiting.heard == [(1, 2)]
    first.go_on.set()
    for thread in (computing, waiting):
        thread.join(DEADLINE)
        assert thread.found is not None
        assert thread.found.vectors[0, 0, 0] == 1.0
    assert (first.times, second.times) == (1, 0)
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["map.npz"]


def hold(path: Path, said: Connection) -> None:
    """Acquire a lock and hold it."""
    lock = FileLock(path)
    assert lock.try_acquire()
    said.send("held")
    time.sleep(10 * DEADLINE)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP] if sys.platform != "win32" else [signal.SIGTERM])
def test_nobody_waits_for_who_was_killed_or_stands_still(tmp_path: Path, number: int) -> None:
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    holder = context.Process(target=hold, args=(tmp_path / "map.lock", there), daemon=True)
    holder.start()
    try:
        assert here.poll(DEADLINE)
        os.kill(holder.pid or 0, number)
        computing = Computing(3.0)
        computing.go_on.set()
        found = load_or_compute_map(tmp_path / "map.npz", computing, lambda *_progress: None, stall_timeout=0.5)
        assert found.vectors[0, 0, 0] == 3.0
        kept, _ = read_map(tmp_path / "map.npz")
        assert kept is not None
    finally:
        holder.kill()
        holder.join(DEADLINE)


def test_map_is_computed_where_none_can_be_kept(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    computing = Computing()
    computing.go_on.set()
    found = load_or_compute_map(tmp_path / "file" / "map.npz", computing, lambda *_progress: None)
    assert found.vectors[0, 0, 0] == 1.0


def test_who_fails_lets_the_next_one_try(tmp_path: Path) -> None:
    def fails(_told: OnProgress) -> PredictionMap:
        raise ValueError("no motion")

    for _ in range(2):
        with pytest.raises(ValueError, match="no motion"):
            load_or_compute_map(tmp_path / "map.npz", fails, lambda *_progress: None)
    assert list(tmp_path.iterdir()) == []
