"""Trigger conditions, and recordings that they start and stop."""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import Acquisition
from daq.config.loader import with_trigger
from daq.config.rig import Rig
from daq.config.schema import TriggerCondition, TriggerSection, parse_condition
from daq.drivers.factory import open_source
from daq.drivers.simulation.card import SimulatedCard
from daq.drivers.source import Source
from daq.drivers.triggered import TriggeredSource, TriggerStart, apply_trigger
from daq.errors import ConfigError
from daq.session.live_update import RunState
from recordings.mcap.parts import file_ids
from recordings.mcap.reader import RunReader
from tests.daq.support.recording import start_recording, wait_for_state

RigFactory = Callable[..., Rig]


class Listener:
    """Records the events of a trigger."""

    def __init__(self) -> None:
        self.speeds: list[float] = []
        self.waited_for: list[int] = []
        self.n_passed = 0
        self.events: list[TriggerStart] = []

    def on_waiting(self, event: int, speed: float) -> None:
        self.waited_for.append(event)
        self.speeds.append(speed)

    def on_skipped(self, samples: int) -> None:
        self.n_passed += samples

    def on_start(self, start: TriggerStart) -> None:
        self.events.append(start)


def opened(rig: Rig, listener: Listener | None = None) -> Source:
    return apply_trigger(open_source(rig), rig.config.trigger, listener or Listener())


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


def test_run_contains_the_samples_between_its_conditions_and_the_pre_trigger(rig: RigFactory) -> None:
    ramp = rig(simulation=RAMP, trigger={"hold_s": 0.1, "start": "speed > 4000", "stop": "speed < 3500", "pre_s": 1.0})
    listener = Listener()
    with closing(opened(ramp, listener)) as source:
        blocks, (end,) = run_of(source)
    codes = np.concatenate([block.codes for block in blocks], axis=1)
    truth = SimulatedCard(ramp).next_codes(12 * RATE)
    (first,) = [k for k in range(0, truth.shape[1], 2000) if np.array_equal(truth[:, k : k + 2000], codes[:, :2000])]
    np.testing.assert_array_equal(codes, truth[:, first : first + codes.shape[1]])
    assert (2.0 - 1.0 - 0.2) * RATE <= first <= (2.0 - 1.0 + 0.3) * RATE  # 4000 r/min is reached after 2 s
    assert 11.0 * RATE <= first + codes.shape[1] <= 11.5 * RATE  # the speed falls below 3500 r/min after 11 s
    assert end == SegmentEnd(0, codes.shape[1], EndReason.FINISHED, detail="stopped by speed < 3500 r/min")
    assert [block.first_sample for block in blocks] == [2000 * k for k in range(len(blocks))]
    assert listener.speeds == sorted(listener.speeds)
    assert listener.speeds[-1] == pytest.approx(4000, rel=0.03)
    assert listener.n_passed == first
    (start,) = listener.events
    assert (start.event, start.segment, str(start.condition)) == (1, 0, "speed > 4000 r/min")
    assert first + start.sample == pytest.approx(2.0 * RATE, abs=0.3 * RATE)


def test_stop_by_time_counts_from_the_start(rig: RigFactory) -> None:
    trigger = {"hold_s": 0.0, "start": "time > 1", "stop": "time > 2", "pre_s": 0.5}
    blocks, (end,) = run_of(opened(rig(simulation=RAMP, trigger=trigger)))
    assert end.samples == pytest.approx((0.5 + 2.0) * RATE, abs=2 * 2000)
    assert sum(block.n_samples for block in blocks) == end.samples


def test_level_of_a_channel_starts_a_run(rig: RigFactory) -> None:
    ramp = rig(simulation=RAMP, trigger={"hold_s": 0.0, "start": "tacho > 3.5", "stop": "time > 0.2", "pre_s": 0.0})
    blocks, _ = run_of(opened(ramp))
    highest = np.array([blocks[0].codes[2].max()])
    assert 3.5 < SimulatedCard(ramp).acquisition.channels[2].volts(highest)[0] < 4.5


def test_start_condition_that_is_never_met_gives_an_empty_segment_with_the_reason(rig: RigFactory) -> None:
    blocks, ends = run_of(opened(rig(simulation=RAMP, trigger={"start": "speed > 9000"})))
    assert blocks == []
    assert ends == [SegmentEnd(0, 0, EndReason.STOPPED, detail="speed > 9000 r/min was not reached")]


