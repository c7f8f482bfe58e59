"""Conformance of all sources to the `Source` interface: simulated, replayed, NI at a device server, NI through C.

The dynamic loader finds the C library when the interpreter starts, so the tests through C run in a separate process,
which the last test starts.
"""

import ctypes
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path
from typing import Protocol

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import Role
from daq.config.rig import Rig
from daq.drivers.factory import open_source
from daq.drivers.replay import ReplaySource
from daq.drivers.simulation.card import SimulatedCard
from daq.drivers.source import Source
from daq.session.recording.recorder import run_header
from recordings.mcap.writer import RunWriter
from tests.daq.support.device_server import serving
from tests.daq.support.ni_driver import NiDriver
from tests.daq.support.ni_library import SOURCE, TOOLS, build
from tests.daq.support.recording import recording_request

RigFactory = Callable[..., Rig]
Codes = NDArray[np.int16]
Ticks = NDArray[np.int64]

FAULTLESS = "NIDAQMX_DOUBLE_FAULTLESS"
THROUGH_C = os.environ.get("RIG_TEST_NIDAQMX_DOUBLE") == "1"
COUNTED = {"threshold_v": 2.15, "hysteresis_v": 1.0, "counter": {"reference": "counter"}}
STEADY = {"profile": [{"time_s": 0, "speed_rpm": 6000}, {"time_s": 4, "speed_rpm": 6000}]}


class Backend(Protocol):
    """A kind of source, with the samples and stamps that it should deliver."""

    def open(self) -> Source: ...

    def open_with_overrun(self) -> Source:
        """Open a source that loses samples in its first segment and continues."""
        ...

    def truth(self, n: int) -> Codes:
        """Return the first codes of every run."""
        ...

    def stamps(self, segment: int, n: int) -> Ticks:
        """Return the counter's stamps in the first samples of a segment."""
        ...

    def is_released(self) -> bool: ...


class Simulated:
    def __init__(self, rig: RigFactory) -> None:
        self._rig = rig(simulation=STEADY, tacho=COUNTED)
        self._paced = rig(
            timing={"rate_hz": 20_000, "block_s": 0.05, "buffer_s": 0.5},
            simulation={**STEADY, "pace": "real time"},
            tacho=COUNTED,
        )

    def open(self) -> Source:
        return open_source(self._rig)

    def open_with_overrun(self) -> Source:
        return Stalled(open_source(self._paced), seconds=0.8)

    def truth(self, n: int) -> Codes:
        return SimulatedCard(self._rig).next_codes(n)

    def stamps(self, segment: int, n: int) -> Ticks:
        return self.stamps_since(0, n)  # the loss before its second segment varies

    def stamps_since(self, begin: int, n: int) -> Ticks:
        return SimulatedCard(self._rig).ticks(begin, begin + n, begin)

    def is_released(self) -> bool:
        return True  # there is no device


class Stalled:
    """A source whose reader stalls after the second block."""

    def __init__(self, source: Source, seconds: float) -> None:
        self._source, self._seconds = source, seconds
        self.acquisition, self.stop, self.close = source.acquisition, source.stop, source.close

    def blocks(self) -> Iterator[SourceItem]:
        for count, item in enumerate(self._source.blocks()):
            yield item
            if count == 1:
                time.sleep(self._seconds)


class Replayed:
    def __init__(self, rig: RigFactory, folder: Path) -> None:
        self._simulated = Simulated(rig)
        self._folder = folder
        self._whole = self._recorded("whole", overrun=False)
        self._gapped = self._recorded("gapped", overrun=True)

    def _recorded(self, name: str, *, overrun: bool) -> Path:
        made = recording_request(self._simulated._rig, self._folder)
        source = self._simulated.open()
        writer = RunWriter(self._folder / f"{name}.mcap", run_header(made, source))
        segment = first = 0
        for item in source.blocks():
            if isinstance(item, SampleBlock):
                writer.write_block(
                    item.relocated(segment, item.first_sample - first, source.acquisition.ticks_per_sample)
                )
                if overrun and item.end == 6000:
                    writer.write_segment_end(SegmentEnd(0, 6000, EndReason.OVERRUN, 100, detail="the reader was late"))
                    segment, first = 1, 6000
            else:
                writer.write_segment_end(SegmentEnd(segment, item.samples - first, item.reason))
        writer.close()
        source.close()
        return writer.path

    def open(self) -> Source:
        return ReplaySource(self._whole, None)

    def open_with_overrun(self) -> Source:
        return ReplaySource(self._gapped, None)

    def truth(self, n: int) -> Codes:
        return self._simulated.truth(n)

    def stamps(self, segment: int, n: int) -> Ticks:
        return self._simulated.stamps_since(6000 * segment, n)

    def is_released(self) -> bool:
        if sys.platform == "win32":
            return True
        opened = (link.readlink() for link in Path("/proc/self/fd").iterdir() if link.exists())
        return not any(path.is_relative_to(self._folder) for path in opened)


