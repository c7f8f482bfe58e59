"""Markers of a recorded run: added over REST, by command and at the terminal; in the file, replay and summary."""

import os
import re
import socket
import sys
from contextlib import closing
from pathlib import Path

import httpx
import pytest

from daq.cli.main import main
from daq.drivers.replay import ReplaySource
from daq.session.live_update import TimedMarker
from daq.session.recording.recorded_run import RecordedRun
from daq.session.replayed_run import ReplayedRun
from recordings.integrity.verify import verify
from recordings.mcap.reader import RunReader
from tests.daq.conftest import RigFactory, RigFiles
from tests.daq.support.commands import POSIX, REAL_TIME_MINUTE, record_command
from tests.daq.support.recording import REAL_TIME, NoModel, UpdateList, start_recording
from tests.daq.support.service_bench import open_bench

RATE = 20_000.0
JSON = {"Content-Type": "application/json"}


def wait_for_samples(run: RecordedRun, samples: int) -> int:
    """Wait until at least this number of samples is recorded; return the number then."""
    while (recorded := run.status().samples) < samples:
        assert not run.wait(0.01)
    return recorded


def test_markers_are_in_the_file_at_the_sample_when_they_were_added(rig: RigFactory, tmp_path: Path) -> None:
    run = start_recording(rig(simulation=REAL_TIME_MINUTE), tmp_path)
    before = wait_for_samples(run, 6_000)
    first = run.add_marker("  knocking\nbegins ")
    between = wait_for_samples(run, run.status().samples + 4_000)
    second = run.add_marker("")
    last = run.status().samples
    run.stop()
    assert run.wait(60)
    run.close()
    assert run.add_marker("too late") is None
    with RunReader(run.path) as reader:
        assert reader.markers() == (first, second)
    assert first is not None
    assert second is not None
    assert (first.segment, first.text, second.text) == (0, "knocking begins", "marker")
    assert before <= first.sample <= between - 4_000
    assert between <= second.sample <= last
    assert second.host_time_ns > first.host_time_ns
    assert verify(run.path).findings == ()


def test_marker_is_shown_live_from_its_sample_on_and_again_in_a_replay(rig: RigFactory, tmp_path: Path) -> None:
    run = start_recording(rig(simulation=REAL_TIME), tmp_path)
    assert run.latest().status.markers == ()
    wait_for_samples(run, 10_000)
    added = run.add_marker("knocking")
    assert added is not None
    (shown,) = run.latest().status.markers
    assert shown == TimedMarker(added, added.sample / RATE, added.sample / RATE)
    assert run.wait(60)
    run.close()
    updates = UpdateList()
    with RunReader(run.path) as reader:
        markers = reader.markers()
    with closing(ReplaySource(run.path, None)) as source:
        replayed = ReplayedRun(run.header, source, NoModel(), [updates], markers)
        assert replayed.wait(60)
        replayed.close()
    for update in updates.updates:
        assert update.status.markers == ((shown,) if update.status.samples >= added.sample else ())
    assert {update.status.markers for update in updates.updates} == {(), (shown,)}


@POSIX
def test_markers_from_rest_command_and_terminal_are_in_the_summary(
    rig_file: RigFiles,
    tmp_path: Path,
    tmp_path_factory: pytest.TempPathFactory,
    capsys: pytest.CaptureFixture[str],
) -> None:
    import pty  # noqa: PLC0415 - POSIX only

    environment = os.environ | {
        "RIG_DATA": str(tmp_path / "data"),
        "RIG_CACHE": str(tmp_path_factory.getbasetemp() / "cache"),
    }
    rig = rig_file(simulation=REAL_TIME_MINUTE, limits={"speed_rpm": 4000.0})
    process, terminal = pty.fork()
    if process == 0:
        os.execve(sys.executable, record_command(rig), environment)  # noqa: S606 - it has the terminal
    seen = b""
    while b"lost 0" not in seen:
        seen += os.read(terminal, 4096)
    found = re.search(rb"REST (http://[^ ,]+)", seen)
    assert found is not None
    url = found[1].decode() + "/live/markers"
    assert httpx.post(url, json={"text": "by REST"}).status_code == 201
    assert httpx.post(url, content=b'{"text": "a form"}', headers={"Content-Type": "text/plain"}).status_code == 415
    assert httpx.post(url, json={"text": "x", "who": "y"}).status_code == 422
    acknowledged = httpx.post(url.replace("markers", "acknowledge"), json={})
    assert (acknowledged.status_code, acknowledged.json()["alarms"]) == (200, [])
    port = ["--port", url.split(":")[2].split("/")[0]]
    assert main(["mark", "by", "command", *port]) == 0
    assert re.fullmatch(r"marked “by command” at \d+\.\d s of segment 0\n", capsys.readouterr().out)
    assert main(["acknowledge", *port]) == 0
    assert capsys.readouterr().out == "no new alarm\n"
    os.write(terminal, b"ack\nby hand\n")
    while "marked “by hand”" not in seen.decode(errors="replace"):
        seen += os.read(terminal, 4096)
    os.write(terminal, b"\x03")
    try:
        while True:
            seen += os.read(terminal, 4096)
    except OSError:  # the other side is closed
        pass
    os.waitpid(process, 0)
    output = seen.decode(errors="replace")
    assert "no new alarm" in output
    assert "marked “by hand”" in output
    assert re.search(r"marker +\d+\.\d s  “by REST”", output)
    assert re.search(r"marker +\d+\.\d s  “by hand”", output)
    (path,) = (tmp_path / "data").glob("*.mcap")
    with RunReader(path) as reader:
        assert [marker.text for marker in reader.markers()] == ["by REST", "by command", "by hand"]


def test_marker_command_without_a_recording_reports_the_address(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as unused:
        port = str(unused.getsockname()[1])
    assert main(["mark", "--port", port]) == 2
    assert re.search(rf"127\.0\.0\.1:{port} does not respond \(.+\): is rig record running", capsys.readouterr().err)
    bench = open_bench()
    try:
        port = bench.server.url.rpartition(":")[2]
        assert main(["mark", "--port", port]) == 2
    finally:
        bench.close()
    assert f"127.0.0.1:{port}: no run is being recorded" in capsys.readouterr().err