class Scripted:
    """A source that yields given items."""

    def __init__(self, acquisition: Acquisition, items: list[SourceItem]) -> None:
        self.acquisition, self._items = acquisition, items

    def blocks(self) -> Iterator[SourceItem]:
        yield from self._items

    def stop(self) -> None: ...

    def close(self) -> None: ...


def trigger_section(stop: str = "", *, pre: float = 0.0, hold_off: float = 0.0, events: int = 1) -> TriggerSection:
    return TriggerSection(start="x > 2", stop=stop, pre_s=pre, hold_s=0.0, hold_off_s=hold_off, events=events)


BELOW = "x < -2"


def scripted(
    rig: Rig,
    levels: Sequence[float | None],
    *,
    hold: float,
    trigger: TriggerSection | None = None,
    listener: Listener | None = None,
) -> TriggeredSource:
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
        codes[1] = len(items)
        items.append(SampleBlock(codes, segment, first, 0))
        first += 2000
    items.append(SegmentEnd(segment, first, EndReason.STOPPED))
    trigger = (trigger or trigger_section(pre=0.3)).model_copy(update={"hold_s": hold})
    return TriggeredSource(Scripted(acquisition, items), trigger, listener or Listener())


def test_glitch_shorter_than_the_hold_time_does_not_start_an_event(rig: RigFactory) -> None:
    blocks, ends = run_of(scripted(rig(), [0, 0, 0, 0, 0, 3, 0, 3, 3, 0, 0], hold=0.2))
    seen = [bool(block.codes[0].max() > 0) for block in blocks]
    assert seen == [False, False, True, False, True, True, False, False]  # hold time, 0.3 s before it, and the rest
    assert ends == [SegmentEnd(0, 8 * 2000, EndReason.STOPPED)]


def test_samples_before_a_gap_are_not_part_of_the_pre_trigger(rig: RigFactory) -> None:
    blocks, ends = run_of(scripted(rig(), [0, 0, 0, None, 0, 3, 0, None, 0], hold=0.0))
    assert [(block.segment, block.first_sample) for block in blocks] == [(1, 0), (1, 2000), (1, 4000), (2, 0)]
    detail = "while waiting for x > 2 V: overrun"
    assert ends == [
        SegmentEnd(0, 0, EndReason.OVERRUN, 7, detail=detail),
        SegmentEnd(1, 6000, EndReason.OVERRUN, 7),
        SegmentEnd(2, 2000, EndReason.STOPPED),
    ]


def delivered_levels(blocks: Sequence[SampleBlock]) -> list[tuple[int, int]]:
    """Return segment and number in the script of each delivered block."""
    return [(block.segment, int(block.codes[1, 0])) for block in blocks]


def test_trigger_is_rearmed_after_each_stop_up_to_the_number_of_events(rig: RigFactory) -> None:
    listener = Listener()
    levels = [0, 0, 0, 3, 0, -3, 0, 0, 0, 3, -3, 3, -3, 0, 3, 0]
    trigger = trigger_section(BELOW, pre=0.2, events=3)
    blocks, ends = run_of(scripted(rig(), levels, hold=0.0, trigger=trigger, listener=listener))
    one, two, three = [1, 2, 3, 4, 5], [7, 8, 9, 10], [11, 12]  # the pre-trigger reaches back to the last stop at most
    assert delivered_levels(blocks) == [(0, k) for k in one] + [(1, k) for k in two] + [(2, k) for k in three]
    assert ends == [
        SegmentEnd(k, 2000 * n, EndReason.FINISHED, detail="stopped by x < -2 V")
        for k, n in enumerate(map(len, (one, two, three)))
    ]
    assert [(event.event, event.segment, event.sample) for event in listener.events] == [
        (1, 0, 2 * 2000),
        (2, 1, 2 * 2000),
        (3, 2, 0),
    ]
    assert listener.n_passed == 2 * 2000  # the 0th and the 6th; nothing is acquired after the last stop
    assert set(listener.waited_for) == {1, 2}


