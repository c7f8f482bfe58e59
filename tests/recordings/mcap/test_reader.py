"""A finished run is read bit for bit, by RunReader and by any other MCAP reader."""

import struct
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import RunHeader
from analysis.signals.snapshot import Snapshot
from recordings import open_run
from recordings.errors import DamagedError, NotFoundError, StorageError, UnknownFormatError
from recordings.mcap.layout import encode_metadata
from recordings.mcap.reader import RunReader
from recordings.mcap.results import encode_snapshot
from recordings.mcap.writer import RunWriter

MakeBlock = Callable[..., SampleBlock]
MakeSnapshot = Callable[..., Snapshot]
CodesOf = Callable[..., NDArray[np.int16]]

ENDS = (
    SegmentEnd(0, 30_000, EndReason.OVERRUN, lost=1234, detail="−200279"),
    SegmentEnd(1, 0, EndReason.UNPLUGGED, lost=0, lost_is_exact=False, detail="−88710"),
    SegmentEnd(2, 50_001, EndReason.STOPPED),
)
BLOCK = 1_500


@pytest.fixture
def run(tmp_path: Path, header: RunHeader, make_block: MakeBlock, make_snapshot: MakeSnapshot) -> Path:
    """Return a run of three segments with results, the second without samples."""
    writer = RunWriter(tmp_path / "run.mcap", header)
    for end in ENDS:
        for first in range(0, end.samples, BLOCK):
            block = make_block(end.segment, first, min(BLOCK, end.samples - first))
            writer.write_block(block)
            for result in encode_snapshot(make_snapshot(end.segment, block.end, with_frame=first > 0), header):
                writer.add_result(result)
        writer.write_segment_end(end)
    writer.close(skipped_samples=4321)
    return writer.path


def test_reader_has_header_and_completeness(run: Path, header: RunHeader) -> None:
    with RunReader(run) as reader:
        assert reader.header == header
        assert reader.segment_ends == ENDS
        assert reader.n_samples == 80_001
        assert reader.duration == 80_001 / 20_000
        assert reader.is_complete
        assert not reader.is_gap_free
        assert reader.skipped_samples == 4321


def test_items_are_read_as_written(run: Path, make_block: MakeBlock) -> None:
    with RunReader(run) as reader:
        items = list(reader.items())
    expected: list[Any] = []
    for end in ENDS:
        expected += [make_block(end.segment, k, min(BLOCK, end.samples - k)) for k in range(0, end.samples, BLOCK)]
        expected.append(end)
    assert len(items) == len(expected)
    for item, original in zip(items, expected, strict=True):
        if isinstance(item, SampleBlock):
            np.testing.assert_array_equal(item.codes, original.codes)
            assert item.codes.flags.c_contiguous
            assert (item.segment, item.first_sample) == (original.segment, original.first_sample)
            assert (item.host_time_ns, item.backlog) == (original.host_time_ns, original.backlog)
        else:
            assert item == original


@pytest.mark.parametrize(
    ("segment", "first", "stop"),
    [(0, 0, 30_000), (0, 0, 1), (0, 29_999, 30_000), (0, 1_499, 1_501), (2, 7, 50_001), (2, 33_333, 33_333), (1, 0, 0)],
)
def test_samples_of_any_interval_are_read(run: Path, codes_of: CodesOf, segment: int, first: int, stop: int) -> None:
    with RunReader(run) as reader:
        codes = reader.samples(segment, first, stop)
    assert codes.dtype == np.int16
    np.testing.assert_array_equal(codes, codes_of(segment, first, stop))


@pytest.mark.parametrize(("segment", "first", "stop"), [(0, -1, 5), (0, 5, 4), (0, 0, 30_001), (1, 0, 1)])
def test_samples_outside_a_segment_are_an_error(run: Path, segment: int, first: int, stop: int) -> None:
    with RunReader(run) as reader, pytest.raises(ValueError, match=f"samples: {first} to {stop}, expected within 0 to"):
        reader.samples(segment, first, stop)


def test_unknown_segment_is_an_error(run: Path) -> None:
    with RunReader(run) as reader, pytest.raises(ValueError, match=r"segment: 3, expected one of \[0, 1, 2\]"):
        reader.samples(3, 0, 1)


