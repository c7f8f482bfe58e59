import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import (
    Acquisition,
    AnalysisSettings,
    Calibration,
    Channel,
    Device,
    Limits,
    Role,
    RunHeader,
    Tacho,
)
from recordings.catalogue.catalogue import Catalogue
from recordings.integrity.verify import verify
from recordings.mcap.parts import PartLimits, PartWriter, file_ids
from recordings.mcap.reader import RunReader
from recordings.mcap.results import Marker, encode_marker
from recordings.mcap.writer import RunWriter

RATE, BLOCK = 1000.0, 100
NS = 1_000_000_000


@pytest.fixture
def header() -> RunHeader:
    calibration = Calibration((0.0, 1e-4), 0.0, 10.0)
    channels = tuple(
        Channel(role.value, role, f"ai{k}", -10, 10, (0.0, 3e-4), None if role is Role.TACHO else calibration)
        for k, role in enumerate(Role)
    )
    acquisition = Acquisition(Device("simulated", "", "", "", simulated=True), RATE, 1e5, channels, Tacho(2.5, 1.0))
    limits = Limits(80e-6, 95e-6, 100e-6, 2000 * math.pi / 3)
    return RunHeader("run", "rig", 10**18, acquisition, AnalysisSettings(), limits, "", "rig", "a note")


def codes(first: int, n: int = BLOCK) -> np.ndarray[tuple[int, int], np.dtype[np.int16]]:
    return (np.arange(first, first + n) + 1000 * np.arange(3)[:, np.newaxis]).astype(np.int16)


def written(folder: Path, header: RunHeader, limits: PartLimits, *, blocks: int = 12) -> PartWriter:
    """Write a run of numbered samples, with 50 samples lost after the seventh block and a marker in the ninth."""
    writer = PartWriter(folder / "run.mcap", header, limits)
    segment = first = 0
    for k in range(blocks):
        if k == 7:
            writer.write_segment_end(SegmentEnd(0, first, EndReason.OVERRUN, 50))
            segment, first = 1, 0
        writer.write_block(SampleBlock(codes(k * BLOCK), segment, first, 0))
        first += BLOCK
        if k == 8:
            writer.add_result(encode_marker(Marker(segment, first, "here", 5), header))
    writer.write_segment_end(SegmentEnd(segment, first, EndReason.STOPPED))
    writer.close()
    return writer


def test_parts_have_every_sample_of_the_run_once(tmp_path: Path, header: RunHeader) -> None:
    writer = written(tmp_path, header, PartLimits(samples=300))
    assert writer.files == 4
    runs = sorted(Catalogue(tmp_path).runs(), key=lambda entry: entry.started_ns)
    assert [entry.id for entry in runs] == ["run", "run-part2", "run-part3", "run-part4"]
    read = []
    for entry in runs:
        assert not [finding for finding in verify(entry.path).findings if finding.is_fault]
        with RunReader(entry.path) as reader:
            assert reader.is_complete
            assert reader.header.run == entry.id
            assert reader.skipped_samples == reader.n_samples == 300
            read += [item.codes for item in reader.items() if isinstance(item, SampleBlock)]
    np.testing.assert_array_equal(np.concatenate(read, axis=1), codes(0, 12 * BLOCK))


def test_parts_name_the_next_part_and_have_their_own_start(tmp_path: Path, header: RunHeader) -> None:
    written(tmp_path, header, PartLimits(samples=300))
    readers = [RunReader(tmp_path / f"{name}.mcap") for name in ("run", "run-part2", "run-part3", "run-part4")]
    ends = [reader.segment_ends for reader in readers]
    for reader in readers:
        reader.close()
    assert ends[0] == (SegmentEnd(0, 300, EndReason.FINISHED, detail="continues in run-part2 with the next sample"),)
    assert ends[2] == (
        SegmentEnd(0, 100, EndReason.OVERRUN, 50),
        SegmentEnd(1, 200, EndReason.FINISHED, detail="continues in run-part4 with the next sample"),
    )
    assert ends[3] == (SegmentEnd(0, 300, EndReason.STOPPED),)
    assert [reader.header.note for reader in readers[:2]] == ["a note", "a note (part 2 of run)"]
    starts = [(reader.header.started_ns - header.started_ns) / NS for reader in readers]
    assert starts == [0.0, 0.3, 0.6, 0.95]


def test_marker_is_written_to_the_part_of_its_time(tmp_path: Path, header: RunHeader) -> None:
    written(tmp_path, header, PartLimits(samples=300))
    with RunReader(tmp_path / "run-part3.mcap") as reader:
        assert reader.markers() == (Marker(1, 200, "here", 5),)


def test_part_full_at_a_segment_end_ends_with_the_segment(tmp_path: Path, header: RunHeader) -> None:
    written(tmp_path, header, PartLimits(samples=700))
    with RunReader(tmp_path / "run.mcap") as first, RunReader(tmp_path / "run-part2.mcap") as second:
        assert first.segment_ends == (SegmentEnd(0, 700, EndReason.OVERRUN, 50),)
        assert second.segment_ends == (SegmentEnd(0, 500, EndReason.STOPPED),)
        assert second.header.started_ns - header.started_ns == 750_000_000


