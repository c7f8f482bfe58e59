"""Recordings that start and stop by themselves."""

from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from analysis.run import Acquisition
from analysis.samples import EndReason, SampleBlock, SegmentEnd, SourceItem
from daq.config.condition import Condition, read_condition
from daq.config.rig import Rig
from daq.config.trigger import with_trigger
from daq.drivers.opening import open_triggered
from daq.drivers.simulated_card import SimulatedCard
from daq.drivers.source import Source
from daq.drivers.triggered import Triggered
from daq.errors import ConfigError
from daq.session.frame import RunState
from recordings.reader import RunReader
from tests.daq.test_recorded import recorded
from tests.daq.test_watchdog import seen_within

RigFactory = Callable[..., Rig]

RATE = 20_000
RAMP = {
    "profile": [{"time_s": 0, "speed_rpm": 3000}, {"time_s": 6, "speed_rpm": 6000}, {"time_s": 12, "speed_rpm": 3000}],
    "speed_fluctuation": 0.0,
}


def run_of(source: Source) -> tuple[list[SampleBlock], list[SegmentEnd]]:
    with closing(source):
        items = list(source.blocks())
    ends = [item for item in items if isinstance(item, SegmentEnd)]
    return [item for item in items if isinstance(item, SampleBlock)], ends


def test_run_lies_between_its_conditions_with_what_came_before(rig: RigFactory) -> None:
    ramp = with_trigger(rig(simulation=RAMP, trigger={"hold_s": 0.1}), "speed > 4000", "speed < 3500", 1.0)
    told: list[float] = []
    with closing(open_triggered(ramp, told.append)) as source:
        blocks, (end,) = run_of(source)
    codes = np.concatenate([block.codes for block in blocks], axis=1)
    truth = SimulatedCard(ramp).next_codes(12 * RATE)
    (first,) = [k for k in range(0, truth.shape[1], 2000) if np.array_equal(truth[:, k : k + 2000], codes[:, :2000])]
    np.testing.assert_array_equal(codes, truth[:, first : first + codes.shape[1]])
    assert (2.0 - 1.0 - 0.2) * RATE <= first <= (2.0 - 1.0 + 0.3) * RATE  # 4000 r/min is reached after 2 s
    assert 11.0 * RATE <= first + codes.shape[1] <= 11.5 * RATE  # 3500 r/min is fallen below after 11 s
    assert end == SegmentEnd(0, codes.shape[1], EndReason.FINISHED, detail="stopped by speed < 3500 r/min")
    assert [block.first_sample for block in blocks] == [2000 * k for k in range(len(blocks))]
    assert told == sorted(told)
    assert told[-1] == pytest.approx(4000, rel=0.03)


def test_stop_by_time_counts_from_the_start(rig: RigFactory) -> None:
    ramp = with_trigger(rig(simulation=RAMP, trigger={"hold_s": 0.0}), "time > 1", "time > 2", 0.5)
    blocks, (end,) = run_of(open_triggered(ramp, lambda _: None))
    assert end.samples == pytest.approx((0.5 + 2.0) * RATE, abs=2 * 2000)
    assert sum(block.n_samples for block in blocks) == end.samples


def test_level_of_a_channel_starts_a_run(rig: RigFactory) -> None:
    ramp = with_trigger(rig(simulation=RAMP, trigger={"hold_s": 0.0}), "tacho > 3.5", "time > 0.2", 0.0)
    blocks, _ = run_of(open_triggered(ramp, lambda _: None))
    highest = np.array([blocks[0].codes[2].max()])
    assert 3.5 < SimulatedCard(ramp).acquisition.channels[2].volts(highest)[0] < 4.5


def test_start_that_never_comes_leaves_an_empty_segment_that_says_so(rig: RigFactory) -> None:
    ramp = with_trigger(rig(simulation=RAMP), "speed > 9000", None, None)
    blocks, ends = run_of(open_triggered(ramp, lambda _: None))
    assert blocks == []
    assert ends == [SegmentEnd(0, 0, EndReason.STOPPED, detail="speed > 9000 r/min was not reached")]


class Scripted:
    """A source that gives what it was made with."""

    def __init__(self, acquisition: Acquisition, items: list[SourceItem]) -> None:
        self.acquisition, self._items = acquisition, items

    def blocks(self) -> Iterator[SourceItem]:
        yield from self._items

    def stop(self) -> None: ...

    def close(self) -> None: ...


