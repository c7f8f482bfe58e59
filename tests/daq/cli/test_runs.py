"""`rig index`, `rig runs` and `rig annotate`: exit codes and output."""

import json
import math
import re
from pathlib import Path

import pytest

from daq.cli.main import main
from tests.daq.support.recorded_bench import RUN

Captured = pytest.CaptureFixture[str]


def test_index_lists_new_damaged_and_missing_runs(run: Path, folder: Path, capsys: Captured) -> None:
    assert main(["index", "--verify"]) == 0
    assert capsys.readouterr().out == f"new       {RUN}\n{folder}: 1 runs, 0 unchanged\n"
    assert main(["runs", "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert (found["run"], found["verdict"]) == (RUN, "intact")
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
    low, high = math.floor(listed["largest_peak_to_peak_um"]), math.ceil(listed["largest_peak_to_peak_um"])
    matching += [["--peak-to-peak", f"{low}-{high}"], ["--rms", f"0-{listed['largest_rms_um'] + 0.1}"]]
    other += [["--rms", f"{listed['largest_rms_um'] + 0.1}-99"]]
    other += [["--peak-to-peak", f"{high}-{high + 1}"], ["--peak-to-peak", f"0-{low}"]]
    matching += [["--rig", listed["rig"]], ["--calibration", listed["calibration"][:6]]]
    other += [["--rig", "none"], ["--calibration", "none"], ["--device", "none"]]
    for option in matching:
        assert main(["runs", *option]) == 0
        overall = r"[\d.]+ µm peak-to-peak  [\d.]+ µm RMS"
        row = rf"{RUN} +2\.0 s .* MB  complete  {overall}  #good  “cold oil”  “bearing new”\n"
        assert re.fullmatch(row, capsys.readouterr().out)
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
