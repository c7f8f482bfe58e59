"""Sweeps: equal results from all workers, and no result lost when a process dies."""

import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import FrameType
from typing import TypeVar

import distributed
import numpy as np
import psutil
import pytest
from pyarrow import parquet

from daq.errors import UsageError
from daq.session.sweep import DaskWorkers, LocalWorkers, SweepStore, Workers, grid, run_sweep
from model.rotor.gj90c import gj90c
from model.studies.sweep_quantities import QUANTITIES, SweepPoint, SweepResult

Task = TypeVar("Task")
Result = TypeVar("Result")


class InProcessWorkers:
    """Computes in this process; raises KeyboardInterrupt after ``max_tasks`` tasks."""

    def __init__(self, max_tasks: int | None = None) -> None:
        self._max_tasks = max_tasks
        self.tasks = 0

    def run(self, function: Callable[[Task], Result], tasks: Sequence[Task]) -> Iterator[tuple[int, Result]]:
        for number, task in reversed(list(enumerate(tasks))):
            if self.tasks == self._max_tasks:
                raise KeyboardInterrupt
            self.tasks += 1
            yield number, function(task)


def ignore_progress(_done: int, _total: int) -> None:
    pass


def points(count: int) -> list[SweepPoint]:
    vary = {
        "viscosity_pa_s": np.linspace(0.005, 0.035, count // 10).tolist(),
        "imbalance_kg_m": np.geomspace(2.5e-7, 2.5e-6, 5).tolist(),
        "speed_rad_s": [800.0, 1600.0],
    }
    return grid(gj90c(), "response", vary)


def bits(outcomes: Sequence[SweepResult]) -> bytes:
    assert not any(outcome.fault for outcome in outcomes)
    return np.array([outcome.results for outcome in outcomes]).tobytes()


@pytest.fixture(scope="module")
def cluster() -> Iterator[distributed.LocalCluster]:
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=":0", silence_logs=50
    ) as running:
        yield running


def test_grid_holds_all_combinations_the_last_name_fastest() -> None:
    found = grid(gj90c(), "response", {"viscosity_pa_s": [0.01, 0.02], "speed_rad_s": [1.0, 2.0, 3.0]})
    assert [point.values[0][1] for point in found] == [0.01] * 3 + [0.02] * 3
    assert [point.values[1][1] for point in found] == [1.0, 2.0, 3.0] * 2
    assert len({point.key() for point in found}) == 6


def test_key_depends_on_parameters_and_values_only() -> None:
    one = SweepPoint(gj90c(), "response", (("viscosity_pa_s", 0.01), ("speed_rad_s", 1.0)))
    assert one.key() == SweepPoint(gj90c(), "response", one.values[::-1]).key()
    assert one.key() != SweepPoint(gj90c(imbalance=6e-7), "response", one.values).key()
    assert one.key() != SweepPoint(gj90c(), "onset", one.values).key()


def test_unknown_parameter_is_refused_by_name() -> None:
    with pytest.raises(UsageError, match="vary viscosity: unknown, expected one of imbalance_kg_m"):
        grid(gj90c(), "response", {"viscosity": [0.01]})


def test_sweep_writes_values_and_results_in_the_order_of_its_points(tmp_path: Path) -> None:
    file = tmp_path / "out.parquet"
    found = run_sweep(points(20), InProcessWorkers(), file, ignore_progress)
    table = parquet.read_table(file)
    assert table.column_names == [
        "key", "viscosity_pa_s", "imbalance_kg_m", "speed_rad_s", *QUANTITIES["response"].results, "fault",
    ]  # fmt: skip
    assert table.column("amplitude_um_pk").to_pylist() == [outcome.results[0] for outcome in found]
    assert table.column("key").to_pylist() == [point.key() for point in points(20)]
    assert list(tmp_path.iterdir()) == [file]


def test_resumed_sweep_computes_only_the_missing_points(tmp_path: Path) -> None:
    file = tmp_path / "out.parquet"
    with pytest.raises(KeyboardInterrupt):
        run_sweep(points(20), InProcessWorkers(max_tasks=7), file, ignore_progress)
    assert not file.exists()
    rest = InProcessWorkers()
    progress: list[int] = []
    resumed = run_sweep(points(20), rest, file, lambda done, _total: progress.append(done))
    assert (rest.tasks, progress[0]) == (13, 7)
    assert bits(resumed) == bits(run_sweep(points(20), InProcessWorkers(), tmp_path / "whole.parquet", ignore_progress))
    repeated = InProcessWorkers()
    run_sweep(points(20), repeated, file, ignore_progress)
    assert repeated.tasks == 0


def test_point_that_the_model_refuses_has_a_fault_and_the_sweep_continues(tmp_path: Path) -> None:
    file = tmp_path / "out.parquet"
    found = run_sweep(
        grid(gj90c(), "response", {"imbalance_kg_m": [5e-7, 1.0]}), InProcessWorkers(), file, ignore_progress
    )
    assert found[0].fault == ""
    assert "imbalance: 1 kg m at station 5, expected at most" in found[1].fault
    assert np.isnan(found[1].results).all()