def scripted(rig: Rig, levels: list[float | None], *, hold: float) -> Triggered:
    """Return a source of 0.1 s blocks of a level of x, V; None is an overrun."""
    acquisition = SimulatedCard(rig).acquisition
    items: list[SourceItem] = []
    segment = first = 0
    for level in levels:
        if level is None:
            items.append(SegmentEnd(segment, first, EndReason.OVERRUN, 7))
            segment, first = segment + 1, 0
            continue
        codes = np.zeros((3, 2000), np.int16)
        codes[0, 700] = round(level / 10 * 32767)
        items.append(SampleBlock(codes, segment, first, 0))
        first += 2000
    items.append(SegmentEnd(segment, first, EndReason.STOPPED))
    start = Condition("x", is_above=True, value=2.0)
    return Triggered(Scripted(acquisition, items), start, None, before=0.3, hold=hold, waiting=lambda _: None)


def test_glitch_shorter_than_the_hold_starts_nothing(rig: RigFactory) -> None:
    blocks, ends = run_of(scripted(rig(), [0, 0, 0, 0, 0, 3, 0, 3, 3, 0, 0], hold=0.2))
    seen = [bool(block.codes[0].max() > 0) for block in blocks]
    assert seen == [False, False, True, False, True, True, False, False]  # what is held, 0.3 s before it, and the rest
    assert ends == [SegmentEnd(0, 8 * 2000, EndReason.STOPPED)]


def test_samples_from_before_a_gap_are_not_given_as_what_came_before(rig: RigFactory) -> None:
    blocks, ends = run_of(scripted(rig(), [0, 0, 0, None, 0, 3, 0, None, 0], hold=0.0))
    assert [(block.segment, block.first_sample) for block in blocks] == [(0, 0), (0, 2000), (0, 4000), (1, 0)]
    assert ends == [
        SegmentEnd(0, 6000, EndReason.OVERRUN, 7),
        SegmentEnd(1, 2000, EndReason.STOPPED),
    ]


def test_operator_sees_that_a_run_is_armed_and_the_file_holds_what_followed(rig: RigFactory, tmp_path: Path) -> None:
    ramp = rig(simulation={**RAMP, "pace": "real time"}, trigger={"hold_s": 0.1})
    run = recorded(with_trigger(ramp, "speed > 3800", "speed > 4200", 0.5), tmp_path)
    armed = seen_within(run, 10, RunState.ARMED)
    assert "armed: the start is waited for, 3," in armed.detail
    seen_within(run, 10, RunState.RECORDING)
    assert run.wait(20)
    outcome = run.close()
    assert outcome.exit_code == 0
    with RunReader(run.path) as reader:
        assert reader.is_gap_free
        assert 0.9 < reader.duration < 1.9
        assert 'start = "speed > 3800"' in reader.header.config_toml


@pytest.mark.parametrize(
    ("text", "condition"),
    [
        ("speed > 2000", Condition("speed", is_above=True, value=2000.0)),
        (" x<-4.5 ", Condition("x", is_above=False, value=-4.5)),
        ("time > 2_000", Condition("time", is_above=True, value=2000.0)),
        ("", None),
    ],
)
def test_condition_is_read_as_it_is_written(text: str, condition: Condition | None) -> None:
    assert read_condition(text) == condition


@pytest.mark.parametrize("text", ["fast", "speed => 3", "speed > ", "speed > nan", "> 3"])
def test_what_is_no_condition_is_refused_with_an_example(rig: RigFactory, text: str) -> None:
    with pytest.raises(ConfigError, match=r'expected a condition such as "speed > 2000"'):
        rig(trigger={"start": text})
    with pytest.raises(ConfigError, match=r'expected a condition such as "speed > 2000"'):
        with_trigger(rig(), text, None, None)


def test_condition_on_a_channel_that_is_not_there_is_refused(rig: RigFactory) -> None:
    with pytest.raises(ConfigError, match=r'trigger\.stop = "z > 3": expected a condition on one of speed, time, x, y'):
        with_trigger(rig(), None, "z > 3", None)
    with pytest.raises(ConfigError, match=r"trigger\.start"):
        rig(trigger={"start": "z > 3"})
