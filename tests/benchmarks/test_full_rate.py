"""The card's full rate over gRPC for ten minutes: no samples lost, sample counts equal to the driver's, CPU load.

The device server runs in its own process and repeats one second of the simulated bench.
"""

import multiprocessing
import time
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import psutil
import pytest
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason
from analysis.signals.header import Acquisition
from daq.config.loader import load_rig
from daq.config.rig import Rig
from daq.config.schema import Backend, DeviceSection
from daq.drivers.simulation.card import SimulatedCard
from daq.session.recording.recorded_run import RecordedRun
from recordings.mcap.reader import RunReader
from tests.benchmarks.bench_rig import RIG_FILE, RUN, request_for
from tests.daq.support.device_server import serving
from tests.daq.support.ni_driver import NiDriver
from tests.daq.support.recording import NoModel

pytestmark = pytest.mark.benchmark

RATE = 333_333.0
SECONDS = 600.0


class RepeatingCard:
    """A card that repeats the same samples."""

    n_samples = 1 << 60

    def __init__(self, codes: NDArray[np.int16], ticks: NDArray[np.int64], acquisition: Acquisition) -> None:
        self.acquisition = acquisition
        self._codes = codes
        self._ticks = ticks
        self._position = 0

    def ticks(self, first: int, stop: int) -> NDArray[np.int64]:
        rounds, per_sample = self._codes.shape[1], self.acquisition.ticks_per_sample
        offsets = round(rounds * per_sample) * np.arange(first // rounds, stop // rounds + 1, dtype=np.int64)
        ticks: NDArray[np.int64] = (offsets[:, np.newaxis] + self._ticks).ravel()
        return ticks[(ticks >= first * per_sample) & (ticks < stop * per_sample)]

    def next_codes(self, n: int) -> NDArray[np.int16]:
        index = (self._position + np.arange(n)) % self._codes.shape[1]
        self._position += n
        return self._codes[:, index]


def full_rate_rig(target: str = "") -> Rig:
    rig = load_rig(RIG_FILE)
    device = DeviceSection(backend=Backend.NIDAQMX, target=target)
    timing = rig.config.timing.model_copy(update={"rate_hz": RATE})
    return replace(rig, config=rig.config.model_copy(update={"device": device, "timing": timing}))


def serve(pipe: Connection) -> None:
    card = SimulatedCard(full_rate_rig())
    codes = card.next_codes(round(card.acquisition.rate))
    ticks = card.ticks(0, codes.shape[1])
    with serving(NiDriver(lambda: RepeatingCard(codes, ticks, card.acquisition), real_time=True)) as server:
        pipe.send(server.target)
        pipe.recv()
        pipe.send(server.tasks)


def cpu_time(process: psutil.Process) -> float:
    times = process.cpu_times()
    return times.user + times.system


def test_full_rate_over_grpc_loses_no_samples_in_ten_minutes(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    server = context.Process(target=serve, args=(there,))
    server.start()
    rig = full_rate_rig(str(here.recv()))
    path = tmp_path / f"{RUN}.mcap"
    run = RecordedRun(request_for(rig, tmp_path, duration=SECONDS), NoModel())
    watching = psutil.Process()
    (recorder,) = (
        child for child in watching.children() if child.pid != server.pid and "spawn_main" in " ".join(child.cmdline())
    )
    started, before, server_before, own_before = (
        time.monotonic(),
        cpu_time(recorder),
        cpu_time(psutil.Process(server.pid)),
        cpu_time(watching),
    )
    backlog = memory = 0.0
    while not run.wait(0.5):
        status = run.status()
        backlog = max(backlog, status.backlog)
        if status.elapsed < SECONDS - 2:
            until, after, memory = time.monotonic(), cpu_time(recorder), recorder.memory_info().rss / 1e6
            server_after, own_after = cpu_time(psutil.Process(server.pid)), cpu_time(watching)
    outcome = run.close()
    here.send("done")
    left = here.recv()
    server.join(10)
    seconds = until - started
    (end,) = outcome.ends
    with RunReader(path) as reader:
        clock, complete, recorded = reader.delivery.clock, reader.is_gap_free, reader.n_samples
    size, rate = path.stat().st_size / 1e6, run.header.acquisition.rate
    print(f"\n3 × {rate / 1e3:g} kS/s over gRPC for {recorded / rate:.0f} s: {recorded:,} samples a channel,")
    print(f"  lost {end.lost}, counts equal to the driver's: {not end.detail}; part of one core:")
    print(f"  {100 * (after - before) / seconds:5.1f} %  acquisition and recording")
    print(
        f"  {100 * (own_after - own_before) / seconds:5.1f} %  live analysis, which skipped {outcome.skipped:,} samples"
    )
    print(f"  {100 * (server_after - server_before) / seconds:5.1f} %  the stand-in device server")
    print(f"  largest backlog {backlog:.3f} s, recorder's memory {memory:.0f} MB, file {size:.0f} MB, {clock}")
    path.unlink()
    assert (end.reason, end.lost, end.lost_is_exact, end.detail) == (EndReason.FINISHED, 0, True, "")
    assert complete
    assert recorded == end.samples >= SECONDS * run.header.acquisition.rate
    assert left == []
    assert after - before < 0.15 * seconds