def test_file_of_another_quantity_is_refused_and_unchanged(tmp_path: Path) -> None:
    file = tmp_path / "out.parquet"
    run_sweep(grid(gj90c(), "critical", {"stiffness_n_m": [1e4]}), InProcessWorkers(), file, ignore_progress)
    before = file.read_bytes()
    with pytest.raises(UsageError, match="holds results of another quantity"):
        run_sweep(points(20), InProcessWorkers(), file, ignore_progress)
    assert file.read_bytes() == before
    (tmp_path / "torn.parquet").write_bytes(before[:40])
    with pytest.raises(UsageError, match="no readable Parquet file"):
        SweepStore(tmp_path / "torn.parquet", ()).load([])


def test_local_processes_give_identical_results_also_when_one_is_killed(tmp_path: Path) -> None:
    killed: list[int] = []

    def kill_one(done: int, _total: int) -> None:
        if done and not killed:
            process = multiprocessing.active_children()[0]
            killed.append(process.pid or 0)
            process.kill()

    found = run_sweep(points(200), LocalWorkers(2), tmp_path / "out.parquet", kill_one)
    assert killed
    assert bits(found) == bits(run_sweep(points(200), InProcessWorkers(), tmp_path / "here.parquet", ignore_progress))


def suspend_process(_point: int) -> None:
    os.kill(os.getpid(), signal.SIGSTOP)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_interrupted_sweep_ends_its_suspended_processes() -> None:
    def interrupt_when_suspended(_number: int, _frame: FrameType | None) -> None:
        states = [psutil.Process(process.pid).status() for process in multiprocessing.active_children()]
        if states != ["stopped"]:
            signal.setitimer(signal.ITIMER_REAL, 0.05)
            return
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt_when_suspended)
    signal.setitimer(signal.ITIMER_REAL, 0.05)
    try:
        with pytest.raises(KeyboardInterrupt):
            list(LocalWorkers(1).run(suspend_process, [0, 1]))
    finally:
        signal.signal(signal.SIGALRM, before)
    assert not multiprocessing.active_children()


KILLED = """
import multiprocessing, os, signal
from daq.session.sweep import LocalWorkers

for _ in LocalWorkers(2).run(abs, range(100)):
    print(*(process.pid for process in multiprocessing.active_children()), flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_processes_end_when_their_sweep_is_killed() -> None:
    output = subprocess.run(
        [sys.executable, "-c", KILLED], check=False, stdout=subprocess.PIPE, text=True, timeout=60
    ).stdout
    workers = [int(pid) for pid in output.split()]
    assert workers
    end = time.monotonic() + 60.0
    while any(psutil.pid_exists(pid) and psutil.Process(pid).status() != psutil.STATUS_ZOMBIE for pid in workers):
        assert time.monotonic() < end
        time.sleep(0.05)


def test_two_dask_workers_give_identical_results(tmp_path: Path, cluster: distributed.LocalCluster) -> None:
    _compare_with_cluster(points(100), cluster, tmp_path, ignore_progress, InProcessWorkers())


def test_missing_scheduler_is_refused() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # bound, not listening: so that connections time out
        with pytest.raises(UsageError, match="no Dask scheduler answers there"):
            DaskWorkers(f"tcp://127.0.0.1:{taken.getsockname()[1]}", connect_timeout=0.5)


@pytest.mark.campaign
def test_2000_points_on_two_dask_workers_are_identical_also_when_one_is_killed(
    tmp_path: Path, cluster: distributed.LocalCluster
) -> None:
    with distributed.Client(cluster, set_as_default=False) as client:
        victim = next(iter(client.run(os.getpid).values()))
    done_before: list[int] = []

    def kill_one(done: int, total: int) -> None:
        if done > total // 4 and not done_before:
            done_before.append(done)
            os.kill(victim, signal.SIGTERM if os.name == "nt" else signal.SIGKILL)

    _compare_with_cluster(points(2000), cluster, tmp_path, ignore_progress, LocalWorkers(2))
    _compare_with_cluster(points(2000), cluster, tmp_path, kill_one, LocalWorkers(2))
    assert done_before


def _compare_with_cluster(
    chosen: list[SweepPoint],
    cluster: distributed.LocalCluster,
    folder: Path,
    on_progress: Callable[[int, int], None],
    others: Workers,
) -> None:
    workers = DaskWorkers(cluster.scheduler_address)
    file = folder / "cluster.parquet"
    try:
        found = run_sweep(chosen, workers, file, on_progress)
    finally:
        workers.close()
    file.unlink()
    assert len(found) == len(chosen)
    assert bits(found) == bits(run_sweep(chosen, others, folder / "local.parquet", ignore_progress))
