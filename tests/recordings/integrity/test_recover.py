"""Recovery: every sample of every intact chunk is copied, what is missing is listed, the source stays unchanged."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import RunHeader
from recordings.errors import DamagedError, StorageError
from recordings.integrity.recover import MissingSamples, RecoveredSegment, recover
from recordings.integrity.verify import Verdict, verify
from recordings.mcap.container import Container
from recordings.mcap.messages import decode_block
from recordings.mcap.reader import RunReader
from recordings.mcap.results import Marker, encode_marker
from recordings.mcap.writer import RunWriter

MakeBlock = Callable[..., SampleBlock]
CodesOf = Callable[..., NDArray[np.int16]]
BLOCK, N_BLOCKS = 1000, 20
N = BLOCK * N_BLOCKS


@pytest.fixture
def run(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> Path:
    """Return a run of three segments of five sample chunks each; 77 samples are lost after the first."""
    writer = RunWriter(tmp_path / "run.mcap", header)
    for segment, (reason, lost) in enumerate(
        [(EndReason.OVERRUN, 77), (EndReason.UNPLUGGED, 0), (EndReason.STOPPED, 0)]
    ):
        for k in range(N_BLOCKS):
            writer.write_block(make_block(segment, k * BLOCK, BLOCK))
        writer.write_segment_end(SegmentEnd(segment, N, reason, lost, lost_is_exact=reason is not EndReason.UNPLUGGED))
    writer.close()
    return writer.path


def damage(path: Path, *samples: tuple[int, int]) -> None:
    """Damage the chunks with these samples, given by segment and sample."""
    container = Container(path)
    data = bytearray(path.read_bytes())
    for chunk in container.chunks:
        blocks = [decode_block(message.data) for message in container.messages(chunk) if message.channel == 1]
        if any(block.segment == of and block.first_sample <= k < block.end for block in blocks for of, k in samples):
            data[chunk.offset + chunk.length // 2] ^= 1
    container.close()
    path.write_bytes(data)


def ends(path: Path) -> list[tuple[int, EndReason, int, bool]]:
    with RunReader(path) as reader:
        return [(end.samples, end.reason, end.lost, end.lost_is_exact) for end in reader.segment_ends]


def check_copy(path: Path, header: RunHeader, segments: tuple[RecoveredSegment, ...], codes_of: CodesOf) -> None:
    assert verify(path).verdict is Verdict.INTACT
    with RunReader(path) as reader:
        assert reader.header == header
        assert reader.is_complete
        for segment in segments:
            read = reader.samples(segment.segment, 0, segment.stop - segment.first)
            np.testing.assert_array_equal(read, codes_of(segment.from_segment, segment.first, segment.stop))


def test_an_intact_run_is_copied_completely(run: Path, tmp_path: Path, header: RunHeader, codes_of: CodesOf) -> None:
    before = run.read_bytes()
    recovery = recover(run, tmp_path / "copy.mcap")
    assert run.read_bytes() == before
    assert recovery.missing == ()
    assert recovery.segments == tuple(RecoveredSegment(k, k, 0, N) for k in range(3))
    assert recovery.samples == 3 * N
    assert ends(recovery.target) == ends(run)
    check_copy(recovery.target, header, recovery.segments, codes_of)
    with RunReader(run) as one, RunReader(recovery.target) as other:
        times = zip(one.items(), other.items(), strict=True)
        for a, b in times:
            if isinstance(a, SampleBlock) and isinstance(b, SampleBlock):
                assert (a.segment, a.first_sample, a.host_time_ns, a.backlog) == (
                    b.segment, b.first_sample, b.host_time_ns, b.backlog
                )  # fmt: skip
        assert len(list(other.snapshots())) > 0


def test_a_gap_divides_a_segment_and_is_listed_to_the_sample(
    run: Path, tmp_path: Path, header: RunHeader, codes_of: CodesOf
) -> None:
    damage(run, (0, 7000))
    recovery = recover(run, tmp_path / "copy.mcap")
    (missing,) = recovery.missing
    assert missing.segment == 0
    assert missing.stop is not None
    assert missing.first <= 7000 < missing.stop
    assert missing.samples == missing.stop - missing.first
    assert recovery.damaged_chunks == 1
    assert recovery.samples == 3 * N - missing.samples
    assert [segment.from_segment for segment in recovery.segments] == [0, 0, 1, 2]
    assert ends(recovery.target)[0] == (missing.first, EndReason.CUT, missing.samples, True)
    assert ends(recovery.target)[1] == (N - missing.stop, EndReason.OVERRUN, 77, True)
    check_copy(recovery.target, header, recovery.segments, codes_of)


def test_log_times_of_the_copy_equal_those_of_the_recording(run: Path, tmp_path: Path) -> None:
    def times(path: Path) -> list[int]:
        with path.open("rb") as file:
            return [message.log_time for _, _, message in make_reader(file).iter_messages("/samples")]

    whole = times(run)
    damage(run, (0, 0), (0, 7000))
    copy = recover(run, tmp_path / "copy.mcap").target
    with RunReader(copy) as reader:
        assert reader.segment_ends[0].samples == 0
    assert len(times(copy)) < len(whole)
    assert set(times(copy)) <= set(whole)


def test_a_missing_end_of_a_segment_is_listed(run: Path, tmp_path: Path, header: RunHeader, codes_of: CodesOf) -> None:
    damage(run, (0, N - 1), (2, N - 1))
    recovery = recover(run, tmp_path / "copy.mcap")
    first, last = recovery.missing
    assert (first.segment, first.stop) == (0, N)
    assert (last.segment, last.stop) == (2, N)
    assert first.samples is not None
    assert last.samples is not None
    copied = ends(recovery.target)
    assert copied[0][1:] == (EndReason.CUT, first.samples + 77, True)
    assert copied[1] == (N, EndReason.UNPLUGGED, 0, False)
    assert copied[2][1:] == (EndReason.CUT, last.samples, True)
    check_copy(recovery.target, header, recovery.segments, codes_of)


def test_a_segment_without_intact_samples_is_listed(
    run: Path, tmp_path: Path, header: RunHeader, codes_of: CodesOf
) -> None:
    damage(run, *((1, k * BLOCK) for k in range(N_BLOCKS)))
    recovery = recover(run, tmp_path / "copy.mcap")
    assert recovery.missing == (MissingSamples(1, 0, N),)
    assert [segment.from_segment for segment in recovery.segments] == [0, 1, 2]
    assert ends(recovery.target)[1][:3] == (0, EndReason.CUT, N)
    check_copy(recovery.target, header, recovery.segments, codes_of)


def test_missing_last_segments_of_a_finished_run_are_listed(run: Path, tmp_path: Path) -> None:
    damage(run, *((segment, k * BLOCK) for segment in (1, 2) for k in range(N_BLOCKS)))
    assert recover(run, tmp_path / "copy.mcap").missing == (MissingSamples(1, 0, N), MissingSamples(2, 0, N))


def test_loss_of_a_cut_run_is_unknown(run: Path, tmp_path: Path, header: RunHeader, codes_of: CodesOf) -> None:
    run.write_bytes(run.read_bytes()[: run.stat().st_size // 2])
    recovery = recover(run, tmp_path / "copy.mcap")
    (missing,) = recovery.missing
    assert (missing.segment, missing.stop, missing.samples) == (1, None, None)
    assert ends(recovery.target)[1] == (missing.first, EndReason.CUT, 0, False)
    check_copy(recovery.target, header, recovery.segments, codes_of)
    with recovery.target.open("rb") as file:
        (recovered,) = [record for record in make_reader(file).iter_metadata() if record.name == "rig.recovered"]
    document = json.loads(recovered.metadata["document"])
    assert document["source"] == "run.mcap"
    assert document["missing"] == [{"segment": 1, "first": missing.first, "stop": None}]


def test_markers_keep_their_time(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    markers = [(0, 500, "start"), (0, 7500, "in the gap"), (0, 15_000, "after it"), (1, 900, "next segment")]
    for segment in range(2):
        for k in range(N_BLOCKS):
            writer.write_block(make_block(segment, k * BLOCK, BLOCK))
        for of_segment, sample, text in markers:
            if of_segment == segment:
                writer.add_result(encode_marker(Marker(segment, sample, text, 7), header))
        writer.write_segment_end(SegmentEnd(segment, N, EndReason.OVERRUN))
    writer.close()
    whole = recover(writer.path, tmp_path / "whole.mcap").target
    with RunReader(writer.path) as one, RunReader(whole) as other:
        assert other.markers() == one.markers() == tuple(Marker(*marker, 7) for marker in markers)
    damage(writer.path, (0, 7500))
    recovery = recover(writer.path, tmp_path / "copy.mcap")
    first, second = recovery.segments[:2]
    with RunReader(recovery.target) as reader:
        assert [(marker.segment, marker.sample) for marker in reader.markers()] == [
            (0, 500),
            (0, first.stop),
            (1, 15_000 - second.first),
            (2, 900),
        ]
    assert verify(recovery.target).is_intact


def test_a_copy_never_overwrites_a_file(run: Path, tmp_path: Path) -> None:
    (tmp_path / "copy.mcap").write_text("precious")
    with pytest.raises(StorageError, match=r"copy\.mcap: exists already"):
        recover(run, tmp_path / "copy.mcap")
    assert (tmp_path / "copy.mcap").read_text() == "precious"
    with pytest.raises(StorageError, match="exists already"):
        recover(run, run)
    assert verify(run).verdict is Verdict.INTACT


def test_a_run_without_intact_samples_is_an_error_and_leaves_no_copy(tmp_path: Path, header: RunHeader) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    writer.close()
    with pytest.raises(DamagedError, match=r"run\.mcap: nothing to recover"):
        recover(writer.path, tmp_path / "copy.mcap")
    assert not (tmp_path / "copy.mcap").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="limits of file size are POSIX")
def test_a_full_disk_leaves_no_copy(run: Path, tmp_path: Path) -> None:
    import resource  # noqa: PLC0415  # it exists on POSIX only

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, hard))
    try:
        with pytest.raises(StorageError, match=r"copy\.mcap: cannot be written: File too large"):
            recover(run, tmp_path / "copy.mcap")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not (tmp_path / "copy.mcap").exists()


TOOLS = {
    "pymcap-cli doctor": ["pymcap-cli", "doctor"],
    "rerun mcap info": ["rerun", "mcap", "info"],
    "rerun mcap check": ["rerun", "mcap", "check"],
}


@pytest.mark.parametrize("tool", TOOLS)
def test_intact_and_recovered_files_pass_public_mcap_tools(run: Path, tmp_path: Path, tool: str) -> None:
    program, *arguments = TOOLS[tool]
    found = shutil.which(program, path=str(Path(sys.executable).parent)) or shutil.which(program)
    if found is None:
        pytest.skip(f"{program} is not installed")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(run.read_bytes()[: run.stat().st_size // 2])
    assert subprocess.run([found, *arguments, str(cut)], capture_output=True, check=False).returncode != 0
    recover(cut, tmp_path / "copy.mcap")
    for path in (run, tmp_path / "copy.mcap"):
        done = subprocess.run([found, *arguments, str(path)], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


def test_the_mcap_library_reads_every_message_of_a_recovered_file(run: Path, tmp_path: Path) -> None:
    run.write_bytes(run.read_bytes()[: run.stat().st_size * 2 // 3])
    recovery = recover(run, tmp_path / "copy.mcap")
    with recovery.target.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        messages = list(reader.iter_messages())
    assert summary.statistics.message_count == len(messages)
    blocks = [decode_block(message.data) for _, channel, message in messages if channel.topic == "/samples"]
    assert sum(block.n_samples for block in blocks) == recovery.samples
