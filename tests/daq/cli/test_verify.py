"""`rig verify` and `rig recover`: exit codes and output."""

import json
import re
from contextlib import closing
from pathlib import Path

import pytest

from daq.cli.main import main
from recordings.mcap.container import Container
from recordings.mcap.reader import RunReader
from tests.daq.support.recorded_bench import RUN

Captured = pytest.CaptureFixture[str]


def test_verify_reports_a_sound_run(run: Path, capsys: Captured) -> None:
    assert main(["verify", RUN]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert re.fullmatch(rf"{run}: intact  40,000 samples per channel, 1 segment, \d+ intact chunks, 0\.\d MB", lines[0])
    assert main(["verify", str(run), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["run"], report["verdict"], report["samples"]) == (RUN, "intact", 40_000)


def test_truncated_run_fails_verification_and_recovery_lists_what_is_missing(
    run: Path, folder: Path, capsys: Captured
) -> None:
    run.write_bytes(run.read_bytes()[: run.stat().st_size // 2])
    assert main(["verify", RUN]) == 5
    out = capsys.readouterr().out
    assert f"{run}: damaged" in out
    assert re.search(r"^fault  file        end of file: the index at the end is missing", out, re.MULTILINE)
    assert main(["recover", RUN]) == 5
    copy = folder / f"{RUN}-recovered.mcap"
    with RunReader(copy) as reader:
        n = reader.n_samples
    out = capsys.readouterr().out
    assert out.startswith(f"{copy}: {n:,} samples per channel in 1 segment, ")
    assert f"missing  segment 0: everything after its first {n} samples" in out
    assert main(["verify", str(copy)]) == 0
    assert main(["recover", RUN]) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["recover", RUN, "-o", str(folder / "other.mcap"), "--json"]) == 5
    (missing,) = json.loads(capsys.readouterr().out)["missing"]
    assert missing == {"segment": 0, "first_sample": n, "stop_sample": None, "samples": None}


def test_recovery_lists_the_samples_of_a_damaged_chunk(run: Path, folder: Path, capsys: Captured) -> None:
    with closing(Container(run)) as container:
        place = container.chunks[1]
    data = bytearray(run.read_bytes())
    data[place.offset + place.length // 2] ^= 1
    run.write_bytes(data)
    assert main(["index", "--verify"]) == 5
    assert main(["runs"]) == 0
    assert re.search(rf"^{RUN} .* MB  damaged", capsys.readouterr().out, re.MULTILINE)
    assert main(["recover", RUN, "-o", str(folder / "copy.mcap")]) == 5
    out = capsys.readouterr().out
    missing = re.search(r"^missing  segment 0: samples (\d+) to (\d+) \((\d+) per channel\)$", out, re.MULTILINE)
    assert missing is not None
    first, last, samples = map(int, missing.groups())
    assert samples == last - first + 1
    assert f"{40_000 - samples:,} samples per channel in 2 segments, 1 damaged chunk left out" in out


def test_recovery_of_a_sound_run_misses_nothing(run: Path, folder: Path, capsys: Captured) -> None:
    assert main(["recover", str(run), "-o", str(folder / "copy.mcap")]) == 0
    assert "nothing is missing" in capsys.readouterr().out


def test_file_that_is_no_recording_exits_with_2(folder: Path, capsys: Captured) -> None:
    (folder / "text.mcap").write_text("no recording")
    for command in ("verify", "recover"):
        assert main([command, "text"]) == 2
        assert "is not an MCAP file" in capsys.readouterr().err
        assert main([command, "nothing"]) == 2
        assert "there is no such run" in capsys.readouterr().err
