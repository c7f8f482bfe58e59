"""`rig verify`, `recover`, `index`, `runs` and `annotate`: exit codes and output."""

import json
import os
import re
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from daq.cli.main import main
from daq.config.rig import Rig
from daq.drivers.factory import open_source
from daq.session.recording.messages import RecordingRequest
from daq.session.recording.recorder import run_header
from recordings.mcap.container import Container
from recordings.mcap.reader import RunReader
from recordings.mcap.writer import write_run

Captured = pytest.CaptureFixture[str]
RUN = "2026-11-24T09-12-07-gj90c"
STARTED_NS = 1_795_511_527_000_000_000


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """Return the test's own data folder."""
    before = dict(os.environ)
    os.environ["RIG_DATA"] = str(tmp_path / "data")
    os.environ.pop("RIG_CATALOGUE", None)
    (tmp_path / "data").mkdir()
    yield tmp_path / "data"
    os.environ.clear()
    os.environ.update(before)


@pytest.fixture
def run(folder: Path, rig: Callable[..., Rig]) -> Path:
    """Return the file of a run of 2 s at 6000 r/min."""
    path = folder / f"{RUN}.mcap"
    loaded = rig()
    order = RecordingRequest(
        rig=loaded, run=RUN, started_ns=STARTED_NS, note="cold oil", program="rig", path=path, duration=None
    )
    with closing(open_source(loaded)) as source:
        write_run(path, run_header(order, source), source.blocks(), {})
    os.utime(path, (1_795_511_530, 1_795_511_530))
    return path


def test_verify_reports_a_sound_run(run: Path, capsys: Captured) -> None:
    assert main(["verify", RUN]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert re.fullmatch(rf"{run}: sound  40,000 samples per channel, 1 segment, \d+ intact chunks, 0\.\d MB", lines[0])
    assert main(["verify", str(run), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["run"], document["verdict"], document["samples"]) == (RUN, "sound", 40_000)


def test_truncated_run_fails_verification_and_recovery_lists_what_is_missing(
    run: Path, folder: Path, capsys: Captured
) -> None:
    run.write_bytes(run.read_bytes()[: run.stat().st_size // 2])
    assert main(["verify", RUN]) == 5
    out = capsys.readouterr().out
    assert f"{run}: not whole" in out
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
    assert re.search(rf"^{RUN} .* MB  not whole", capsys.readouterr().out, re.MULTILINE)
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


def test_index_lists_new_damaged_and_missing_runs(run: Path, folder: Path, capsys: Captured) -> None:
    assert main(["index", "--verify"]) == 0
    assert capsys.readouterr().out == f"new       {RUN}\n{folder}: 1 runs, 0 unchanged\n"
    assert main(["runs", "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert (found["run"], found["verdict"]) == (RUN, "sound")
    run.unlink()
    (folder / "text.mcap").write_text("no recording")
    assert main(["index"]) == 5
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["new       text", f"missing   {RUN}"]
    assert lines[2].startswith("damaged   text: ")
    assert main(["index", "--json"]) == 5
    assert json.loads(capsys.readouterr().out)["damaged"] == ["text"]


def test_runs_are_filtered_by_time_rig_calibration_speed_text_and_tags(run: Path, capsys: Captured) -> None:
    assert run.exists()
    assert main(["index"]) == 0
    assert main(["annotate", RUN, "--tag", "good", "--tag", "odd", "--remark", "bearing\nnew"]) == 0
    assert main(["annotate", RUN, "--untag", "odd"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == f"{RUN}  #good  “cold oil”  “bearing new”"
    matching = [["--since", "2026-11-01"], ["--speed", "5900-6100"], ["--text", "COLD bearing"], ["--tag", "good"]]
    other = [["--before", "2026-11-01"], ["--speed", "7000-8000"], ["--text", "warm"], ["--tag", "odd"]]
    other.append(["--onset-below", "9000"])
    assert main(["runs", "--json"]) == 0
    (listed,) = json.loads(capsys.readouterr().out)
    matching += [["--rig", listed["rig"]], ["--calibration", listed["calibration"][:6]]]
    other += [["--rig", "none"], ["--calibration", "none"], ["--device", "none"]]
    for option in matching:
        assert main(["runs", *option]) == 0
        assert re.fullmatch(
            rf"{RUN} +2\.0 s .* MB  complete  #good  “cold oil”  “bearing new”\n", capsys.readouterr().out
        )
    for option in other:
        assert main(["runs", *option]) == 0
        assert capsys.readouterr().out.startswith("no matching runs in ")


@pytest.mark.parametrize(
    "arguments", [["--since", "yesterday"], ["--speed", "9"], ["--speed", "9-x"], ["--speed", "9-3"]]
)
def test_invalid_filter_is_refused(arguments: list[str], capsys: Captured) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["runs", *arguments])
    assert caught.value.code == 2
    assert "expected a" in capsys.readouterr().err


def test_invalid_tag_is_refused(run: Path, capsys: Captured) -> None:
    assert main(["annotate", RUN, "--tag", " "]) == 2
    assert "rig: tag: ' ', expected" in capsys.readouterr().err
    assert run.exists()
