"""Runs at a device server with random faults from a seed, and the check that every sample is accounted for.

The recorder's work, from source to file, runs in this process, so that a run takes a fraction of a second. Source and
writer are those of the recorder.
"""

import random
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import Acquisition
from daq.config.rig import Rig
from daq.config.schema import CounterSection, SessionSection
from daq.drivers.factory import open_source
from daq.drivers.simulation.card import SimulatedCard
from daq.session.recording.recorder import run_header
from recordings.mcap.reader import RunReader
from recordings.mcap.writer import RunWriter
from tests.daq.support.device_server import DeviceServer
from tests.daq.support.ni_bench import bench
from tests.daq.support.ni_driver import NiDriver
from tests.daq.support.recording import recording_request

DEADLINE = 60.0  # s for a run; a slower run counts as hanging
BLOCKS = 40  # after which a run is stopped
CALLS = 160  # within which faults occur; a block needs four calls
BUFFER = 120_000  # samples of the card
OVERRUNS = (-200279, -200222, -200361, -200010, -200019, -200714)
ABSENT = (-88710, -88709, -201003, -200220, -50405)
ANY_CALL = (
    "StartTask", "StopTask", "GetReadAttributeUInt32", "GetReadAttributeUInt64", "TaskControl", "CreateTask",
    "CreateCICountEdgesChan", "SetTrigAttributeString",
)  # fmt: skip
ANY_CODE = (-200545, -50103, -200077, -299_999, -200088)

EDGE_EVERY = 700  # samples
COUNTER = CounterSection(reference="counter")
ACQUISITION: Acquisition = SimulatedCard(bench(counter=COUNTER)).acquisition


def codes_of(generation: int, first: int, n: int) -> NDArray[np.int16]:
    """Return codes that identify the card's start, the channel and the sample."""
    index = np.arange(first, first + n)
    return (257 * generation + 7 * index + 1000 * np.arange(3)[:, np.newaxis]).astype(np.int16)