def test_no_start_is_detected_during_the_hold_off(rig: RigFactory) -> None:
    levels = [3, -3, 3, 3, 3, 0, 3, -3]
    trigger = trigger_section(BELOW, hold_off=0.25, events=0)
    blocks, ends = run_of(scripted(rig(), levels, hold=0.0, trigger=trigger))
    assert delivered_levels(blocks) == [(0, 0), (0, 1), (1, 6), (1, 7)]
    trigger = trigger.model_copy(update={"pre_s": 0.3})
    blocks, ends = run_of(scripted(rig(), levels, hold=0.0, trigger=trigger))
    assert delivered_levels(blocks) == [(0, 0), (0, 1), (1, 3), (1, 4), (1, 5), (1, 6), (1, 7)]
    assert [end.reason for end in ends] == [EndReason.FINISHED, EndReason.FINISHED]


def test_device_fault_while_waiting_for_a_start_is_reported(rig: RigFactory) -> None:
    acquisition = SimulatedCard(rig()).acquisition
    end = SegmentEnd(0, 0, EndReason.UNPLUGGED, detail="the card is gone")
    source = TriggeredSource(Scripted(acquisition, [end]), trigger_section(), Listener())
    assert [*source.blocks()] == [
        replace(end, detail="while waiting for x > 2 V: the card is gone"),
        SegmentEnd(1, 0, EndReason.STOPPED, detail="x > 2 V was not reached"),
    ]


@pytest.mark.parametrize("seed", range(40))
def test_every_sample_is_delivered_once_or_counted_as_skipped(rig: RigFactory, seed: int) -> None:
    draw = np.random.default_rng(seed)
    levels = [None if level > 4 else level for level in draw.choice([0.0, 0.0, 3.0, -3.0, 5.0], 60).tolist()]
    before, hold, hold_off = draw.choice([0.0, 0.1, 0.25, 0.4], 3).tolist()
    listener = Listener()
    trigger = trigger_section(BELOW, pre=before, hold_off=hold_off, events=0)
    blocks, ends = run_of(scripted(rig(), levels, hold=hold, trigger=trigger, listener=listener))
    numbers = [number for _, number in delivered_levels(blocks)]
    assert numbers == sorted(set(numbers))
    assert 2000 * len(numbers) + listener.n_passed == 2000 * sum(level is not None for level in levels)
    assert sum(end.lost for end in ends) == 7 * levels.count(None)
    assert [end.segment for end in ends] == [*range(len(ends))]
    for end in ends:
        mine = [block for block in blocks if block.segment == end.segment]
        assert [block.first_sample for block in mine] == [*range(0, end.samples, 2000)]
        stretch = [number for segment, number in delivered_levels(blocks) if segment == end.segment]
        assert stretch == [*range(stretch[0], stretch[0] + len(stretch))] if stretch else not end.samples


def test_each_event_is_a_recording_and_the_run_ends_after_the_last_event(rig: RigFactory, tmp_path: Path) -> None:
    swing = [{"time_s": 2 * k, "speed_rpm": 3000 + 3000 * (k % 2)} for k in range(7)]
    trigger = {"start": "speed > 5000", "stop": "speed < 4000", "pre_s": 0.3, "hold_s": 0.1, "events": 2}
    run = start_recording(rig(simulation={"profile": swing, "speed_fluctuation": 0.0}, trigger=trigger), tmp_path)
    assert run.wait(60)
    outcome = run.close()
    assert outcome.exit_code == 0
    assert [end.detail for end in outcome.ends] == ["stopped by speed < 4000 r/min"] * 2
    names = [*file_ids(run.path)]
    assert names == [run.path.stem, f"{run.path.stem}-event2"]
    passed = 0
    for name, end in zip(names, outcome.ends, strict=True):
        with RunReader(tmp_path / f"{name}.mcap") as reader:
            assert reader.is_gap_free
            assert reader.is_complete
            assert reader.n_samples == end.samples
            assert 2.2 < reader.duration < 2.8
            (marker,) = reader.markers()
            assert 0.2 < marker.sample / RATE < 0.6
            found = re.fullmatch(r"start: speed > 5000 r/min, after ([\d,]+) samples \([\d.]+ s\) skipped", marker.text)
            assert found is not None
            passed += int(found[1].replace(",", ""))
            started = (reader.header.started_ns - run.header.started_ns) / 1e9
    assert started == pytest.approx((passed + outcome.ends[0].samples) / RATE, abs=1e-8)


