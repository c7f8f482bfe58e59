"""Replay of a recording: the same samples, at the requested pace and for any block size."""

import threading
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import Acquisition, AnalysisSettings, Channel, Device, Limits, Role, RunHeader, Tacho
from daq.drivers.replay import ReplaySource
from recordings.errors import DamagedError, NotFoundError
from recordings.mcap.writer import RunWriter
from tests.daq.support.reblocking import reblocked

RATE = 10_000.0
BLOCK = 500
ENDS = (SegmentEnd(0, 3_250, EndReason.OVERRUN, lost=1_000), SegmentEnd(1, 2_000, EndReason.STOPPED))
HEADER = RunHeader(
    run="run",
    rig="rig",
    started_ns=1_795_511_527_000_000_000,
    acquisition=Acquisition(
        Device("nidaqmx", "USB-6251", "1A2B3C", "25.5", simulated=False),
        RATE,
        1e6,
        (Channel("tacho", Role.TACHO, "ai0", -10.0, 10.0, (0.0, 3e-4)),),
        Tacho(2.5, 1.0),
    ),
    settings=AnalysisSettings(),
    limits=Limits(80e-6, 95e-6, 100e-6, 2000.0),
    config_toml="",
    program="rig",
)


def codes_of(segment: int, n_samples: int) -> NDArray[np.int16]:
    return (np.arange(n_samples, dtype=np.int64) * 37 + segment).astype(np.int16)[np.newaxis]


@pytest.fixture
def run(tmp_path: Path) -> Path:
    writer = RunWriter(tmp_path / "run.mcap", HEADER)
    for end in ENDS:
        codes = codes_of(end.segment, end.samples)
        for first in range(0, end.samples, BLOCK):
            part = np.ascontiguousarray(codes[:, first : first + BLOCK])
            writer.write_block(SampleBlock(part, end.segment, first, 1_000 + first, first // BLOCK))
        writer.write_segment_end(end)
    writer.close()
    return writer.path


def ends_in(items: Iterable[SourceItem]) -> tuple[SegmentEnd, ...]:
    return tuple(item for item in items if isinstance(item, SegmentEnd))


@pytest.mark.parametrize("block", [None, 1, 7, 499, 500, 501, 2_000, 100_000])
def test_samples_and_ends_equal_the_recorded_ones_for_any_block_size(run: Path, block: int | None) -> None:
    source = ReplaySource(run, None)
    items = list(reblocked(source, block))
    source.close()
    assert ends_in(items) == ENDS
    for end in ENDS:
        blocks = [item for item in items if isinstance(item, SampleBlock) and item.segment == end.segment]
        np.testing.assert_array_equal(
            np.concatenate([b.codes for b in blocks], axis=1), codes_of(end.segment, end.samples)
        )
        assert [b.first_sample for b in blocks[1:]] == [b.end for b in blocks[:-1]]
        assert all(b.n_samples == (block or BLOCK) for b in blocks[:-1])
        assert all(b.codes.flags.c_contiguous for b in blocks)
        assert items.index(end) > items.index(blocks[-1])


def test_new_blocks_have_the_host_time_of_their_last_samples_recorded_block(run: Path) -> None:
    source = ReplaySource(run, None)
    blocks = [item for item in reblocked(source, 750) if isinstance(item, SampleBlock) and item.segment == 0]
    source.close()
    assert [b.end for b in blocks] == [750, 1500, 2250, 3000, 3250]
    assert [b.backlog for b in blocks] == [1, 2, 4, 5, 6]
    assert [b.host_time_ns for b in blocks] == [1500, 2000, 3000, 3500, 4000]


def test_acquisition_equals_the_recorded_one_including_the_device(run: Path) -> None:
    source = ReplaySource(run, None)
    assert source.acquisition == HEADER.acquisition
    assert source.header == HEADER
    source.close()


def test_replay_keeps_its_pace_over_a_gap(run: Path) -> None:
    source = ReplaySource(run, 2.0)
    started = time.monotonic()
    due = [
        (time.monotonic() - started, (item.end + 4_250 * item.segment) / RATE / 2.0)
        for item in source.blocks()
        if isinstance(item, SampleBlock)
    ]
    source.close()
    assert all(came >= when for came, when in due)
    assert min(came - when for came, when in due[-4:]) < 1.0


def test_replay_catches_up_after_a_late_reader(run: Path) -> None:
    source = ReplaySource(run, 1.0)
    started = time.monotonic()
    late = []
    for item in source.blocks():
        if isinstance(item, SampleBlock):
            late.append(time.monotonic() - started - (item.end + 4_250 * item.segment) / RATE)
        if len(late) == 1:
            time.sleep(0.4)
    source.close()
    assert 0.0 <= min(late[1:]) < 0.3  # deadlines are absolute: the pause is not added


def test_stop_from_another_thread_ends_the_replay_at_once(run: Path) -> None:
    source = ReplaySource(run, 0.01)
    timer = threading.Timer(0.05, source.stop)
    started = time.monotonic()
    timer.start()
    items = list(source.blocks())
    timer.join()
    source.close()
    assert time.monotonic() - started < 30.0  # of the 62 s that it would have taken
    assert items == [SegmentEnd(0, 0, EndReason.STOPPED)]


def test_stopped_replay_ends_its_segment_at_the_current_sample(run: Path) -> None:
    source = ReplaySource(run, None)
    items = []
    for item in source.blocks():
        items.append(item)
        if len(items) == 3:
            source.stop()
    source.close()
    assert ends_in(items) == (SegmentEnd(0, 3 * BLOCK, EndReason.STOPPED),)
    assert isinstance(items[-1], SegmentEnd)


def test_truncated_recording_is_replayed_up_to_its_end(run: Path) -> None:
    run.write_bytes(run.read_bytes()[:-20])
    source = ReplaySource(run, None)
    assert ends_in(source.blocks()) == ENDS
    source.close()


def test_unreadable_file_ends_the_segment(run: Path) -> None:
    source = ReplaySource(run, None)
    items = []
    for item in source.blocks():
        items.append(item)
        source.close()
    assert isinstance(items[-1], SegmentEnd)
    assert items[-1].reason is EndReason.DEVICE_ERROR
    assert not items[-1].lost_is_exact
    assert "run.mcap: cannot be read" in items[-1].detail


def test_missing_recording_is_named(tmp_path: Path) -> None:
    with pytest.raises(NotFoundError, match=r"gone\.mcap"):
        ReplaySource(tmp_path / "gone.mcap")


def test_damaged_recording_is_named(tmp_path: Path) -> None:
    (tmp_path / "run.mcap").write_bytes(b"")
    with pytest.raises(DamagedError, match="is empty"):
        ReplaySource(tmp_path / "run.mcap")


@pytest.mark.parametrize("pace", [0.0, -1.0, float("nan")])
def test_invalid_pace_is_refused(run: Path, pace: float) -> None:
    with pytest.raises(ValueError, match="pace:"):
        ReplaySource(run, pace)