@contextmanager
def empty_run(folder: Path, header: RunHeader) -> Iterator[RunWriter]:
    """Yield the writer of a run without samples."""
    writer = RunWriter(folder / "empty.mcap", header)
    yield writer
    writer.close()


def test_part_ends_at_its_size_limit(tmp_path: Path, header: RunHeader) -> None:
    with empty_run(tmp_path, header) as empty:
        size = empty.size
    writer = written(tmp_path, header, PartLimits(size=size + 500), blocks=120)
    assert 1 < writer.files < 120


def test_run_without_limits_is_one_file(tmp_path: Path, header: RunHeader) -> None:
    assert written(tmp_path, header, PartLimits()).files == 1
    with RunReader(tmp_path / "run.mcap") as reader:
        assert reader.skipped_samples == 0
        assert reader.markers() == (Marker(1, 200, "here", 5),)


def write_event(
    writer: PartWriter, segment: int, blocks: int, *, reason: EndReason = EndReason.FINISHED, first: int = 0
) -> None:
    """Write an event of samples numbered from `first` on."""
    for k in range(blocks):
        writer.write_block(SampleBlock(codes(first + k * BLOCK), segment, k * BLOCK, 0))
    writer.write_segment_end(SegmentEnd(segment, blocks * BLOCK, reason))


def test_each_event_is_a_file_finished_before_the_next(tmp_path: Path, header: RunHeader) -> None:
    writer = PartWriter(tmp_path / "run.mcap", header, PartLimits(is_rearmed=True))
    writer.skip_samples(250)
    write_event(writer, 0, 3)
    with RunReader(tmp_path / "run.mcap") as reader:
        assert reader.is_complete
        assert reader.skipped_samples == reader.n_samples == 300
    assert not (tmp_path / "run-event2.mcap").exists()
    writer.skip_samples(1234)
    write_event(writer, 1, 2, first=5000, reason=EndReason.STOPPED)
    writer.close()
    assert [*file_ids(tmp_path / "run.mcap")] == ["run", "run-event2"]
    assert writer.files == 2
    with RunReader(tmp_path / "run-event2.mcap") as reader:
        assert reader.segment_ends == (SegmentEnd(0, 200, EndReason.STOPPED),)
        assert reader.header.started_ns - header.started_ns == (250 + 300 + 1234) * NS // 1000
        assert reader.header.note == "a note (event 2 of run)"
        (first, second, _end) = reader.items()
        assert isinstance(first, SampleBlock)
        assert isinstance(second, SampleBlock)
        np.testing.assert_array_equal(np.hstack([first.codes, second.codes]), codes(5000, 200))
        assert not [finding for finding in verify(reader.path).findings if finding.is_fault]


def test_long_event_is_divided_into_parts(tmp_path: Path, header: RunHeader) -> None:
    writer = PartWriter(tmp_path / "run.mcap", header, PartLimits(samples=200, is_rearmed=True))
    write_event(writer, 0, 3)
    write_event(writer, 1, 5)
    writer.close()
    names = ["run", "run-part2", "run-event2", "run-event2-part2", "run-event2-part3"]
    assert [*file_ids(tmp_path / "run.mcap")] == names
    lengths = []
    for name in names:
        with RunReader(tmp_path / f"{name}.mcap") as reader:
            assert reader.header.run == name
            lengths.append(reader.n_samples)
    assert lengths == [200, 100, 200, 200, 100]


def test_loss_between_two_events_is_recorded_in_the_next(tmp_path: Path, header: RunHeader) -> None:
    writer = PartWriter(tmp_path / "run.mcap", header, PartLimits(is_rearmed=True))
    write_event(writer, 0, 1)
    writer.write_segment_end(SegmentEnd(1, 0, EndReason.OVERRUN, 70))
    write_event(writer, 2, 1)
    writer.close()
    with RunReader(tmp_path / "run-event2.mcap") as reader:
        assert reader.segment_ends == (
            SegmentEnd(0, 0, EndReason.OVERRUN, 70),
            SegmentEnd(1, 100, EndReason.FINISHED),
        )
        assert not reader.is_gap_free


@pytest.mark.parametrize("has_next", [True, False])
def test_marker_between_two_events_is_at_the_beginning_of_the_next(
    tmp_path: Path, header: RunHeader, *, has_next: bool
) -> None:
    writer = PartWriter(tmp_path / "run.mcap", header, PartLimits(is_rearmed=True))
    write_event(writer, 0, 1)
    writer.add_result(encode_marker(Marker(1, 0, "between", 5), header))
    if has_next:
        write_event(writer, 1, 1)
    writer.close()
    with RunReader(tmp_path / "run-event2.mcap") as reader:
        assert reader.is_complete
        assert reader.n_samples == (100 if has_next else 0)
        assert reader.markers() == (Marker(0, 0, "between", 5),)