class AtServer:
    def __init__(self, rig: RigFactory, stack: ExitStack) -> None:
        simulated = rig(simulation=STEADY, tacho=COUNTED)
        self._card: Callable[[], SimulatedCard] = lambda: SimulatedCard(simulated)
        self._server = stack.enter_context(serving(NiDriver(self._card)))
        self._rig = rig(device={"backend": "nidaqmx", "target": self._server.target, "deadline_s": 1.0}, tacho=COUNTED)

    def open(self) -> Source:
        return open_source(self._rig)

    def open_with_overrun(self) -> Source:
        self._server.faults["ReadBinaryI16"].extend([0, 0, -200279])
        return open_source(self._rig)

    def truth(self, n: int) -> Codes:
        return self._card().next_codes(n)

    def stamps(self, segment: int, n: int) -> Ticks:
        return self._card().ticks(0, n)  # the bench restarts with every start

    def is_released(self) -> bool:
        return not self._server.tasks


class ThroughC:
    def __init__(self, rig: RigFactory) -> None:
        self._rig = rig(device={"backend": "nidaqmx", "serial": "1A2B32"}, tacho=COUNTED)
        os.environ[FAULTLESS] = "1"

    def open(self) -> Source:
        return open_source(self._rig)

    def open_with_overrun(self) -> Source:
        del os.environ[FAULTLESS]
        return open_source(self._rig)

    def truth(self, n: int) -> Codes:
        return (7 * np.arange(n) + 1000 * np.arange(3)[:, np.newaxis]).astype(np.int16)

    def stamps(self, segment: int, n: int) -> Ticks:
        return np.floor(np.arange(250.0, n, 250.0) * (80e6 / 20_000.25)).astype(np.int64)

    def is_released(self) -> bool:
        return ctypes.c_int.in_dll(ctypes.CDLL("libnidaqmx.so.1"), "alive").value == 0


@pytest.fixture(params=["over C"] if THROUGH_C else ["simulated", "replayed", "over the wire"])
def backend(request: pytest.FixtureRequest, rig: RigFactory, tmp_path: Path) -> Iterator[Backend]:
    with ExitStack() as stack:
        backends: dict[str, Callable[[], Backend]] = {
            "simulated": lambda: Simulated(rig),
            "replayed": lambda: Replayed(rig, tmp_path),
            "over the wire": lambda: AtServer(rig, stack),
            "over C": lambda: ThroughC(rig),
        }
        yield backends[request.param]()


def taken(source: Source, blocks: int) -> tuple[list[SampleBlock], list[SegmentEnd]]:
    """Return blocks and ends of a source that is stopped after a number of blocks, and close it."""
    got: list[SampleBlock] = []
    ends: list[SegmentEnd] = []
    for item in source.blocks():
        if isinstance(item, SampleBlock):
            got.append(item)
            if len(got) == blocks:
                source.stop()
        else:
            ends.append(item)
    source.close()
    return got, ends


def stamps_of(blocks: list[SampleBlock]) -> Ticks:
    return np.concatenate([np.empty(0, np.int64), *(block.ticks for block in blocks if block.ticks is not None)])


def test_acquisition_describes_the_rows_of_a_block(backend: Backend) -> None:
    source = backend.open()
    acquisition = source.acquisition
    blocks, _ = taken(source, 1)
    assert [channel.role for channel in acquisition.channels] == [Role.PROBE_X, Role.PROBE_Y, Role.TACHO]
    assert blocks[0].codes.shape[0] == 3
    assert acquisition.rate > 0
    assert acquisition.convert_rate >= acquisition.rate * 3
    assert all(len(channel.scaling) >= 2 and channel.scaling[1] > 0 for channel in acquisition.channels)
    assert source.acquisition == acquisition


def test_blocks_are_contiguous_and_a_stop_ends_the_segment_with_all_samples_read(backend: Backend) -> None:
    blocks, ends = taken(backend.open(), 4)
    firsts = [block.first_sample for block in blocks]
    assert firsts == [0, *np.cumsum([block.n_samples for block in blocks])[:-1].tolist()]
    assert {block.segment for block in blocks} == {0}
    assert ends == [SegmentEnd(0, blocks[-1].end, EndReason.STOPPED)]


