"""Every command shuts down cleanly on a signal: exit code 130, no error output, nothing left behind."""

import os
import random
import signal
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from daq.cli.main import _StopSignalHandler
from daq.config.loader import load_rig
from daq.config.toml_files import to_toml
from daq.stop_flag import stop_signals
from recordings.integrity.verify import Verdict, verify
from tests.daq.conftest import CALIBRATION, TABLES, merged
from tests.daq.support.commands import StoppedCommand, StopRequest, run_and_stop
from tests.daq.support.recorded_bench import RUN, record_run

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="POSIX signals and /proc")

LIMITS = {"speed_rpm": 4000.0}
STEADY = {"pace": "real time", "profile": [{"time_s": t, "speed_rpm": 3000.0} for t in (0.0, 60.0)]}
ROUNDS = 25
ERROR_WORDS = ("Traceback", "Exception ignored", "KeyboardInterrupt", "Error", "leaked", "Warning", "fatal", "Fatal")


@dataclass(frozen=True, slots=True)
class Place:
    """A rig file, a recorded run and a prediction cache to run commands with."""

    folder: Path
    rig: Path
    run: Path
    environment: dict[str, str]

    def arguments(self, command: str, folder: Path) -> list[str]:
        """Return the arguments of a command that takes seconds and writes only into a folder."""
        sweep = [
            "--vary",
            "viscosity_pa_s=0.005:0.035:7",
            "--vary",
            "imbalance_kg_m=2.5e-7,5e-7",
            "--quantity",
            "onset",
        ]
        screens = ["--no-view", "--port", "0"]
        return {
            "record": ["record", str(self.rig), *screens],
            "record shortly": ["record", str(self.rig), *screens, "--for", "1s"],
            "replay": ["replay", str(self.run), *screens],
            "serve": ["serve", str(self.rig), "--port", "0"],
            "predict": ["predict", str(self.rig)],
            "thesis": ["model", "thesis", "-o", str(folder)],
            "sweep": ["model", "sweep", *sweep, "-o", str(folder / "sweep.parquet")],
            "export": ["export", str(self.run), "--to", str(folder / "samples.csv")],
            "index": ["index", "--verify", "--folder", str(self.run.parent)],
            "verify": ["verify", str(self.run)],
        }[command]

    def environment_for(self, command: str, folder: Path) -> dict[str, str]:
        """Return the environment with an own data folder; `predict` also gets an empty cache."""
        own = {"RIG_DATA": str(folder / "data")}
        return self.environment | own | ({"RIG_CACHE": str(folder / "cache")} if command == "predict" else {})


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Place:
    folder = tmp_path_factory.mktemp("place")
    for name in ("probe-x.toml", "probe-y.toml"):
        (folder / name).write_text(to_toml({"calibration": CALIBRATION}), encoding="utf-8")
    rig, quick = folder / "rig.toml", folder / "quick.toml"
    rig.write_text(to_toml(merged(TABLES, {"simulation": STEADY, "limits": LIMITS})), encoding="utf-8")
    quick.write_text(to_toml(merged(TABLES, {"limits": LIMITS})), encoding="utf-8")
    (folder / "runs").mkdir()
    environment = dict(os.environ) | {"RIG_CACHE": str(tmp_path_factory.getbasetemp() / "cache")}
    run = record_run(load_rig(quick), folder / "runs", RUN)
    return Place(folder, rig, run, environment)


def random_request(chance: random.Random) -> StopRequest:
    """Return a random stop request."""
    repeat_after = chance.choice((None, chance.uniform(0.0, 0.3), chance.uniform(0.0, 3.0)))
    number = chance.choice((signal.SIGINT, signal.SIGTERM))
    return StopRequest(number, chance.uniform(0.0, 4.0), repeat_after, chance.random() < 0.3)


def check(command: str, stopped: StoppedCommand, folder: Path) -> None:
    """Assert that a stopped command left nothing behind and exited correctly."""
    assert stopped.code in ({0} if command == "serve" else {0, 130}) | {130}, stopped
    assert not any(word in stopped.err for word in ERROR_WORDS), stopped
    assert not stopped.processes, stopped
    assert not [path for path in folder.rglob("*") if ".part" in path.suffixes], stopped
    for path in folder.glob("data/*.mcap"):
        assert verify(path).verdict is Verdict.INTACT, stopped
    results = {"thesis": "thesis.html", "sweep": "sweep.parquet", "export": "samples.csv"}
    if command in results:
        assert (folder / results[command]).exists() == (stopped.code == 0), stopped


def run_and_check(place: Place, command: str, seed: int, folder: Path) -> StoppedCommand:
    """Run a command, stop it by a request drawn from a seed, and check the result."""
    folder.mkdir()
    request = random_request(random.Random(f"{command} {seed}"))  # noqa: S311 - reproducible on purpose
    stopped = run_and_stop(place.arguments(command, folder), place.environment_for(command, folder), folder, request)
    try:
        check(command, stopped, folder)
    except AssertionError as error:
        raise AssertionError(f"seed {seed}, {request}: {error}") from None
    return stopped


COMMANDS = ("record", "record shortly", "replay", "serve", "predict", "thesis", "sweep", "export", "index", "verify")


def test_command_stopped_during_import_prints_nothing(place: Place, tmp_path: Path) -> None:
    stopped = run_and_stop(
        place.arguments("export", tmp_path), place.environment, tmp_path, StopRequest(signal.SIGTERM, 0.0, 0.05)
    )
    check("export", stopped, tmp_path)
    assert (stopped.code, stopped.out, stopped.err) == (130, "", "")


def test_signal_is_recorded_then_interrupts_and_is_ignored_during_clean_up() -> None:
    handler = _StopSignalHandler()
    handler(signal.SIGTERM, None)
    assert handler.is_stop_received
    handler.is_interrupting = True
    with pytest.raises(KeyboardInterrupt):
        handler(signal.SIGINT, None)
    handler(signal.SIGINT, None)


def test_closed_terminal_does_not_stop_a_command_under_nohup() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert signal.SIGHUP not in stop_signals()
    finally:
        signal.signal(signal.SIGHUP, before)
    assert {signal.SIGHUP, signal.SIGINT, signal.SIGTERM} <= set(stop_signals())


@pytest.mark.campaign
@pytest.mark.parametrize("command", COMMANDS)
def test_command_shuts_down_cleanly_at_any_time(command: str, place: Place, tmp_path: Path) -> None:
    failed, longest, codes = [], 0.0, []
    for seed in range(int(os.environ.get("ROUNDS", ROUNDS))):
        try:
            stopped = run_and_check(place, command, seed, tmp_path / str(seed))
        except AssertionError as error:
            failed.append(str(error))
            continue
        longest = max(longest, stopped.stop_time)
        codes.append(stopped.code)
    print(f"\n{command}: {len(codes)} times, {codes.count(130)} stopped, slowest shutdown {longest:.1f} s")
    assert not failed, "\n\n".join(failed)