def test_snapshots_are_read_bit_for_bit(run: Path, header: RunHeader, make_snapshot: MakeSnapshot) -> None:
    with RunReader(run) as reader:
        snapshots = list(reader.snapshots())
    expected = [
        make_snapshot(end.segment, min(k + BLOCK, end.samples), with_frame=k > 0)
        for end in ENDS
        for k in range(0, end.samples, BLOCK)
    ]
    assert [encode_snapshot(s, header) for s in snapshots] == [encode_snapshot(s, header) for s in expected]


def test_results_are_read_without_the_samples(run: Path) -> None:
    with RunReader(run) as reader:
        chunks = reader._container.chunks
        assert not [chunk for chunk in chunks if chunk.channels and {1, 3} <= chunk.channels]


def test_mcap_library_decodes_the_file_with_its_own_definitions(
    run: Path, header: RunHeader, codes_of: CodesOf
) -> None:
    classes: dict[int, Any] = {}
    seen: dict[str, list[Any]] = {}
    with run.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("protobuf", "protobuf")
            if schema.id not in classes:
                pool = DescriptorPool()
                for definition in FileDescriptorSet.FromString(schema.data).file:
                    pool.Add(definition)
                classes[schema.id] = GetMessageClass(pool.FindMessageTypeByName(schema.name))
            seen.setdefault(channel.topic, []).append(classes[schema.id].FromString(message.data))
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        attachments = {record.name: record.data for record in reader.iter_attachments()}
    assert set(seen) == {"/samples", "/segment_end", "/features", "/order_frame"}
    assert sum(block.samples for block in seen["/samples"]) == 80_001
    last = seen["/samples"][-1]
    np.testing.assert_array_equal(unpacked_one_by_one(last), codes_of(2, last.first_sample, 50_001))
    assert seen["/features"][-1].speed_rpm == pytest.approx(1684.1, abs=0.1)
    assert {"rig.run", "rig.calibration", "rig.end"} == set(metadata)
    assert set(metadata["rig.calibration"]) == {"x", "y"}
    assert attachments == {"rig.toml": header.config_toml.encode()}
    assert summary.statistics is not None
    assert summary.statistics.message_count == sum(len(messages) for messages in seen.values())


def unpacked_one_by_one(message: Any) -> NDArray[np.int16]:
    """Unpack a block's codes one by one as docs/format.md describes, without the project's code."""
    n = message.channels * message.samples
    values: list[int] = []
    for k in range(n):
        folded = message.codes[k] | message.codes[n + k] << 8
        delta = folded >> 1 ^ -(folded & 1)
        before = values[-1] if k % message.samples else 0
        values.append((before + delta) & 0xFFFF)
    return np.array(struct.unpack(f"<{n}h", struct.pack(f"<{n}H", *values)), np.int16).reshape(message.channels, -1)


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.NONE])
def test_run_rewritten_by_another_tool_reads_the_same(
    run: Path, tmp_path: Path, codes_of: CodesOf, compression: CompressionType
) -> None:
    other = tmp_path / "rewritten.mcap"
    with run.open("rb") as old, other.open("wb") as new:
        reader = make_reader(old)
        summary = reader.get_summary()
        assert summary is not None
        writer: Any = Writer(new, chunk_size=50_000, compression=compression)
        writer.start()
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, record.metadata)
        for channel in summary.channels.values():
            schema = summary.schemas[channel.schema_id]
            number = writer.register_schema(schema.name, schema.encoding, schema.data)
            writer.register_channel(channel.topic, channel.message_encoding, number, channel.metadata)
        for _, channel, message in reader.iter_messages():
            writer.add_message(channel.id, message.log_time, message.data, message.publish_time, message.sequence)
        writer.finish()
    with RunReader(run) as before, RunReader(other) as after:
        assert after.header == before.header
        assert after.segment_ends == before.segment_ends
        assert len(list(after.items())) == len(list(before.items()))
        assert len(list(after.snapshots())) == len(list(before.snapshots()))
        np.testing.assert_array_equal(after.samples(2, 777, 44_444), codes_of(2, 777, 44_444))


