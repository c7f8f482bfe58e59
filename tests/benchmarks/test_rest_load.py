"""Recording at 3 × 200 kS/s while 50 clients send requests."""

import multiprocessing
import random
import time
from collections import defaultdict
from contextlib import closing
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Thread

import httpx
import numpy as np
import pytest

from daq.reports.run_summaries import Summaries
from daq.service.app import create_app
from daq.service.jobs.queue import JobQueue
from daq.service.results_reader import ResultsReader
from daq.service.server import ServiceServer
from daq.service.state import ServiceState
from daq.session.predictor import Predictors
from daq.session.recording.recorded_run import RecordedRun
from recordings.catalogue.catalogue import Catalogue
from recordings.mcap.reader import RunReader
from tests.benchmarks.bench_rig import RUN, LiveRun, request_for, rig_with

pytestmark = pytest.mark.benchmark

BEFORE = "2026-11-24T08-00-00-gj90c"
CLIENTS, SECONDS = 50, 60.0
PAUSE = 0.05  # s between a response and the client's next request, as of a busy page
ARRIVAL = 2.0  # s over which the clients start
RATE = 200_000.0


def hammer(url: str, seconds: float, pipe: Connection) -> None:
    """Send the requests of 50 clients; runs in its own process so that its load is not the service's."""
    times: dict[str, list[float]] = defaultdict(list)
    statuses: dict[str, set[int]] = defaultdict(set)
    paths = [
        "/live", "/live", "/live", "/live/curves", "/runs", "/health", f"/runs/{BEFORE}", f"/runs/{BEFORE}/summary",
        f"/runs/{BEFORE}/analyses/bode?source=recorded", f"/runs/{BEFORE}/trend", f"/runs/{BEFORE}/findings",
        f"/runs/{BEFORE}/analyses/cascade?source=recorded&rows={{}}",
        f"/runs/{BEFORE}/analyses/waterfall?source=recorded&rows={{}}",
        f"/runs/{BEFORE}/analyses/orbit?source=recorded&time_s={{}}",
        f"/runs/{BEFORE}/analyses/order-spectrum?source=recorded",
        f"/runs/{BEFORE}/analyses/full-spectrum?source=recorded&time_s={{}}",
        f"/runs/{BEFORE}/samples?from_s={{}}&duration_s=0.05",
        f"/runs/{BEFORE}/samples?from_s={{}}&duration_s=1&format=npz", f"/runs/{BEFORE}/comparison?speed_rpm=1500",
    ]  # fmt: skip
    until = time.monotonic() + seconds

    def client(seed: int) -> None:
        chance = random.Random(seed)  # noqa: S311 - picks the next request
        time.sleep(seed * ARRIVAL / CLIENTS)
        with httpx.Client(base_url=f"{url}/api/v1", timeout=60.0) as connection:
            while time.monotonic() < until:
                path = chance.choice(paths)
                name = path.split("?")[0].replace(BEFORE, "{run}") + (" npz" if "npz" in path else "")
                started = time.perf_counter()
                response = connection.get(path.format(chance.randint(1, 8)))
                times[name].append(time.perf_counter() - started)
                statuses[name].add(response.status_code)
                time.sleep(PAUSE)

    threads = [Thread(target=client, args=(seed,)) for seed in range(CLIENTS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    pipe.send((dict(times), dict(statuses)))


def test_50_clients_cause_no_sample_loss(tmp_path: Path) -> None:
    rig = rig_with(tmp_path, ("rate_hz = 100_000", "rate_hz = 200_000"), ("time_s = 20", "time_s = 90"))
    folder = tmp_path / "data"
    folder.mkdir()
    live = LiveRun()
    with closing(Predictors()) as predictors, closing(ResultsReader(predictors)) as results:
        predictors.for_rig(rig).wait(120.0)
        before = RecordedRun(request_for(rig, folder, BEFORE, 10.0), predictors.for_rig(rig))
        assert before.wait(60.0)
        before.close()
        catalogue = Catalogue(folder)
        summaries = Summaries(catalogue, predictors, results.summary)
        state = ServiceState(catalogue, live, summaries, results, JobQueue(Catalogue(folder)))
        server = ServiceServer(create_app(state), closing=state.closing)
        server.start()
        httpx.get(f"{server.url}/api/v1/runs/{BEFORE}/analyses/bode?source=recorded", timeout=60.0)
        live.run = run = RecordedRun(request_for(rig, folder, RUN, SECONDS + 5.0), predictors.for_rig(rig))
        here, there = multiprocessing.get_context("spawn").Pipe()
        clients = multiprocessing.get_context("spawn").Process(target=hammer, args=(server.url, SECONDS, there))
        clients.start()
        backlog = 0.0
        while not run.wait(0.2):
            backlog = max(backlog, run.status().backlog)
        assert here.poll(120.0)
        times, statuses = here.recv()
        clients.join()
        outcome = run.close()
        server.close()
    print(f"\n{CLIENTS} clients for {SECONDS:g} s beside 3 × 200 kS/s; ms")
    print(f"  {'':34} {'requests':>8} {'p50':>8} {'p99':>8} {'max':>8}  statuses")
    for name, taken in sorted(times.items()):
        p50, p99 = np.percentile(taken, [50, 99]) * 1e3
        status_list = ", ".join(map(str, sorted(statuses[name])))
        print(f"  {name:34} {len(taken):8} {p50:8.1f} {p99:8.1f} {max(taken) * 1e3:8.1f}  {status_list}")
    with RunReader(folder / f"{RUN}.mcap") as reader:
        print(f"  recorded {reader.n_samples:,} samples a channel; largest backlog {backlog:.3f} s")
        print(f"  samples skipped by the live analysis: {outcome.skipped:,}")
        assert reader.is_gap_free
        assert reader.n_samples >= (SECONDS + 4.9) * RATE
    assert not any(status >= 500 and status != 503 for found in statuses.values() for status in found)
    assert np.percentile(times["/live"], 99) < 0.1
