"""`rig record`, `summary`, `replay`, `runs`, `serve` and `predict` as an operator calls them."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest

from daq.cli.main import main
from daq.schemas.summary import SummarySchema
from recordings.mcap.reader import RunReader

RigFiles = Callable[..., Path]

SLOW = {"profile": [{"time_s": 0, "speed_rpm": 3000}, {"time_s": 60, "speed_rpm": 3000}], "pace": "real time"}
SHORT = {"profile": [{"time_s": 0, "speed_rpm": 2800}, {"time_s": 2, "speed_rpm": 3200}], "pace": "real time"}
LIMITS = {"speed_rpm": 4000.0}


@pytest.fixture(autouse=True)
def places(tmp_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Return the test's own data folder; predictions are cached for the session."""
    before = dict(os.environ)
    os.environ["RIG_DATA"] = str(tmp_path / "data")
    os.environ["RIG_CACHE"] = str(tmp_path_factory.getbasetemp() / "cache")
    yield tmp_path / "data"
    os.environ.clear()
    os.environ.update(before)


def recorded_run(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> SummarySchema:
    """Record the short run; return the summary that the command prints."""
    path = rig_file(simulation=SHORT, limits=LIMITS)
    assert main(["record", str(path), "--no-view", "--port", "0", "--json", "--note", "a word"]) == 0
    return SummarySchema.model_validate_json(capsys.readouterr().out)


def test_record_summary_and_replay_print_the_same_summary(
    rig_file: RigFiles, capsys: pytest.CaptureFixture[str], places: Path
) -> None:
    summary = recorded_run(rig_file, capsys)
    assert summary.is_gap_free
    assert summary.samples == 40_000
    assert summary.agreement is not None
    assert [path.stem for path in places.glob("*.mcap")] == [summary.run]
    assert main(["summary", summary.run, "--json"]) == 0
    assert SummarySchema.model_validate_json(capsys.readouterr().out) == summary
    assert main(["replay", summary.run, "--pace", "max", "--no-view", "--no-serve", "--json"]) == 0
    assert SummarySchema.model_validate_json(capsys.readouterr().out) == summary


def test_summary_and_runs_print_text_and_json(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> None:
    run = recorded_run(rig_file, capsys).run
    assert main(["summary", run]) == 0
    out = capsys.readouterr().out
    assert re.search(r"complete, no samples lost  [\d,]+–3,\d{3} r/min  max \d+ µm pp on [xy] at 3,\d{3} r/min", out)
    assert "sub-synchronous  none" in out
    assert re.search(r"^model +1X ", out, re.MULTILINE)
    assert main(["runs"]) == 0
    assert re.search(rf"^{run} +2\.0 s +\d\.\d MB  complete  “a word”$", capsys.readouterr().out, re.MULTILINE)
    assert main(["runs", "--json"]) == 0
    assert [run["run"] for run in json.loads(capsys.readouterr().out)] == [run]


def test_runs_reports_an_empty_folder(capsys: pytest.CaptureFixture[str], places: Path) -> None:
    assert main(["runs"]) == 0
    assert capsys.readouterr().out == f"no runs in {places}\n"


def test_record_reports_all_faults_of_a_rig_file_and_records_nothing(
    rig_file: RigFiles, capsys: pytest.CaptureFixture[str], places: Path
) -> None:
    path = rig_file(timing={"rate_hz": -1.0}, limits={"clearence_um": 3.0})
    assert main(["record", str(path)]) == 2
    err = capsys.readouterr().err
    assert f"{path}: 2 errors" in err
    assert "timing.rate_hz" in err
    assert "clearance_um" in err
    assert not places.exists()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["record", "nowhere.toml"], "nowhere.toml"),
        (["summary", "../secret"], "'../secret': there is no such run"),
        (["replay", "2026-01-01T00-00-00-gone", "--no-serve"], "there is no such run"),
        (["summary", "nowhere.mcap"], "nowhere.mcap: there is no such file"),
    ],
)
def test_missing_file_or_run_is_named(arguments: list[str], expected: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("rig: ")
    assert expected in captured.err
    assert captured.out == ""


@pytest.mark.parametrize(
    "arguments",
    [["record", "x.toml", "--for", "soon"], ["replay", "x", "--pace", "-1"], ["mark", "x", "--port", "0"]],
)
def test_wrong_usage_prints_the_usage(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    assert "usage: rig" in capsys.readouterr().err


def test_other_host_requires_a_token(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["record", str(rig_file(simulation=SHORT)), "--host", "0.0.0.0", "--no-view"]) == 2  # noqa: S104 - refused
    assert "--token" in capsys.readouterr().err


def test_missing_device_exits_with_3(rig_file: RigFiles, capsys: pytest.CaptureFixture[str], places: Path) -> None:
    path = rig_file(device={"backend": "nidaqmx", "target": "127.0.0.1:9", "deadline_s": 0.5})
    assert main(["record", str(path), "--no-view", "--port", "0"]) == 3
    assert "127.0.0.1:9" in capsys.readouterr().err
    assert not list(places.glob("*.mcap"))


def test_port_in_use_is_named(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        assert main(["record", str(rig_file(simulation=SHORT)), "--no-view", "--port", str(port)]) == 2
    assert f"127.0.0.1:{port}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "expected"),
    [(b"", "empty"), (b"not a recording at all, only some text that is long enough", "MCAP")],
)
def test_file_that_is_no_recording_is_reported(
    content: bytes, expected: str, capsys: pytest.CaptureFixture[str], places: Path
) -> None:
    places.mkdir()
    (places / "2026-01-01T00-00-00-odd.mcap").write_bytes(content)
    assert main(["summary", "2026-01-01T00-00-00-odd"]) == 2
    error = capsys.readouterr().err
    assert "2026-01-01T00-00-00-odd.mcap" in error
    assert expected in error
    assert main(["runs"]) == 0
    assert "2026-01-01T00-00-00-odd" in capsys.readouterr().out


def test_truncated_recording_is_summarised_up_to_its_end(
    rig_file: RigFiles, capsys: pytest.CaptureFixture[str], places: Path
) -> None:
    run = recorded_run(rig_file, capsys).run
    whole = (places / f"{run}.mcap").read_bytes()
    (places / "cut.mcap").write_bytes(whole[: len(whole) // 3])
    assert main(["summary", "cut", "--json"]) == 5
    summary = SummarySchema.model_validate_json(capsys.readouterr().out)
    assert not summary.is_gap_free
    assert 0 < summary.samples < 40_000


def test_predict_prints_the_prediction_over_speed(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(rig_file(limits=LIMITS))
    assert main(["predict", path, "--speed", "3000", "--json"]) == 0
    (prediction,) = json.loads(capsys.readouterr().out)
    assert prediction["speed_rpm"] == 3000.0
    assert prediction["is_exact"]
    assert main(["predict", path]) == 0
    rows = capsys.readouterr().out.splitlines()
    assert [row.split()[0] for row in rows[1:]] == ["1,000", "2,000", "3,000", "4,000"]
    assert float(rows[3].split()[1].partition("∠")[0]) == round(prediction["order_1x"]["amplitude_peak_x_um"], 2)
    assert main(["predict", path, "--speed", "5000"]) == 2
    assert "expected 500 to 4,000 r/min" in capsys.readouterr().err


class Command:
    """A command in its own process, as an operator starts it."""

    def __init__(self, *arguments: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "daq.cli.main", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
        )
        self.url = ""
        assert self._process.stderr is not None
        for line in self._process.stderr:
            found = re.search(r"page (http://[^/]+)/", line)
            if found:
                self.url = found[1]
                break

    def end(self, number: signal.Signals) -> tuple[int, str]:
        self._process.send_signal(number)
        out, _ = self._process.communicate(timeout=60)
        return self._process.returncode, out


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("number", [pytest.param(signal.SIGINT, marks=pytest.mark.campaign), signal.SIGTERM])
def test_signal_ends_the_recording_with_a_complete_file(
    number: signal.Signals, rig_file: RigFiles, places: Path
) -> None:
    command = Command("record", str(rig_file(simulation=SLOW, limits=LIMITS)), "--no-view", "--port", "0")
    deadline = time.monotonic() + 60
    while httpx.get(f"{command.url}/api/v1/live", timeout=60).json()["status"]["samples"] < 6_000:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    code, out = command.end(number)
    assert code == 130
    assert "complete, no samples lost" in out
    (path,) = places.glob("*.mcap")
    with RunReader(path) as reader:
        assert reader.is_complete
        assert reader.n_samples > 5_000


def test_rest_responds_while_a_run_is_recording(rig_file: RigFiles) -> None:
    command = Command("record", str(rig_file(simulation=SLOW, limits=LIMITS)), "--no-view", "--port", "0")
    try:
        deadline = time.monotonic() + 60
        live: dict[str, object] = {}
        while time.monotonic() < deadline and not live.get("measured"):
            live = httpx.get(f"{command.url}/api/v1/live").json()
            time.sleep(0.1)
        assert live["measured"]["speed_rpm"] is None or 2900 < live["measured"]["speed_rpm"] < 3100  # type: ignore[index] # JSON
        runs = httpx.get(f"{command.url}/api/v1/runs").json()["runs"]
        assert [run["run"] for run in runs] == [live["run"]]
        assert httpx.get(f"{command.url}/api/v1/runs/{live['run']}/summary").status_code == 409
    finally:
        code, _ = command.end(signal.SIGTERM)
    assert code == 130


def test_serve_runs_until_it_is_stopped(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> None:
    summary = recorded_run(rig_file, capsys)
    command = Command("serve", "--port", "0")
    try:
        served = httpx.get(f"{command.url}/api/v1/runs/{summary.run}/summary", timeout=30).json()
        assert SummarySchema.model_validate_json(json.dumps(served)) == summary
        assert httpx.get(f"{command.url}/api/v1/live").status_code == 404
        assert "text/html" in httpx.get(f"{command.url}/").headers["content-type"]
    finally:
        code, _ = command.end(signal.SIGTERM)
    assert code == 0