def test_samples_are_readable_without_an_intact_end_record(run: Path) -> None:
    data = run.read_bytes()
    position = data.rindex(b'"skipped_samples": 4321')
    run.write_bytes(data[:position] + b'"skipped_samples": 4322' + data[position + 23 :])
    with RunReader(run) as reader:
        assert not reader.is_complete
        assert reader.segment_ends == ENDS


def test_missing_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(NotFoundError, match=r"gone\.mcap: there is no such file"):
        RunReader(tmp_path / "gone.mcap")


def test_empty_file_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "run.mcap").write_bytes(b"")
    with pytest.raises(DamagedError, match=r"run\.mcap: is empty"):
        RunReader(tmp_path / "run.mcap")


def test_folder_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="cannot be read"):
        RunReader(tmp_path)


@pytest.mark.parametrize("content", [b"x", b"TDSm" * 100, b"\x89MCAP1\r\n" * 20])
def test_file_that_is_not_mcap_is_an_error(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "run.mcap").write_bytes(content)
    with pytest.raises(DamagedError, match=r"run\.mcap: is not an MCAP file"):
        RunReader(tmp_path / "run.mcap")


def write_foreign(path: Path, entries: dict[str, str] | None) -> None:
    """Write an MCAP file of another program, with or without a run record."""
    with path.open("wb") as file:
        writer: Any = Writer(file)
        writer.start()
        if entries is not None:
            writer.add_metadata("rig.run", entries)
        channel = writer.register_channel("/t", "json", writer.register_schema("t", "jsonschema", b"{}"))
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()


def test_mcap_file_of_another_program_is_an_error(tmp_path: Path) -> None:
    write_foreign(tmp_path / "run.mcap", None)
    with pytest.raises(UnknownFormatError, match=r"run\.mcap: an MCAP file, but no run"):
        RunReader(tmp_path / "run.mcap")


@pytest.mark.parametrize("version", ["2", "0", "one"])
def test_unknown_format_version_is_an_error(tmp_path: Path, version: str) -> None:
    write_foreign(tmp_path / "run.mcap", encode_metadata({}) | {"format": version})
    with pytest.raises(UnknownFormatError, match=f"run format version '{version}', expected 1"):
        RunReader(tmp_path / "run.mcap")


def test_incomplete_header_is_reported_with_the_file(tmp_path: Path) -> None:
    write_foreign(tmp_path / "run.mcap", encode_metadata({"run": "a"}))
    with pytest.raises(DamagedError, match=r"run\.mcap: header: rig is missing"):
        RunReader(tmp_path / "run.mcap")


def test_closed_reader_has_no_open_file(run: Path) -> None:
    def is_open() -> bool:
        return str(run.resolve()) in {file.path for file in psutil.Process().open_files()}

    reader = RunReader(run)
    assert is_open()
    reader.close()
    reader.close()
    assert not is_open()


def test_blocks_with_a_wrong_number_of_channels_are_left_out(run: Path, header: RunHeader) -> None:
    with RunReader(run) as reader:
        reader.header = replace(
            header, acquisition=replace(header.acquisition, channels=header.acquisition.channels[:2])
        )
        ends = list(reader.items())
    assert [(end.segment, end.reason, end.samples) for end in ends if isinstance(end, SegmentEnd)] == [
        (0, EndReason.CUT, 0),
        (1, EndReason.UNPLUGGED, 0),
        (2, EndReason.CUT, 0),
    ]
    assert len(ends) == 3


@pytest.mark.parametrize("kind", [Path, str])
def test_open_run_opens_a_file_and_closes_it(run: Path, kind: Callable[[Path], Path | str]) -> None:
    with open_run(kind(run)) as reader:
        assert reader.samples(0, 0, 7).shape == (3, 7)
    with pytest.raises(NotFoundError):
        open_run(kind(run.with_name("none.mcap")))


def test_package_is_imported_without_a_library() -> None:
    program = (
        "import recordings, sys; print(sorted({'numpy', 'mcap', 'google'} & set(sys.modules)), recordings.open_run)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("[] <function open_run")
