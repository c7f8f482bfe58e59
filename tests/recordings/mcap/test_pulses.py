"""Counter timestamps of the tacho edges in a run file: writing, reading, verification."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import Edge, RunHeader, TachoCounter
from analysis.signals.snapshot import CounterReport, Snapshot
from recordings.integrity.file_checks import Check, Finding, PulseCheck
from recordings.integrity.verify import verify
from recordings.mcap import rig_pb2
from recordings.mcap.header import header_from_json, to_json
from recordings.mcap.messages import ItemDecoder, PulseEncoder
from recordings.mcap.reader import RunReader
from recordings.mcap.results import encode_snapshot
from recordings.mcap.writer import RunWriter

MakeBlock = Callable[..., SampleBlock]
COUNTER = TachoCounter("ctr1", "PFI3", Edge.FALLING, 80e6, is_reference=True, max_difference=4.9e-5)
PER_SAMPLE = 4000
BLOCK = 1000


@pytest.fixture
def counted(header: RunHeader) -> RunHeader:
    """The header of a run with a counter for the tacho."""
    acquisition = header.acquisition
    return replace(header, acquisition=replace(acquisition, tacho=replace(acquisition.tacho, counter=COUNTER)))


def stamps(first: int, stop: int) -> NDArray[np.int64]:
    """Return the stamps of edges at every 333rd sample, in an interval of samples."""
    ticks = 1 + 333 * PER_SAMPLE * np.arange(-(-first // 333), -(-stop // 333), dtype=np.int64)
    return ticks[ticks >= first * PER_SAMPLE]


@pytest.fixture
def blocks(make_block: MakeBlock) -> list[SampleBlock]:
    """Two segments of five blocks; in the second the counter fails before the third."""
    made: list[SampleBlock] = []
    for segment in (0, 1):
        for first in range(0, 5 * BLOCK, BLOCK):
            failed = segment == 1 and first >= 2 * BLOCK
            ticks = None if failed else stamps(first, first + BLOCK)
            made.append(replace(make_block(segment, first, BLOCK), ticks=ticks))
    return made


@pytest.fixture
def run(tmp_path: Path, counted: RunHeader, blocks: list[SampleBlock]) -> Path:
    return write(tmp_path / "run.mcap", counted, blocks)


def write(path: Path, header: RunHeader, blocks: list[SampleBlock]) -> Path:
    writer = RunWriter(path, header)
    for before, block in pairwise([None, *blocks]):
        if block is not None and before is not None and block.segment != before.segment:
            writer.write_segment_end(SegmentEnd(before.segment, before.end, EndReason.OVERRUN, 5))
        assert block is not None
        writer.write_block(block)
    writer.write_segment_end(SegmentEnd(blocks[-1].segment, blocks[-1].end, EndReason.STOPPED))
    writer.close()
    return path


def test_header_with_a_counter_survives_a_round_trip(counted: RunHeader, header: RunHeader) -> None:
    assert header_from_json(to_json(counted)) == counted
    assert "counter" not in to_json(header)["acquisition"]["tacho"]


def test_blocks_are_read_with_their_stamps(run: Path, blocks: list[SampleBlock]) -> None:
    with RunReader(run) as reader:
        read = [item for item in reader.items() if isinstance(item, SampleBlock)]
    for one, other in zip(blocks, read, strict=True):
        assert (one.ticks is None) == (other.ticks is None)
        if one.ticks is not None and other.ticks is not None:
            np.testing.assert_array_equal(one.ticks, other.ticks)


def test_verification_counts_stamps_and_reports_a_failed_counter(run: Path) -> None:
    checked = verify(run)
    assert checked.is_intact
    assert checked.pulses == stamps(0, 5 * BLOCK).size + stamps(0, 2 * BLOCK).size
    (finding,) = [finding for finding in checked.findings if "counter failed" in finding.what]
    assert f"after {stamps(0, 2 * BLOCK).size} timestamps, before sample 2000" in finding.what
    assert not finding.is_fault


def test_stamps_are_a_topic_that_the_mcap_library_reads(run: Path) -> None:
    with run.open("rb") as file:
        found = [
            (channel, message)
            for _, channel, message in make_reader(file, validate_crcs=True).iter_messages(topics=["/pulses"])
        ]
    channel, first = found[0]
    assert channel.metadata == {"timebase_hz": "80000000.0"}
    pulses = rig_pb2.Pulses.FromString(first.data)
    assert list(pulses.ticks) == stamps(0, BLOCK).tolist()
    assert len(found) == 8  # one for each block with stamps, and one for the failure


def test_run_without_a_counter_has_no_stamps(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> None:
    path = write(tmp_path / "plain.mcap", header, [make_block(0, 0, BLOCK)])
    assert verify(path).pulses == 0
    with RunReader(path) as reader:
        assert [item.ticks for item in reader.items() if isinstance(item, SampleBlock)] == [None]
        assert reader.ticks(0, 0, BLOCK).size == 0


def test_stamps_of_an_interval_are_read(run: Path) -> None:
    with RunReader(run) as reader:
        for first, stop in ((0, 5 * BLOCK), (1, 2), (999, 1001), (3_000, 3_400), (4_999, 5_000)):
            expected = stamps(first, stop)
            np.testing.assert_array_equal(reader.ticks(0, first, stop), expected[expected < stop * PER_SAMPLE])
        assert reader.ticks(7, 0, 100).size == 0


def test_stamps_are_merged_into_later_blocks_though_one_block_is_missing(
    counted: RunHeader, blocks: list[SampleBlock]
) -> None:
    encoder, merger = PulseEncoder(counted.acquisition), ItemDecoder(counted.acquisition)
    messages = [encoder.encode(block) for block in blocks[:3]]
    for message in messages:
        assert message is not None
        merger.add_pulses(message)
    without_ticks = [replace(block, ticks=None) for block in blocks]
    for k in (0, 2):
        merged, original = merger.merge(without_ticks[k]).ticks, blocks[k].ticks
        assert merged is not None
        assert original is not None
        np.testing.assert_array_equal(merged, original)
    fourth = merger.merge(without_ticks[3])
    assert fourth.ticks is not None
    assert fourth.ticks.size == 0


def found(header: RunHeader, messages: list[rig_pb2.Pulses], blocks: list[SampleBlock]) -> list[str]:
    """Return the findings on pulse messages, each before its block."""

    def findings() -> Iterator[Finding]:
        check = PulseCheck(header.acquisition)
        for message, block in zip(messages, blocks, strict=True):
            yield from check.check_pulses(message.SerializeToString(), "here")
            yield from check.check_block(block, "here")

    listed = list(findings())
    assert all(finding.check is Check.CONTINUITY for finding in listed)
    return [finding.what for finding in listed]


@pytest.mark.parametrize(
    ("message", "what"),
    [
        (rig_pb2.Pulses(first_pulse=5, ticks=[1]), "from number 5 on, expected number 0"),
        (rig_pb2.Pulses(ticks=[9, 8]), "from number 0 on do not increase"),
        (
            rig_pb2.Pulses(first_sample=77, ticks=[1]),
            "of the block from sample 77 of segment 0, which is missing",
        ),
        (
            rig_pb2.Pulses(ticks=[4_000_001]),
            "4000001 ticks, expected one before the end of its block at 1000",
        ),
    ],
)
def test_inconsistent_stamps_are_reported(
    counted: RunHeader, blocks: list[SampleBlock], message: rig_pb2.Pulses, what: str
) -> None:
    (finding,) = found(counted, [message], blocks[:1])
    assert what in finding


def test_stamps_without_a_counter_in_the_header_are_reported(header: RunHeader, blocks: list[SampleBlock]) -> None:
    findings = found(header, [rig_pb2.Pulses(ticks=[1])], blocks[:1])
    assert "counter timestamps, but the header has no counter" in findings


def test_count_of_stamps_that_differs_from_the_end_record_is_a_fault(
    tmp_path: Path, counted: RunHeader, blocks: list[SampleBlock]
) -> None:
    writer = RunWriter(tmp_path / "short.mcap", counted)
    writer.write_block(blocks[0])
    writer.write_segment_end(SegmentEnd(0, BLOCK, EndReason.STOPPED))
    writer._pulses.count += 1
    writer.close()
    (fault,) = verify(writer.path).faults
    assert fault.check is Check.COUNTS
    assert f"{stamps(0, BLOCK).size} timestamps" in fault.what
    assert f"expected {stamps(0, BLOCK).size + 1}" in fault.what


def test_comparison_with_the_counter_is_stored_with_its_snapshot(
    tmp_path: Path, counted: RunHeader, blocks: list[SampleBlock], make_snapshot: Callable[..., Snapshot]
) -> None:
    report = CounterReport(True, 12_345, 1, 2, 3, -1.0e-7 / 3, 4.2e-5 / 7, 250, 4)
    writer = RunWriter(tmp_path / "stored.mcap", counted)
    writer.write_block(blocks[0])
    for counter in (report, None):
        for result in encode_snapshot(replace(make_snapshot(0, 700), counter=counter), counted):
            writer.add_result(result)
    writer.write_segment_end(SegmentEnd(0, BLOCK, EndReason.STOPPED))
    writer.close()
    with RunReader(writer.path) as reader:
        assert [snapshot.counter for snapshot in reader.snapshots()] == [report, None]
