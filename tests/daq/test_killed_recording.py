"""A live recording that is killed at any moment loses a quarter second at most, and what is left can be recovered."""

import multiprocessing
import random
import time
from collections.abc import Callable
from ctypes import c_int64
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path

import pytest

from analysis.samples import EndReason, SampleBlock
from daq.config.load import load_rig
from daq.drivers.opening import open_source
from daq.session.messages import Order
from daq.session.recorder import run_header
from recordings.reader import RunReader
from recordings.recover import recover
from recordings.verify import Verdict, verify
from recordings.writer import RunWriter

RATE = 50_000.0


def record_for_ever(rig_toml: Path, path: Path, taken: "Synchronized[int]") -> None:
    """Carry a simulated rig's samples into a file, as the recorder does, and count what was taken from the source."""
    rig = load_rig(rig_toml)
    order = Order(rig=rig, run=path.stem, started_ns=time.time_ns(), note="", program="rig", path=path, duration=None)
    source = open_source(rig)
    writer = RunWriter(path, run_header(order, source))
    for item in source.blocks():
        if isinstance(item, SampleBlock):
            with taken.get_lock():
                taken.value += item.n_samples
            writer.block(item)


@pytest.mark.parametrize("n_kills", [2, pytest.param(100, marks=pytest.mark.campaign)], ids=["few", "full"])
def test_a_killed_recording_loses_a_quarter_second_at_most(
    rig_file: Callable[..., Path], tmp_path: Path, n_kills: int
) -> None:
    profile = [{"time_s": 0.0, "speed_rpm": 6000.0}, {"time_s": 600.0, "speed_rpm": 6000.0}]
    rig_toml = rig_file(timing={"rate_hz": RATE}, simulation={"pace": "real time", "profile": profile})
    context = multiprocessing.get_context("spawn")
    chance = random.Random(17)  # noqa: S311 - moments, not secrets
    losses = []
    for k in range(n_kills):
        path = tmp_path / f"run-{k}.mcap"
        taken: Synchronized[int] = context.Value(c_int64, 0)
        process = context.Process(target=record_for_ever, args=(rig_toml, path, taken))
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
            kept = reader.n_samples
        assert verify(path).verdict is Verdict.NOT_WHOLE
        recovery = recover(path, tmp_path / "copy.mcap")
        assert recovery.samples == kept
        assert verify(recovery.target).verdict is Verdict.SOUND
        recovery.target.unlink()
        path.unlink()
    print(f"{n_kills} kills: worst loss {max(losses):.3f} s, mean {sum(losses) / n_kills:.3f} s")
    assert min(losses) >= 0
    assert max(losses) <= 0.25
