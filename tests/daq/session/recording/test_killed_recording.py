"""A recording killed at a random time loses at most 0.25 s, and the rest of its file can be recovered."""

import multiprocessing
import os
import random
import re
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from ctypes import c_int64
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path

import numpy as np
import psutil
import pytest

from analysis.signals.blocks import EndReason, SampleBlock
from daq.config.loader import load_rig
from daq.drivers.factory import open_source
from daq.session.recording.recorder import RecordingRequest, run_header
from recordings.integrity.recover import recover
from recordings.integrity.verify import Verdict, verify
from recordings.mcap.reader import RunReader
from recordings.mcap.writer import RunWriter
from tests.daq.support.commands import recorded_samples

RATE = 50_000.0
BLOCK = 0.05


def record_endlessly(rig_toml: Path, path: Path, taken: "Synchronized[int]") -> None:
    """Record a simulated rig like the recorder, and count the samples taken from the source."""
    rig = load_rig(rig_toml)
    request = RecordingRequest(
        rig=rig, run=path.stem, started_ns=time.time_ns(), note="", program="rig", path=path, duration=None
    )
    source = open_source(rig)
    writer = RunWriter(path, run_header(request, source))
    for item in source.blocks():
        if isinstance(item, SampleBlock):
            with taken.get_lock():
                taken.value += item.n_samples
            writer.write_block(item)


@pytest.mark.parametrize("n_kills", [2, pytest.param(100, marks=pytest.mark.campaign)], ids=["few", "full"])
def test_killed_recording_loses_a_quarter_second_at_most(
    rig_file: Callable[..., Path], tmp_path: Path, n_kills: int
) -> None:
    profile = [{"time_s": 0.0, "speed_rpm": 6000.0}, {"time_s": 600.0, "speed_rpm": 6000.0}]
    rig_toml = rig_file(timing={"rate_hz": RATE}, simulation={"pace": "real time", "profile": profile})
    context = multiprocessing.get_context("spawn")
    chance = random.Random(17)  # noqa: S311 - times, not secrets
    losses = []
    for k in range(n_kills):
        path = tmp_path / f"run-{k}.mcap"
        taken: Synchronized[int] = context.Value(c_int64, 0)
        process = context.Process(target=record_endlessly, args=(rig_toml, path, taken))
        process.start()
        deadline = time.monotonic() + 60
        while taken.value < RATE / 2:
            assert time.monotonic() < deadline
            assert process.is_alive()
            time.sleep(0.01)
        time.sleep(chance.uniform(0.0, 0.5))
        process.kill()
        process.join()
        with RunReader(path) as reader:
            losses.append((taken.value - reader.n_samples) / RATE)
            assert not reader.is_complete
            assert reader.segment_ends[-1].reason is EndReason.CUT
            n_recorded = reader.n_samples
        assert verify(path).verdict is Verdict.DAMAGED
        recovery = recover(path, tmp_path / "copy.mcap")
        assert recovery.samples == n_recorded
        assert verify(recovery.target).verdict is Verdict.INTACT
        recovery.target.unlink()
        path.unlink()
    print(f"{n_kills} kills: worst loss {max(losses):.3f} s, mean {sum(losses) / n_kills:.3f} s")
    assert min(losses) >= 0
    assert max(losses) <= 0.25


def taken_before_kill(leader: psutil.Process) -> int:
    """Kill a process with all its children and return the samples per channel published in the ring.

    The ring's memory is deleted then; it is read through its open file.
    """
    processes = [leader, *leader.children(recursive=True)]
    for process in processes:
        process.suspend()  # first, so that none sees another die
    shared = [path for path in Path(f"/proc/{leader.pid}/fd").iterdir() if "/pym-" in str(path.readlink())]
    with ExitStack() as stack:
        files = [stack.enter_context(path.open("rb")) for path in shared]
        ring = max(files, key=lambda file: os.fstat(file.fileno()).st_size)  # the other one holds the statistics
        for process in processes:
            process.kill()
        _, alive = psutil.wait_procs(processes, timeout=60)
        assert not alive
        assert os.fstat(ring.fileno()).st_nlink == 0
        return int(np.fromfile(ring, dtype=np.int64, count=6)[-1])  # the last word of the header


@pytest.mark.skipif(sys.platform != "linux", reason="SIGKILL and /proc of Linux")
@pytest.mark.parametrize("n_kills", [1, pytest.param(100, marks=pytest.mark.campaign)], ids=["one", "full"])
def test_command_killed_with_all_its_processes_loses_a_quarter_second_at_most(
    rig_file: Callable[..., Path], tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, n_kills: int
) -> None:
    profile = [{"time_s": 0.0, "speed_rpm": 3000.0}, {"time_s": 600.0, "speed_rpm": 3000.0}]
    simulation = {"pace": "real time", "profile": profile}
    rig_toml = rig_file(timing={"block_s": BLOCK}, simulation=simulation, limits={"speed_rpm": 4000.0})
    rate = load_rig(rig_toml).config.timing.rate_hz
    cache = str(tmp_path_factory.getbasetemp() / "cache")
    environment = os.environ | {"RIG_DATA": str(tmp_path / "data"), "RIG_CACHE": cache}
    command = [sys.executable, "-m", "daq.cli.main", "record", str(rig_toml), "--no-view", "--port", "0"]
    chance = random.Random(18)  # noqa: S311 - times, not secrets
    losses = []
    for _ in range(n_kills):
        with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as started:
            assert started.stderr is not None
            address = next(
                found[1] for line in started.stderr if (found := re.search(r"page (http://[\d.:]+)", line)) is not None
            )
            leader = psutil.Process(started.pid)
            stop_at = time.monotonic() + chance.uniform(1.0, 2.0)
            while recorded_samples(address) < rate or time.monotonic() < stop_at:
                time.sleep(0.01)
            taken = taken_before_kill(leader)
        (path,) = (tmp_path / "data").glob("*.mcap")
        with RunReader(path) as reader:
            losses.append((taken - reader.n_samples) / rate)
            assert not reader.is_complete
            assert reader.segment_ends[-1].reason is EndReason.CUT
            n_recorded = reader.n_samples
        recovery = recover(path, tmp_path / "copy.mcap")
        assert recovery.samples == n_recorded
        assert verify(recovery.target).verdict is Verdict.INTACT
        recovery.target.unlink()
        path.unlink()
    print(f"{n_kills} kills of all processes: worst loss {max(losses):.3f} s, mean {sum(losses) / n_kills:.3f} s")
    assert min(losses) >= -BLOCK  # a block is in the file before it is in the ring
    assert max(losses) <= 0.25
