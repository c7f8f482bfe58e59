"""A sound recording passes every check; whatever is wrong with one is told with its place."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import Calibration, Role, RunHeader
from analysis.signals.snapshot import Snapshot
from recordings.errors import DamagedError, NotFoundError, UnknownFormatError
from recordings.integrity.checks import Check, check_acquisition
from recordings.integrity.verify import Verdict, verify
from recordings.mcap.container import Container
from recordings.mcap.layout import RUN_RECORD, encode_metadata
from recordings.mcap.results import encode_snapshot
from recordings.mcap.writer import RunWriter

MakeBlock = Callable[..., SampleBlock]


@pytest.fixture
def run(tmp_path: Path, header: RunHeader, make_block: MakeBlock, make_snapshot: Callable[..., Snapshot]) -> Path:
    """Return the file of a run of two segments, one with a loss behind it, with results."""
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
    assert verification.verdict is (Verdict.NOT_WHOLE if verification.faults else Verdict.SOUND)
    return {(finding.check, finding.what) for finding in verification.faults}


def test_a_sound_run_is_sound_and_its_losses_are_told(run: Path) -> None:
    verification = verify(run)
    assert verification.faults == ()
    assert verification.verdict is Verdict.SOUND
    assert (verification.segments, verification.samples, verification.size) == (2, 20_000, run.stat().st_size)
    assert verification.chunks >= 4
    assert "123 samples lost after sample 10000: overrun" in {finding.what for finding in verification.findings}
    rails = [finding for finding in verification.findings if "rails" in finding.what]
    assert [finding.where for finding in rails] == ["channel x", "channel y", "channel tacho"]
    assert any("outside the calibrated 0.5 to 9.5 V" in finding.what for finding in verification.findings)


def test_progress_of_an_inspection_rises_to_the_whole(run: Path) -> None:
    told: list[float] = []
    verify(run, told.append)
    assert len(told) > 10
    assert told == sorted(told)
    assert told[0] < 0.2
    assert told[-1] == 1.0


def test_every_byte_of_a_finished_file_is_looked_at(run: Path, tmp_path: Path) -> None:
    data = run.read_bytes()
    changed = tmp_path / "changed.mcap"
    for place in range(3, len(data), len(data) // 150):
        spoilt = bytearray(data)
        spoilt[place] ^= 0x10
        changed.write_bytes(spoilt)
        assert faults(changed), f"byte {place}"


def test_a_chunk_that_is_damaged_is_told_by_its_place(run: Path) -> None:
    container = Container(run)
    place = container.chunks[2]
    container.close()
    data = bytearray(run.read_bytes())
    data[place.offset + place.length // 2] ^= 1
    run.write_bytes(data)
    found = {(finding.check, finding.where) for finding in verify(run).faults}
    assert (Check.CRC, f"byte {place.offset - 9}") in found
    assert any(check is Check.COUNTS for check, _ in found)


def test_a_file_that_is_cut_is_not_whole(run: Path) -> None:
    container = Container(run)
    second = container.chunks[1]
    container.close()
    run.write_bytes(run.read_bytes()[: second.offset + second.length // 2])
    found = faults(run)
    assert (Check.FILE, "the index at the end is missing or does not match its checksum") in found
    assert any(check is Check.CONTINUITY and "has no end: the recording breaks off" in what for check, what in found)


def test_a_hole_is_told_and_what_the_index_names_behind_it_is_looked_at(run: Path) -> None:
    container = Container(run)
    samples = [place for place in container.chunks if place.may_contain(frozenset({1}))]
    container.close()
    whole = verify(run)
    first, after = samples[1].offset - 9, samples[2].offset - 9
    data = bytearray(run.read_bytes())
    data[first : after - 5] = bytes(after - 5 - first)
    run.write_bytes(data)
    verification = verify(run)
    told = {(finding.check, finding.where): finding.what for finding in verification.faults}
    told_on = f"the records break off; the index leads on after {after - first} bytes, at byte {after}"
    assert told[Check.FILE, f"byte {first}"] == told_on
    assert told[Check.INDEX, f"byte {first}"] == "the index names a chunk that is not there"
    assert verification.chunks == whole.chunks - 1
    assert sum(check is Check.INDEX for check, _ in told) == 1
    assert 0 < verification.samples < whole.samples


def test_a_header_of_which_one_copy_is_spoilt_still_serves_and_is_told(run: Path, header: RunHeader) -> None:
    data = run.read_bytes()
    first = data.index(b"2UM-117")
    assert data.index(b"2UM-117", first + 1) > first
    run.write_bytes(data[:first] + b"3" + data[first + 1 :])
    assert (Check.CRC, "the record rig.run does not match its checksum") in faults(run)
    assert verify(run).run == header.run


def test_a_run_closed_inside_a_segment_is_not_whole(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    writer.write_block(make_block(0, 0, 1000))
    writer.close()
    assert (Check.COUNTS, "the run was closed inside a segment") in faults(writer.path)


def test_another_header_in_place_of_the_second_copy_is_told(
    tmp_path: Path, header: RunHeader, make_block: MakeBlock
) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    writer.write_metadata(RUN_RECORD, {"run": "another"})
    writer.write_block(make_block(0, 0, 1000))
    writer.write_segment_end(SegmentEnd(0, 1000, EndReason.STOPPED))
    writer.close()
    assert (Check.CRC, "header: analysis is missing") in faults(writer.path)


def test_what_is_no_recording_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(NotFoundError, match="there is no such file"):
        verify(tmp_path / "nowhere.mcap")
    (tmp_path / "text.mcap").write_text("no recording at all")
    with pytest.raises(DamagedError, match="is not an MCAP file"):
        verify(tmp_path / "text.mcap")


def test_a_run_of_a_format_to_come_is_an_error(run: Path) -> None:
    version = b"\x06\0\0\0format\x01\0\0\0"
    assert run.read_bytes().count(version + b"1") == 3
    run.write_bytes(run.read_bytes().replace(version + b"1", version + b"2"))
    with pytest.raises(UnknownFormatError, match="run format version '2', expected 1"):
        verify(run)
    assert encode_metadata({})["format"] == "1"


GOOD = Calibration((0.0, 1e-5), 1.0, 9.0, date="2026-01-01")


@pytest.mark.parametrize(
    ("calibration", "told"),
    [
        (replace(GOOD, coefficients=(0.0, math.nan)), "expected finite coefficients"),
        (replace(GOOD, coefficients=(0.0, 1e-5, -1e-6)), "one gap for two voltages"),
        (replace(GOOD, volts_high=0.5), "calibrated from 1 to 0.5 V, expected a rising span"),
        (None, "a probe without calibration"),
    ],
)
def test_a_calibration_that_makes_no_sense_is_told(header: RunHeader, calibration: Calibration, told: str) -> None:
    x, y, tacho = header.acquisition.channels
    acquisition = replace(header.acquisition, channels=(replace(x, calibration=calibration), y, tacho))
    (finding,) = [finding for finding in check_acquisition(acquisition) if finding.is_fault]
    assert (finding.check, finding.where) == (Check.CALIBRATION, "channel x")
    assert told in finding.what


def test_scalings_rates_and_roles_that_make_no_sense_are_told(header: RunHeader) -> None:
    x, y, tacho = header.acquisition.channels
    channels = (
        replace(x, scaling=(math.inf,)),
        replace(y, scaling=(1.0, -1e-4), calibration=replace(GOOD, date="")),
        replace(tacho, role=Role.PROBE_X, calibration=GOOD),
    )
    acquisition = replace(header.acquisition, rate=0.0, channels=channels)
    told = [(finding.where, finding.what) for finding in check_acquisition(acquisition)]
    assert [where for where, _ in told] == ["header", "header", "header", "channel x", "channel y", "channel y"]
    assert "rate of 0.0 Hz, expected a positive one" in told[0][1]
    assert told[1][1] == "2 channels have the role probe_x, expected 1"
    assert told[2][1] == "0 channels have the role tacho, expected 1"
    assert "the scaling gives" in told[4][1]
    assert told[5][1] == "the calibration has no date"


def test_a_long_list_of_faults_ends(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> None:
    path = tmp_path / "run.mcap"
    writer = RunWriter(path, header)
    for k in range(150):
        writer.write_block(make_block(0, 6000 * k, 6000))
    writer.close()
    container = Container(path)
    places = list(container.chunks)
    container.close()
    data = bytearray(path.read_bytes())
    for place in places[::2]:
        data[place.offset + 60] ^= 1
    path.write_bytes(data)
    findings = verify(path).findings
    assert len(findings) == 101
    assert findings[-1].what == "and more: the list ends here"