def ticks_of(generation: int, first: int, stop: int) -> NDArray[np.int64]:
    """Return stamps of the edges in an interval of samples; they identify the card's start."""
    edges = np.arange(-(-first // EDGE_EVERY), -(-stop // EDGE_EVERY)) * EDGE_EVERY
    return np.asarray(edges * round(ACQUISITION.ticks_per_sample) + generation, dtype=np.int64)


class CountingCard:
    """A card with numbered codes."""

    acquisition = ACQUISITION
    n_samples = 1 << 40

    def __init__(self, generation: int) -> None:
        self._generation = generation
        self._taken = 0

    def next_codes(self, n: int) -> NDArray[np.int16]:
        codes = codes_of(self._generation, self._taken, n)
        self._taken += n
        return codes

    def ticks(self, first: int, stop: int) -> NDArray[np.int64]:
        return ticks_of(self._generation, first, stop)


@dataclass
class Bench:
    """The card at its server, and the faults that disturb them."""

    random: random.Random
    made: int = 0
    timers: list[threading.Timer] = field(default_factory=list)
    faults_drawn: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.driver = NiDriver(self._card)
        self.server = DeviceServer(self.driver)
        self.port = int(self.server.target.rpartition(":")[2])

    def _card(self) -> CountingCard:
        self.made += 1
        return CountingCard(self.made - 1)

    def later(self, what: Callable[[], None], earliest: float, latest: float) -> None:
        timer = threading.Timer(self.random.uniform(earliest, latest), what)
        self.timers.append(timer)
        timer.start()

    def end(self) -> None:
        self.server.at_call.clear()
        for timer in self.timers:
            timer.join()
        self.server.thaw()

    def overrun(self) -> None:
        self.server.faults["ReadBinaryI16"].append(self.random.choice(OVERRUNS))

    def stall(self) -> None:
        self.driver.stall(BUFFER + self.random.randrange(1, 50_000))

    def unplug(self) -> None:
        device = self.driver.devices.pop("Dev1", None)
        self.server.faults["ReadBinaryI16"].append(self.random.choice(ABSENT))
        if device is not None and self.random.random() < 0.9:
            self.later(lambda: self.driver.devices.update(Dev1=device), 0.05, 0.8)

    def power_cycle(self) -> None:
        self.server.faults["ReadBinaryI16"].append(self.random.choice((-201003, -200220)))

    def abort(self) -> None:
        self.server.faults["ReadBinaryI16"].append(self.random.choice((-88710, -88709)))

    def seize(self) -> None:
        self.driver.held_elsewhere = True
        self.power_cycle()
        self.later(lambda: setattr(self.driver, "held_elsewhere", False), 0.05, 0.8)

    def fail_test(self) -> None:
        self.driver.passes_self_test = False
        self.abort()
        self.later(lambda: setattr(self.driver, "passes_self_test", True), 0.05, 0.8)

    def freeze(self) -> None:
        self.server.freeze()
        self.later(self.server.thaw, 0.1, 2.0)

    def restart(self) -> None:
        def begin() -> None:
            self.server = DeviceServer(self.driver, port=self.port)

        def kill() -> None:
            self.server.kill()
            self.later(begin, 0.05, 0.5)

        self.later(kill, 0.0, 0.01)  # not from within one of its own calls

    def partial_reads(self) -> None:
        self.driver.late.extend(self.random.randrange(1, 1499) for _ in range(self.random.randrange(1, 4)))

    def fail_counter(self) -> None:
        self.server.faults["ReadCounterU32Ex"].append(self.random.choice((-200279, -200141, -200545)))

    def silence(self) -> None:
        self.driver.late.append(0)

    def any_call(self) -> None:
        self.server.faults[self.random.choice(ANY_CALL)].append(self.random.choice(ANY_CODE))
        if self.random.random() < 0.5:
            self.power_cycle()

    def plan(self) -> None:
        """Draw the faults and their times."""
        kinds = (
            self.overrun, self.stall, self.unplug, self.power_cycle, self.abort, self.seize, self.fail_test,
            self.freeze, self.restart, self.partial_reads, self.silence, self.any_call, self.fail_counter,
        )  # fmt: skip
        n_calls = len(self.server.log)
        for _ in range(self.random.randrange(1, 4)):
            fault = self.random.choice(kinds)
            self.faults_drawn.append(fault.__name__)
            self.server.at_call[n_calls + self.random.randrange(1, CALLS)] = fault


def rig_at(target: str, deadline: float = 0.3) -> Rig:
    rig = bench(target, counter=COUNTER, deadline_s=deadline)
    session = SessionSection(restarts_per_minute=5, reconnect_s=2.0, retry_s=0.2)
    return replace(rig, config=rig.config.model_copy(update={"session": session}))


def record(bench: Bench, path: Path) -> float:
    """Record a run with its faults, as the recorder does; return its duration, s."""
    made = recording_request(rig_at(bench.server.target), path.parent)
    source = open_source(made.rig)
    writer = RunWriter(path, run_header(made, source))
    bench.plan()

    def pump() -> None:
        blocks = 0
        for item in source.blocks():
            if isinstance(item, SegmentEnd):
                writer.write_segment_end(item)
                continue
            writer.write_block(item)
            blocks += 1
            if blocks == BLOCKS:
                source.stop()
        source.close()

    pumping = threading.Thread(target=pump, daemon=True)
    began = time.monotonic()
    pumping.start()
    pumping.join(DEADLINE)
    took = time.monotonic() - began
    source.close()
    assert not pumping.is_alive(), f"{bench.faults_drawn}: the run hangs"
    writer.close()
    return took


Segment = tuple[SegmentEnd, NDArray[np.int16], NDArray[np.int64], int]


def segments(reader: RunReader) -> Iterator[Segment]:
    """Yield each segment's end, codes, stamps, and the sample up to which its stamps are complete.

    Check that its blocks are contiguous.
    """
    blocks: list[SampleBlock] = []
    for item in reader.items():
        if isinstance(item, SampleBlock):
            blocks.append(item)
            continue
        assert [block.first_sample for block in blocks[:1]] in ([], [0])
        assert all(a.end == b.first_sample for a, b in pairwise(blocks))
        assert all(block.segment == item.segment for block in blocks)
        codes = np.concatenate([np.empty((3, 0), np.int16), *(block.codes for block in blocks)], axis=1)
        stamped = [block for block in blocks if block.ticks is not None]
        assert [block.end for block in stamped] == [block.end for block in blocks[: len(stamped)]]
        ticks = np.concatenate([np.empty(0, np.int64), *(block.ticks for block in stamped if block.ticks is not None)])
        yield item, codes, ticks, stamped[-1].end if stamped else 0
        blocks = []


def check(bench: Bench, path: Path) -> int:
    """Check that every sample from the server is in the file or counted as lost; return the file's samples."""
    starts = dict(enumerate(bench.driver.starts))
    with RunReader(path) as reader:
        assert reader.is_complete
        ends = reader.segment_ends
        assert [end.segment for end in ends] == list(range(len(ends)))
        assert reader.is_gap_free == (len(ends) == 1 and ends[0].is_gap_free)
        for end, codes, ticks, stamped in segments(reader):
            assert codes.shape[1] == end.samples
            assert ("gave no timestamps" in end.detail) == (stamped < end.samples), end
            if end.samples:
                generation = (int(codes[0, 0]) % 65536) // 257
                np.testing.assert_array_equal(codes, codes_of(generation, 0, end.samples))
                np.testing.assert_array_equal(ticks, ticks_of(generation, 0, stamped))
                start = starts.pop(generation)
                connection_failed = "device server" in end.detail
                missed = start.replied - end.samples
                assert 0 <= missed <= (1499 if connection_failed else 0), end
                assert end.samples + end.lost <= start.acquired, end
                if missed:
                    assert not end.lost_is_exact, end
                if end.reason is EndReason.OVERRUN and end.lost:
                    assert end.samples + end.lost == start.acquired, end
                if end.reason is EndReason.STOPPED:
                    assert start.position == end.samples, end
        n_samples = reader.n_samples
        unstarted = sum(end.samples == 0 for end in ends)
    assert all(start.replied == 0 for start in starts.values()), "delivered samples are in no segment"
    assert len(starts) <= unstarted
    return n_samples


def holds_the_card(server: DeviceServer) -> bool:
    """Return whether a task still holds the card after all pending calls."""
    deadline = time.monotonic() + 30.0
    while (held := any(task.committed for task in server.rpcs.tasks.values())) and time.monotonic() < deadline:
        time.sleep(0.02)
    return held


def opens_again(bench: Bench) -> bool:
    """Return whether the next opening succeeds and leaves no task at the server.

    A frozen server may have created an unreserved task after its client had ended; this opening clears it.
    """
    bench.server.faults.clear()
    bench.driver.devices["Dev1"] = ("USB-6251", 0x1A2B3C)
    open_source(rig_at(bench.server.target, deadline=3.0)).close()
    return not bench.server.tasks


def run_of(seed: int, folder: Path) -> tuple[list[str], float, int]:
    """Record and check the run of a seed; return its faults, its duration, s, and its number of samples."""
    bench = Bench(random.Random(seed))  # noqa: S311 - reproducible on purpose
    path = folder / f"{seed}.mcap"
    try:
        took = record(bench, path)
    finally:
        bench.end()
    assert not holds_the_card(bench.server), f"{bench.faults_drawn}: the card was left reserved"
    samples = check(bench, path)
    assert opens_again(bench), f"{bench.faults_drawn}: a task was left on the server"
    bench.server.kill()
    return bench.faults_drawn, took, samples
