"""A reader that stalls for longer than the card's buffer: the file contains the loss."""

import time
from dataclasses import replace
from pathlib import Path

import pytest

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from daq.config.rig import Rig
from daq.config.schema import Backend, DeviceSection, TimingSection
from daq.drivers.factory import open_source
from daq.drivers.simulation.card import SimulatedCard
from daq.session.recording.recorder import run_header
from recordings.mcap.reader import RunReader
from recordings.mcap.writer import RunWriter
from tests.daq.support.device_server import serving
from tests.daq.support.ni_bench import bench
from tests.daq.support.ni_driver import NiDriver
from tests.daq.support.recording import recording_request

STALL = 1.0  # s
TIMING = TimingSection(rate_hz=30_000.0, block_s=0.05, buffer_s=0.5)


def recorded_with_stall(rig: Rig, folder: Path) -> tuple[SegmentEnd, ...]:
    """Record three blocks, stall, record three more; return the segment ends in the file."""
    made = recording_request(rig, folder)
    source = open_source(made.rig)
    writer = RunWriter(made.path, run_header(made, source))
    blocks = 0
    for item in source.blocks():
        if isinstance(item, SegmentEnd):
            writer.write_segment_end(item)
            continue
        writer.write_block(item)
        blocks += 1
        if blocks == 3:
            time.sleep(STALL)
        if blocks == 6:
            source.stop()
    source.close()
    writer.close()
    with RunReader(made.path) as reader:
        assert reader.is_complete
        assert not reader.is_gap_free
        assert sum(item.n_samples for item in reader.items() if isinstance(item, SampleBlock)) == reader.n_samples
        return reader.segment_ends


def stalled_rig(target: str) -> Rig:
    rig = bench(target)
    config = rig.config.model_copy(update={"timing": TIMING})
    if not target:
        config = config.model_copy(update={"device": DeviceSection(backend=Backend.SIMULATED)})
    return replace(rig, config=config)


def test_loss_at_a_server_is_a_lower_bound_from_its_sample_count(
    tmp_path: Path,
) -> None:
    with serving(NiDriver(lambda: SimulatedCard(bench()), real_time=True)) as server:
        overrun, stopped = recorded_with_stall(stalled_rig(server.target), tmp_path)
        first, second = server.driver.starts
        assert server.tasks == []
    assert (overrun.reason, overrun.samples) == (EndReason.OVERRUN, first.position)
    assert overrun.lost == first.acquired - first.position
    assert not overrun.lost_is_exact
    assert overrun.lost == pytest.approx(STALL * 29_985, rel=0.2)
    assert (stopped.reason, stopped.samples) == (EndReason.STOPPED, second.position)


def test_loss_of_the_simulated_card_is_exact(tmp_path: Path) -> None:
    overrun, stopped = recorded_with_stall(stalled_rig(""), tmp_path)
    assert (overrun.reason, overrun.lost_is_exact) == (EndReason.OVERRUN, True)
    card = SimulatedCard(stalled_rig(""))
    card.skip(overrun.samples + overrun.lost)
    with RunReader(recording_request(stalled_rig(""), tmp_path).path) as reader:
        after = reader.samples(1, 0, stopped.samples)
    assert (card.next_codes(stopped.samples) == after).all()
