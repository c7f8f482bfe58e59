"""CPU load of each part of a run at 3 × 200 kS/s, and memory over an hour."""

import threading
import time
from contextlib import closing
from pathlib import Path

import psutil
import pytest

from daq.reports.run_summaries import Summaries
from daq.service.app import create_app
from daq.service.server import ServiceServer
from daq.session.predictor import Predictors
from daq.session.recording.recorded_run import RecordedRun
from daq.view.live_view import LiveView
from recordings.catalogue.catalogue import Catalogue
from recordings.mcap.reader import RunReader
from tests.benchmarks.bench_rig import RUN, LiveRun, request_for, rig_with
from tests.daq.support.service_bench import service_state

pytestmark = pytest.mark.benchmark


def loads_by_thread(process: psutil.Process) -> dict[str, float]:
    """Return the CPU time of a process's threads, s, by name; native threads together."""
    names = {thread.native_id: thread.name for thread in threading.enumerate()}
    loads: dict[str, float] = {}
    for thread in process.threads():
        name = names.get(thread.id, "native threads (view server, numerics)")
        loads[name] = loads.get(name, 0.0) + thread.user_time + thread.system_time
    return loads


def test_analysis_view_and_service_keep_up_with_3_times_200_kilosamples(tmp_path: Path) -> None:
    rig = rig_with(tmp_path, ("rate_hz = 100_000", "rate_hz = 200_000"), ("time_s = 20", "time_s = 60"))
    watching = psutil.Process()
    live = LiveRun()
    view = LiveView()
    with closing(Predictors()) as predictors:
        predictors.for_rig(rig).wait(120.0)
        catalogue = Catalogue(tmp_path)
        state = service_state(catalogue, live, Summaries(catalogue, predictors))
        server = ServiceServer(create_app(state, view.url), closing=state.closing)
        server.start()
        live.run = run = RecordedRun(request_for(rig, tmp_path), predictors.for_rig(rig), [view])
        (recorder,) = (child for child in watching.children() if "spawn_main" in " ".join(child.cmdline()))
        before, since, recorder_before = loads_by_thread(watching), time.monotonic(), recorder.cpu_times()
        backlog = 0.0
        while not run.wait(0.5):
            backlog = max(backlog, run.status().backlog)
            if run.status().elapsed < 59:
                after, until, recorder_after = loads_by_thread(watching), time.monotonic(), recorder.cpu_times()
        outcome = run.close()
        server.close()
        view.close()
    seconds = until - since
    spent = recorder_after.user + recorder_after.system - recorder_before.user - recorder_before.system
    print(f"\nload of a run at 3 × {run.header.acquisition.rate / 1e3:g} kS/s over {seconds:.0f} s, part of one core:")
    print(f"  {100 * spent / seconds:6.1f} %  recorder (simulated card, writer, ring)")
    for name in sorted(after, key=lambda name: before.get(name, 0.0) - after[name]):
        print(f"  {100 * (after[name] - before.get(name, 0.0)) / seconds:6.1f} %  {name}")
    print(f"  largest backlog {backlog:.3f} s, skipped {outcome.skipped} samples, dropped {view.dropped} view updates")
    assert outcome.exit_code == 0
    assert all(end.is_gap_free for end in outcome.ends)
    assert outcome.skipped == 0
    assert view.dropped < 0.05 * 600
    assert spent < 0.6 * seconds


def test_memory_is_constant_over_an_hour(tmp_path: Path) -> None:
    rig = rig_with(
        tmp_path,
        ('pace = "real time"', 'pace = "flat out"'),
        ("time_s = 20\n", "time_s = 3600\n"),
    )
    watching = psutil.Process()
    with closing(Predictors()) as predictors:
        predictors.for_rig(rig).wait(120.0)
        run = RecordedRun(request_for(rig, tmp_path), predictors.for_rig(rig))
        (recorder,) = (child for child in watching.children() if "spawn_main" in " ".join(child.cmdline()))
        memory: list[tuple[float, float, float]] = []
        started = time.monotonic()
        while not run.wait(0.5):
            try:
                memory.append(
                    (run.status().elapsed, recorder.memory_info().rss / 1e6, watching.memory_info().rss / 1e6)
                )
            except psutil.NoSuchProcess:
                break
        wall = time.monotonic() - started
        outcome = run.close()
    settled = [row for row in memory if row[0] > 360]
    print(
        f"\none hour in {wall:.0f} s ({3600 / wall:.0f} × real time); resident memory, MB, after 6 min and at the end:"
    )
    for column, name in ((1, "recorder"), (2, "watching process")):
        print(
            f"  {name}: {settled[0][column]:.0f} → {settled[-1][column]:.0f}, max {max(r[column] for r in memory):.0f}"
        )
        assert settled[-1][column] - settled[0][column] < 30
    assert outcome.exit_code == 0
    with RunReader(tmp_path / f"{RUN}.mcap") as reader:
        assert reader.is_complete
        assert reader.n_samples == round(3600 * reader.header.acquisition.rate)