def test_rearmed_run_ends_when_it_is_stopped(rig: RigFactory, tmp_path: Path) -> None:
    swing = [{"time_s": 0, "speed_rpm": 5500}, {"time_s": 1, "speed_rpm": 3000}, {"time_s": 60, "speed_rpm": 3000}]
    trigger = {"start": "speed > 5000", "stop": "speed < 4000", "pre_s": 0.0, "hold_s": 0.1, "events": 0}
    bench = rig(simulation={"profile": swing, "speed_fluctuation": 0.0, "pace": "real time"}, trigger=trigger)
    run = start_recording(bench, tmp_path)
    armed = wait_for_state(run, 60, RunState.ARMED)
    while "1 recorded" not in armed.detail:
        armed = wait_for_state(run, 60, RunState.ARMED)
    with RunReader(run.path) as reader:
        assert reader.is_complete  # while the trigger waits for the next event
    run.stop()
    assert run.wait(60)
    assert run.close().exit_code == 130
    assert [*file_ids(run.path)] == [run.path.stem]


def test_events_without_a_start_and_a_stop_are_refused(rig: RigFactory) -> None:
    with pytest.raises(ConfigError, match=r"trigger\.events = 0: expected 1 without both start and stop"):
        rig(trigger={"events": 0, "start": "speed > 2000"})
    with pytest.raises(ConfigError, match=r"trigger\.events = 3: expected 1"):
        with_trigger(rig(), stop="speed < 2000", events=3)
    with pytest.raises(ConfigError, match=r"trigger\.events = -1: "):
        with_trigger(rig(), events=-1)


def test_live_status_shows_the_armed_run_and_the_file_holds_the_event(rig: RigFactory, tmp_path: Path) -> None:
    ramp = rig(simulation={**RAMP, "pace": "real time"}, trigger={"hold_s": 0.1})
    run = start_recording(with_trigger(ramp, start="speed > 3800", stop="speed > 4200", pre_s=0.5), tmp_path)
    armed = wait_for_state(run, 60, RunState.ARMED)
    assert "armed: waiting for the start condition, 3," in armed.detail
    wait_for_state(run, 60, RunState.RECORDING)
    assert run.wait(60)
    outcome = run.close()
    assert outcome.exit_code == 0
    with RunReader(run.path) as reader:
        assert reader.is_gap_free
        assert 0.9 < reader.duration < 1.9
        assert 'start = "speed > 3800"' in reader.header.config_toml


@pytest.mark.parametrize(
    ("text", "condition"),
    [
        ("speed > 2000", TriggerCondition("speed", is_above=True, value=2000.0)),
        (" x<-4.5 ", TriggerCondition("x", is_above=False, value=-4.5)),
        ("time > 2_000", TriggerCondition("time", is_above=True, value=2000.0)),
        ("speed > 12,500", TriggerCondition("speed", is_above=True, value=12_500.0)),
        ("", None),
    ],
)
def test_condition_is_parsed(text: str, condition: TriggerCondition | None) -> None:
    assert parse_condition(text) == condition


@pytest.mark.parametrize("text", ["fast", "speed => 3", "speed > ", "speed > nan", "> 3", "x > 4,5", "x > 1,50"])
def test_invalid_condition_is_refused_with_an_example(rig: RigFactory, text: str) -> None:
    with pytest.raises(ConfigError, match=r'expected a condition such as "speed > 2000"'):
        rig(trigger={"start": text})
    with pytest.raises(ConfigError, match=r'expected a condition such as "speed > 2000"'):
        with_trigger(rig(), start=text)


def test_condition_on_an_unknown_channel_is_refused(rig: RigFactory) -> None:
    with pytest.raises(ConfigError, match=r'trigger\.stop = "z > 3": expected a condition on one of speed, time, x, y'):
        with_trigger(rig(), stop="z > 3")
    with pytest.raises(ConfigError, match=r"trigger\.start"):
        rig(trigger={"start": "z > 3"})


def test_condition_on_a_voltage_outside_the_range_is_refused(rig: RigFactory) -> None:
    with pytest.raises(ConfigError, match=r'trigger\.stop = "x > 45": expected a voltage within the range of ±10 V'):
        with_trigger(rig(), stop="x > 45")
