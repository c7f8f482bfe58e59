"""A helper process of a recording is suspended or killed: the recording continues, stops, and completes its file."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import threading
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import psutil
import pytest

from daq.config.loader import load_rig
from recordings.integrity.verify import Verdict, verify
from tests.daq.conftest import RigFiles
from tests.daq.support.commands import TIMEOUT, remaining_processes
from tests.daq.support.recorded_bench import RUN, record_run
from tests.daq.support.recording import wait_until

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="POSIX signals and Linux process states"),
    pytest.mark.campaign,
]

STEADY = {"pace": "real time", "profile": [{"time_s": t, "speed_rpm": 3000.0} for t in (0.0, 600.0)]}
NICE = {"predictor": 5, "refiner": 10, "reader": 15}
"""Increase of niceness of each helper process, by which the test identifies it."""


@dataclass(frozen=True, slots=True)
class Recording:
    """A running record command."""

    process: subprocess.Popen[str]
    lines: list[str]

    @property
    def address(self) -> str:
        """The address of its web page, once printed."""
        pattern = re.compile(r"page (http://[\d.:]+)")
        wait_until(lambda: any(pattern.search(line) for line in self.lines))
        return next(found[1] for line in self.lines if (found := pattern.search(line)))

    def get(self, path: str) -> dict[str, object]:
        """Return the JSON response of an API path."""
        with urllib.request.urlopen(f"{self.address}/api/v1/{path}", timeout=TIMEOUT) as response:  # noqa: S310 - loopback
            document: dict[str, object] = json.load(response)
        return document

    def samples(self) -> int:
        """Return the number of samples per channel recorded."""
        status = self.get("live")["status"]
        assert isinstance(status, dict)
        return int(status["samples"])

    def child(self, kind: str) -> psutil.Process:
        """Wait for a helper process and return it."""
        found: list[psutil.Process] = []

        def is_found() -> bool:
            for child in psutil.Process(self.process.pid).children():
                with contextlib.suppress(psutil.NoSuchProcess):
                    is_viewer = "serve_web_viewer" in " ".join(child.cmdline())
                    if is_viewer if kind == "viewer" else child.nice() == os.nice(0) + NICE[kind]:
                        found.append(child)
            return bool(found)

        wait_until(is_found)
        return found[0]


@contextlib.contextmanager
def recording(rig: Path, environment: dict[str, str], *options: str) -> Iterator[Recording]:
    command = [sys.executable, "-m", "daq.cli.main", "record", str(rig), "--port", "0", *options]
    process = subprocess.Popen(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    lines: list[str] = []
    assert process.stderr is not None
    reader = threading.Thread(target=lines.extend, args=(process.stderr,))
    reader.start()
    try:
        yield Recording(process, lines)
    finally:
        process.kill()
        process.wait()
        reader.join(TIMEOUT)
        process.stderr.close()


@pytest.mark.parametrize("number", [signal.SIGSTOP, signal.SIGKILL], ids=["suspended", "killed"])
@pytest.mark.parametrize("kind", [*NICE, "viewer"])
def test_recording_continues_and_completes_when_a_helper_process_fails(
    kind: str, number: signal.Signals, rig_file: RigFiles, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    (tmp_path / "data").mkdir()
    record_run(load_rig(rig_file()), tmp_path / "data")
    rig = rig_file(simulation=STEADY, limits={"speed_rpm": 20_000.0 if kind == "predictor" else 4000.0})
    cache = tmp_path / "cache" if kind == "predictor" else tmp_path_factory.getbasetemp() / "cache"
    environment = dict(os.environ) | {"RIG_DATA": str(tmp_path / "data"), "RIG_CACHE": str(cache)}
    if kind != "predictor":
        subprocess.run(
            [sys.executable, "-m", "daq.cli.main", "predict", str(rig), "--quiet"], check=True, env=environment
        )
    with recording(rig, environment, *([] if kind == "viewer" else ["--no-view"])) as running:
        if kind == "reader":
            running.get(f"runs/{RUN}/findings")
        running.child(kind).send_signal(number)
        if kind == "reader":
            threading.Thread(target=request_without_response, args=(running,)).start()
        recorded = running.samples()
        wait_until(lambda: running.samples() > recorded + 40_000)
        os.killpg(running.process.pid, signal.SIGINT)
        path = next(path for path in (tmp_path / "data").glob("*.mcap") if path.stem != RUN)
        wait_until(lambda: verify(path).verdict is Verdict.INTACT)
        if kind == "predictor" and number == signal.SIGSTOP:  # the command waits for the map until a further Ctrl-C
            wait_until(lambda: interrupt_again(running.process))
        assert running.process.wait(TIMEOUT) == 130, running.lines
        assert not remaining_processes(running.process.pid), running.lines
    output = "".join(running.lines)
    assert "Traceback" not in output, output[output.index("Traceback") :]


def interrupt_again(process: subprocess.Popen[str]) -> bool:
    """Send a further Ctrl-C; return whether the command has ended."""
    os.killpg(process.pid, signal.SIGINT)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(0.5)
    return process.poll() is not None


def request_without_response(running: Recording) -> None:
    """Request a result of a process that is dead or suspended."""
    with contextlib.suppress(OSError):
        running.get(f"runs/{RUN}/findings")
