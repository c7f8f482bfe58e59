"""The simulated card as a source: pace, buffer, stop and segment ends."""

import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from daq.config.rig import Rig
from daq.drivers.factory import open_source
from daq.drivers.simulation.card import SimulatedCard, SimulatedSource
from daq.drivers.source import RestartLimiter
from daq.errors import DeviceError
from model.errors import WallContactError

RigFactory = Callable[..., Rig]

PACED = {"simulation": {"pace": "real time"}, "timing": {"block_s": 0.05}}
RATE = 20_000


def split(items: list[SourceItem]) -> tuple[list[SampleBlock], list[SegmentEnd]]:
    """Return blocks and ends separately, in order."""
    blocks = [item for item in items if isinstance(item, SampleBlock)]
    return blocks, [item for item in items if isinstance(item, SegmentEnd)]


def next_block(items: Iterator[SourceItem]) -> SampleBlock:
    item = next(items)
    assert isinstance(item, SampleBlock)
    return item


def paced(rig: RigFactory, *, buffer: int) -> SimulatedSource:
    """Return a source in real time with a small buffer, in samples."""
    return SimulatedSource(SimulatedCard(rig()), block=1000, buffer=buffer, real_time=True, restarts=RestartLimiter(5))


def test_blocks_are_contiguous_up_to_the_end_of_the_profile(rig: RigFactory) -> None:
    bench = rig(timing={"block_s": 0.15})
    source = open_source(bench)
    blocks, ends = split(list(source.blocks()))
    assert [block.first_sample for block in blocks] == list(range(0, 40_000, 3000))
    assert [block.n_samples for block in blocks] == [3000] * 13 + [1000]
    assert ends == [SegmentEnd(0, 40_000, EndReason.FINISHED)]
    codes = np.concatenate([block.codes for block in blocks], axis=1)
    np.testing.assert_array_equal(codes, SimulatedCard(bench).next_codes(40_000))
    assert all(block.codes.flags.c_contiguous for block in blocks)


def test_flat_out_is_much_faster_than_real_time(rig: RigFactory) -> None:
    profile = [{"time_s": 0.0, "speed_rpm": 6000.0}, {"time_s": 20.0, "speed_rpm": 6000.0}]
    source = open_source(rig(simulation={"profile": profile}))
    started = time.monotonic()
    assert len(list(source.blocks())) == 201
    assert time.monotonic() - started < 15.0  # for 20 s of samples, even on a busy machine


def test_real_time_keeps_its_pace_without_drift(rig: RigFactory) -> None:
    source = open_source(rig(**PACED))
    items = source.blocks()
    started = time.monotonic()
    arrivals = []
    for number in range(12):
        next_block(items)
        arrivals.append(time.monotonic() - started - 0.05 * (number + 1))
        time.sleep(0.045)
    source.stop()
    assert min(arrivals) > -0.002
    assert min(arrivals[-4:]) < 0.3  # a pace that waits for its reader would be at least 8 × 45 ms late


def test_backlog_is_how_late_the_reader_is(rig: RigFactory) -> None:
    source = paced(rig, buffer=RATE)
    items = source.blocks()
    started = time.monotonic()
    next_block(items)
    time.sleep(0.3)
    late = next_block(items)
    assert 0.24 * RATE <= late.backlog <= (time.monotonic() - started) * RATE
    source.stop()


def test_late_reader_overruns_the_buffer_and_continues_in_the_next_segment(rig: RigFactory) -> None:
    source = paced(rig, buffer=8000)
    items = source.blocks()
    started = time.monotonic()
    first = next_block(items)
    time.sleep(0.6)
    end = next(items)
    assert isinstance(end, SegmentEnd)
    assert (end.segment, end.samples, end.reason) == (0, 1000, EndReason.OVERRUN)
    assert end.lost_is_exact
    assert 0.59 * RATE <= end.lost <= (time.monotonic() - started) * RATE
    assert "the card's buffer holds 0.4 s" in end.detail

    following = next_block(items)
    source.stop()
    assert (following.segment, following.first_sample) == (1, 0)
    card = SimulatedCard(rig())
    np.testing.assert_array_equal(card.next_codes(1000), first.codes)
    card.skip(end.lost)
    np.testing.assert_array_equal(card.next_codes(1000), following.codes)


def test_reader_that_is_always_late_ends_the_run(rig: RigFactory) -> None:
    ends = []
    for item in paced(rig, buffer=500).blocks():
        if isinstance(item, SegmentEnd):
            ends.append(item)
        time.sleep(0.06)
    assert [end.segment for end in ends] == list(range(6))
    assert {end.reason for end in ends} == {EndReason.OVERRUN}


def test_stop_from_another_thread_ends_within_a_block(rig: RigFactory) -> None:
    source = open_source(rig(**PACED))
    threading.Timer(0.12, source.stop).start()
    blocks, ends = split(list(source.blocks()))
    assert ends == [SegmentEnd(0, sum(block.n_samples for block in blocks), EndReason.STOPPED)]
    assert len(blocks) >= 1


@pytest.mark.parametrize("stop", [SimulatedSource.stop, SimulatedSource.close])
def test_source_stopped_before_its_start_gives_no_samples(
    rig: RigFactory, stop: Callable[[SimulatedSource], None]
) -> None:
    source = paced(rig, buffer=RATE)
    stop(source)
    assert list(source.blocks()) == [SegmentEnd(0, 0, EndReason.STOPPED)]


class TouchingCard(SimulatedCard):
    """A card whose shaft touches the wall after a number of samples."""

    touches = 2500

    def next_codes(self, n: int) -> NDArray[np.int16]:
        if self.n_read + n > self.touches:
            raise WallContactError("the shaft touches the wall")
        return super().next_codes(n)


def test_shaft_that_reaches_the_wall_ends_the_run_with_a_device_error(rig: RigFactory) -> None:
    source = SimulatedSource(TouchingCard(rig()), block=1000, buffer=RATE, real_time=False, restarts=RestartLimiter(5))
    blocks, ends = split(list(source.blocks()))
    assert [block.end for block in blocks] == [1000, 2000]
    assert ends == [SegmentEnd(0, 2000, EndReason.DEVICE_ERROR, detail="the shaft touches the wall")]


def test_shaft_that_reaches_the_wall_in_skipped_samples_ends_the_next_segment(rig: RigFactory) -> None:
    source = SimulatedSource(TouchingCard(rig()), block=1000, buffer=500, real_time=True, restarts=RestartLimiter(5))
    items = source.blocks()
    next_block(items)
    time.sleep(0.2)
    _, ends = split(list(items))
    assert [(end.segment, end.samples, end.reason) for end in ends] == [
        (0, 1000, EndReason.OVERRUN),
        (1, 0, EndReason.DEVICE_ERROR),
    ]


def test_rig_with_the_real_card_uses_the_ni_driver(rig: RigFactory) -> None:
    """No server listens at port 1, so opening the card fails with a DeviceError."""
    card = {"backend": "nidaqmx", "target": "127.0.0.1:1", "deadline_s": 0.5}
    with pytest.raises(DeviceError):
        open_source(rig(device=card))
