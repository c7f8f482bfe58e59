"""A process beside a recording that stands still or dies: it goes on, ends when asked to, and its file is whole."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import psutil
import pytest

from daq.config.loader import load_rig
from recordings.integrity.verify import Verdict, verify
from tests.daq.support.commands import TIMEOUT, remaining_processes
from tests.daq.support.recorded_bench import RUN, record_run

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="signals of POSIX, and processes as Linux tells of them"),
    pytest.mark.campaign,
]

RigFiles = Callable[..., Path]
STILL = {"pace": "real time", "profile": [{"time_s": t, "speed_rpm": 3000.0} for t in (0.0, 600.0)]}
NICE = {"predictor": 5, "refiner": 10, "reader": 15}
"""How far each has given way, which tells it from the others."""


@dataclass(frozen=True, slots=True)
class Recording:
    """The command while it records."""

    process: subprocess.Popen[str]
    told: list[str]

    @property
    def address(self) -> str:
        """The address of its page, as soon as it is told."""
        pattern = re.compile(r"page (http://[\d.:]+)")
        until(lambda: any(pattern.search(line) for line in self.told))
        return next(found[1] for line in self.told if (found := pattern.search(line)))

    def asked(self, tail: str) -> dict[str, object]:
        """Return the answer of an address."""
        with urllib.request.urlopen(f"{self.address}/api/v1/{tail}", timeout=TIMEOUT) as answer:  # noqa: S310 - loopback
            document: dict[str, object] = json.load(answer)
        return document

    def samples(self) -> int:
        """Return the samples per channel that are recorded."""
        status = self.asked("live")["status"]
        assert isinstance(status, dict)
        return int(status["samples"])

    def child(self, kind: str) -> psutil.Process:
        """Wait for a process beside the recording, and return it."""
        found: list[psutil.Process] = []

        def is_there() -> bool:
            for child in psutil.Process(self.process.pid).children():
                with contextlib.suppress(psutil.NoSuchProcess):
                    is_lender = "serve_web_viewer" in " ".join(child.cmdline())
                    if is_lender if kind == "viewer" else child.nice() == os.nice(0) + NICE[kind]:
                        found.append(child)
            return bool(found)

        until(is_there)
        return found[0]


def until(said: Callable[[], bool]) -> None:
    end = time.monotonic() + TIMEOUT
    while not said():
        assert time.monotonic() < end
        time.sleep(0.01)


@contextlib.contextmanager
def recording(rig: Path, environment: dict[str, str], *options: str) -> Iterator[Recording]:
    command = [sys.executable, "-m", "daq.cli.main", "record", str(rig), "--port", "0", *options]
    process = subprocess.Popen(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    told: list[str] = []
    assert process.stderr is not None
    listening = threading.Thread(target=told.extend, args=(process.stderr,))
    listening.start()
    try:
        yield Recording(process, told)
    finally:
        process.kill()
        process.wait()
        listening.join(TIMEOUT)
        process.stderr.close()


@pytest.mark.parametrize("number", [signal.SIGSTOP, signal.SIGKILL], ids=["stands still", "dies"])
@pytest.mark.parametrize("kind", [*NICE, "viewer"])
def test_recording_goes_on_and_ends_whole_whatever_becomes_of_a_process_beside_it(
    kind: str, number: signal.Signals, rig_file: RigFiles, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    (tmp_path / "data").mkdir()
    record_run(load_rig(rig_file()), tmp_path / "data")
    rig = rig_file(simulation=STILL, limits={"speed_rpm": 20_000.0 if kind == "predictor" else 4000.0})
    cache = tmp_path / "cache" if kind == "predictor" else tmp_path_factory.getbasetemp() / "cache"
    environment = dict(os.environ) | {"RIG_DATA": str(tmp_path / "data"), "RIG_CACHE": str(cache)}
    if kind != "predictor":
        subprocess.run(
            [sys.executable, "-m", "daq.cli.main", "predict", str(rig), "--quiet"], check=True, env=environment
        )
    with recording(rig, environment, *([] if kind == "viewer" else ["--no-view"])) as made:
        if kind == "reader":
            made.asked(f"runs/{RUN}/order-vectors")
        made.child(kind).send_signal(number)
        if kind == "reader":
            threading.Thread(target=asked_in_vain, args=(made,)).start()
        recorded = made.samples()
        until(lambda: made.samples() > recorded + 40_000)
        os.killpg(made.process.pid, signal.SIGINT)
        path = next(path for path in (tmp_path / "data").glob("*.mcap") if path.stem != RUN)
        until(lambda: verify(path).verdict is Verdict.SOUND)
        if kind == "predictor" and number == signal.SIGSTOP:  # its map is waited for, until this is enough
            until(lambda: ends_when_asked(made.process))
        assert made.process.wait(TIMEOUT) == 130, made.told
        assert not remaining_processes(made.process.pid), made.told
    told = "".join(made.told)
    assert "Traceback" not in told, told[told.index("Traceback") :]


def ends_when_asked(process: subprocess.Popen[str]) -> bool:
    """Ask for the end as the operator does who has no patience; return whether it has come."""
    os.killpg(process.pid, signal.SIGINT)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(0.5)
    return process.poll() is not None


def asked_in_vain(made: Recording) -> None:
    """Ask for what a process makes that is no longer there, or stands still."""
    with contextlib.suppress(OSError):
        made.asked(f"runs/{RUN}/order-vectors")