def test_codes_equal_those_of_the_card_and_are_not_overwritten(backend: Backend) -> None:
    blocks, _ = taken(backend.open(), 4)  # a block is not overwritten by the next one
    codes = np.concatenate([block.codes for block in blocks], axis=1)
    np.testing.assert_array_equal(codes, backend.truth(codes.shape[1]))
    assert all(block.codes.dtype == np.int16 and block.codes.flags.c_contiguous for block in blocks)


def test_stamps_equal_those_of_the_counter_and_come_with_their_samples(backend: Backend) -> None:
    source = backend.open()
    per_sample = source.acquisition.ticks_per_sample
    assert per_sample == 80e6 / source.acquisition.rate
    blocks, ends = taken(source, 4)
    stamps = stamps_of(blocks)
    assert stamps.size > 20
    np.testing.assert_array_equal(stamps, backend.stamps(0, ends[0].samples))
    for block in blocks:
        assert block.ticks is not None
        assert block.ticks.dtype == np.int64
        assert (block.ticks > block.first_sample * per_sample - 1).all()
        assert (block.ticks < block.end * per_sample).all()


def test_host_times_do_not_decrease_and_backlogs_are_counts(backend: Backend) -> None:
    blocks, _ = taken(backend.open(), 4)
    times = [block.host_time_ns for block in blocks]
    assert times == sorted(times)
    assert all(block.backlog >= 0 for block in blocks)


def test_source_stopped_before_its_start_gives_an_end_and_no_samples(backend: Backend) -> None:
    source = backend.open()
    source.stop()
    assert list(source.blocks()) == [SegmentEnd(0, 0, EndReason.STOPPED)]
    source.close()


def test_stop_from_another_thread_ends_the_blocks_soon(backend: Backend) -> None:
    source = backend.open()
    first = threading.Event()

    def stop() -> None:
        first.wait(5)
        source.stop()

    stopping = threading.Thread(target=stop)
    stopping.start()
    began = time.monotonic()
    samples = 0
    for item in source.blocks():
        first.set()
        if isinstance(item, SampleBlock):
            samples += item.n_samples
            time.sleep(0.01)
        else:
            end = item
    assert time.monotonic() - began < 3
    assert (end.samples, end.is_gap_free) == (samples, True)
    stopping.join(5)
    source.close()


def test_close_may_be_called_at_any_time_and_releases_everything(backend: Backend) -> None:
    unused = backend.open()
    unused.close()
    unused.close()
    assert backend.is_released()
    used = backend.open()
    taken(used, 2)
    used.close()
    assert backend.is_released()


def test_close_releases_a_source_that_is_not_read_to_its_end(backend: Backend) -> None:
    source = backend.open()
    items = source.blocks()
    assert isinstance(next(items), SampleBlock)
    source.close()
    del items
    assert backend.is_released()


def test_reopened_source_starts_from_the_beginning(backend: Backend) -> None:
    (first, _), (second, _) = taken(backend.open(), 2), taken(backend.open(), 2)
    assert [block.first_sample for block in first] == [block.first_sample for block in second]
    assert all(np.array_equal(a.codes, b.codes) for a, b in zip(first, second, strict=True))


def test_overrun_ends_the_segment_with_its_loss_and_the_next_begins_at_zero(backend: Backend) -> None:
    blocks, ends = taken(backend.open_with_overrun(), 8)
    overrun, stopped = ends
    assert (overrun.segment, overrun.reason) == (0, EndReason.OVERRUN)
    assert not overrun.is_gap_free
    assert overrun.detail
    assert (stopped.segment, stopped.reason) == (1, EndReason.STOPPED)
    for end in ends:
        mine = [block for block in blocks if block.segment == end.segment]
        assert mine[0].first_sample == 0
        assert all(a.end == b.first_sample for a, b in pairwise(mine))
        assert mine[-1].end == end.samples
        if not isinstance(backend, Simulated) or end.segment == 0:
            np.testing.assert_array_equal(stamps_of(mine), backend.stamps(end.segment, end.samples))
    assert backend.is_released()


@pytest.mark.skipif(THROUGH_C, reason="this is that process")
@pytest.mark.skipif(sys.platform != "linux", reason=f"the double is built on Linux with {', '.join(TOOLS)}")
def test_card_through_the_c_interface_conforms(tmp_path: Path) -> None:
    build(tmp_path / "libnidaqmx.so.1", SOURCE)
    (tmp_path / "libnidaqmx.so").symlink_to("libnidaqmx.so.1")
    environment = os.environ | {"LD_LIBRARY_PATH": str(tmp_path), "RIG_TEST_NIDAQMX_DOUBLE": "1"}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", __file__]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout
    assert "11 passed, 1 skipped" in done.stdout
