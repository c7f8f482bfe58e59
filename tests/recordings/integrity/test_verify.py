"""Verification: an intact recording passes, and every fault is reported with its position."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import Calibration, Role, RunHeader
from analysis.signals.snapshot import Snapshot
from recordings.errors import DamagedError, NotFoundError, UnknownFormatError
from recordings.integrity.file_checks import Check, check_acquisition
from recordings.integrity.verify import Verdict, verify
from recordings.mcap.container import Container
from recordings.mcap.layout import RUN_RECORD, encode_metadata
from recordings.mcap.results import encode_snapshot
from recordings.mcap.writer import RunWriter

MakeBlock = Callable[..., SampleBlock]


@pytest.fixture
def run(tmp_path: Path, header: RunHeader, make_block: MakeBlock, make_snapshot: Callable[..., Snapshot]) -> Path:
    """Return a run of two segments with results; samples are lost after the first."""
    writer = RunWriter(tmp_path / "run.mcap", header)
    for segment, lost in ((0, 123), (1, 0)):
        for k in range(10):
            writer.write_block(make_block(segment, k * 1000, 1000))
        for result in encode_snapshot(make_snapshot(segment, 10_000), header):
            writer.add_result(result)
        reason = EndReason.OVERRUN if lost else EndReason.STOPPED
        writer.write_segment_end(SegmentEnd(segment, 10_000, reason, lost))
    writer.close()
    return writer.path


def faults(path: Path) -> set[tuple[Check, str]]:
    verification = verify(path)
    assert verification.verdict is (Verdict.DAMAGED if verification.faults else Verdict.INTACT)
    return {(finding.check, finding.what) for finding in verification.faults}


def test_a_sound_run_has_no_faults_and_its_losses_are_reported(run: Path) -> None:
    verification = verify(run)
    assert verification.faults == ()
    assert verification.verdict is Verdict.INTACT
    assert (verification.segments, verification.samples, verification.size) == (2, 20_000, run.stat().st_size)
    assert verification.chunks >= 4
    assert "123 samples lost after sample 10000: overrun" in {finding.what for finding in verification.findings}
    rails = [finding for finding in verification.findings if "rails" in finding.what]
    assert [finding.where for finding in rails] == ["channel x", "channel y", "channel tacho"]
    assert any("outside the calibrated 0.5 to 9.5 V" in finding.what for finding in verification.findings)


def test_progress_increases_to_one(run: Path) -> None:
    fractions: list[float] = []
    verify(run, fractions.append)
    assert len(fractions) > 10
    assert fractions == sorted(fractions)
    assert fractions[0] < 0.2
    assert fractions[-1] == 1.0


def test_a_change_of_any_byte_of_a_finished_file_is_a_fault(run: Path, tmp_path: Path) -> None:
    data = run.read_bytes()
    changed = tmp_path / "changed.mcap"
    for position in range(3, len(data), len(data) // 150):
        damaged = bytearray(data)
        damaged[position] ^= 0x10
        changed.write_bytes(damaged)
        assert faults(changed), f"byte {position}"


def test_a_damaged_chunk_is_reported_with_its_offset(run: Path) -> None:
    container = Container(run)
    chunk = container.chunks[2]
    container.close()
    data = bytearray(run.read_bytes())
    data[chunk.offset + chunk.length // 2] ^= 1
    run.write_bytes(data)
    found = {(finding.check, finding.where) for finding in verify(run).faults}
    assert (Check.CRC, f"byte {chunk.offset - 9}") in found
    assert any(check is Check.COUNTS for check, _ in found)


def test_a_truncated_file_is_damaged(run: Path) -> None:
    container = Container(run)
    second = container.chunks[1]
    container.close()
    run.write_bytes(run.read_bytes()[: second.offset + second.length // 2])
    found = faults(run)
    assert (Check.FILE, "the index at the end is missing or does not match its checksum") in found
    assert any(check is Check.CONTINUITY and "has no end: the recording breaks off" in what for check, what in found)


def test_zeroed_records_are_reported_and_the_indexed_records_behind_them_checked(run: Path) -> None:
    container = Container(run)
    samples = [chunk for chunk in container.chunks if chunk.may_contain(frozenset({1}))]
    container.close()
    whole = verify(run)
    first, after = samples[1].offset - 9, samples[2].offset - 9
    data = bytearray(run.read_bytes())
    data[first : after - 5] = bytes(after - 5 - first)
    run.write_bytes(data)
    verification = verify(run)
    found = {(finding.check, finding.where): finding.what for finding in verification.faults}
    assert f"{after - first} bytes later, at byte {after}" in found[Check.FILE, f"byte {first}"]
    assert found[Check.INDEX, f"byte {first}"] == "the index lists a chunk that is not there"
    assert verification.chunks == whole.chunks - 1
    assert sum(check is Check.INDEX for check, _ in found) == 1
    assert 0 < verification.samples < whole.samples


def test_a_damaged_copy_of_the_header_is_reported_and_the_other_is_used(run: Path, header: RunHeader) -> None:
    data = run.read_bytes()
    first = data.index(b"2UM-117")
    assert data.index(b"2UM-117", first + 1) > first
    run.write_bytes(data[:first] + b"3" + data[first + 1 :])
    assert (Check.CRC, "the record rig.run does not match its checksum") in faults(run)
    assert verify(run).run == header.run


def test_a_file_closed_inside_a_segment_is_damaged(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    writer.write_block(make_block(0, 0, 1000))
    writer.close()
    assert (Check.COUNTS, "the file was closed before its last segment ended") in faults(writer.path)


def test_a_different_second_copy_of_the_header_is_a_fault(
    tmp_path: Path, header: RunHeader, make_block: MakeBlock
) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    writer.write_metadata(RUN_RECORD, {"run": "another"})
    writer.write_block(make_block(0, 0, 1000))
    writer.write_segment_end(SegmentEnd(0, 1000, EndReason.STOPPED))
    writer.close()
    assert (Check.CRC, "header: rig is missing") in faults(writer.path)


def test_a_file_that_is_no_recording_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(NotFoundError, match="there is no such file"):
        verify(tmp_path / "nowhere.mcap")
    (tmp_path / "text.mcap").write_text("no recording at all")
    with pytest.raises(DamagedError, match="is not an MCAP file"):
        verify(tmp_path / "text.mcap")


def test_an_unknown_format_version_is_an_error(run: Path) -> None:
    version = b"\x06\0\0\0format\x01\0\0\0"
    assert run.read_bytes().count(version + b"1") == 3
    run.write_bytes(run.read_bytes().replace(version + b"1", version + b"2"))
    with pytest.raises(UnknownFormatError, match="run format version '2', expected 1"):
        verify(run)
    assert encode_metadata({})["format"] == "1"


GOOD = Calibration((0.0, 1e-5), 1.0, 9.0, date="2026-01-01")


@pytest.mark.parametrize(
    ("calibration", "fault"),
    [
        (replace(GOOD, coefficients=(0.0, math.nan)), "expected finite coefficients"),
        (replace(GOOD, coefficients=(0.0, 1e-5, -1e-6)), "not monotonic"),
        (replace(GOOD, volts_high=0.5), "calibrated from 1 to 0.5 V, expected a rising span"),
        (None, "a probe without calibration"),
    ],
)
def test_an_invalid_calibration_is_a_fault(header: RunHeader, calibration: Calibration, fault: str) -> None:
    x, y, tacho = header.acquisition.channels
    acquisition = replace(header.acquisition, channels=(replace(x, calibration=calibration), y, tacho))
    (finding,) = [finding for finding in check_acquisition(acquisition) if finding.is_fault]
    assert (finding.check, finding.where) == (Check.CALIBRATION, "channel x")
    assert fault in finding.what


def test_invalid_scalings_rates_and_roles_are_faults(header: RunHeader) -> None:
    x, y, tacho = header.acquisition.channels
    channels = (
        replace(x, scaling=(math.inf,)),
        replace(y, scaling=(1.0, -1e-4), calibration=replace(GOOD, date="")),
        replace(tacho, role=Role.PROBE_X, calibration=GOOD),
    )
    acquisition = replace(header.acquisition, rate=0.0, channels=channels)
    found = [(finding.where, finding.what) for finding in check_acquisition(acquisition)]
    assert [where for where, _ in found] == ["header", "header", "header", "channel x", "channel y", "channel y"]
    assert "rate of 0.0 Hz, expected a positive one" in found[0][1]
    assert found[1][1] == "2 channels have the role probe_x, expected 1"
    assert found[2][1] == "0 channels have the role tacho, expected 1"
    assert "the scaling gives" in found[4][1]
    assert found[5][1] == "the calibration has no date"


def test_a_list_of_faults_is_limited(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> None:
    path = tmp_path / "run.mcap"
    writer = RunWriter(path, header)
    for k in range(150):
        writer.write_block(make_block(0, 6000 * k, 6000))
    writer.close()
    container = Container(path)
    chunks = list(container.chunks)
    container.close()
    data = bytearray(path.read_bytes())
    for chunk in chunks[::2]:
        data[chunk.offset + 60] ^= 1
    path.write_bytes(data)
    findings = verify(path).findings
    assert len(findings) == 101
    assert findings[-1].what == "more than 100 findings: the list ends here"
