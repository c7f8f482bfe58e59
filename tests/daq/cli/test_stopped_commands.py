"""Every command ends whenever it is asked to: with its exit code, without a word, and with nothing left."""

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

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="signals of POSIX, and processes as Linux tells of them"
)

LIMITS = {"speed_rpm": 4000.0}
STILL = {"pace": "real time", "profile": [{"time_s": t, "speed_rpm": 3000.0} for t in (0.0, 60.0)]}
ROUNDS = 25
NOISE = ("Traceback", "Exception ignored", "KeyboardInterrupt", "Error", "leaked", "Warning", "fatal", "Fatal")


@dataclass(frozen=True, slots=True)
class Place:
    """Where commands are tried: a rig, a run, and a cache that knows the rig's model."""

    folder: Path
    rig: Path
    run: Path
    environment: dict[str, str]

    def arguments(self, command: str, folder: Path) -> list[str]:
        """Return a command that does something for some seconds, and writes into a folder if anywhere."""
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
        """Return the environment: a data folder of its own, and for what computes the model an empty cache."""
        own = {"RIG_DATA": str(folder / "data")}
        return self.environment | own | ({"RIG_CACHE": str(folder / "cache")} if command == "predict" else {})


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Place:
    folder = tmp_path_factory.mktemp("place")
    for name in ("probe-x.toml", "probe-y.toml"):
        (folder / name).write_text(to_toml({"calibration": CALIBRATION}), encoding="utf-8")
    rig, quick = folder / "rig.toml", folder / "quick.toml"
    rig.write_text(to_toml(merged(TABLES, {"simulation": STILL, "limits": LIMITS})), encoding="utf-8")
    quick.write_text(to_toml(merged(TABLES, {"limits": LIMITS})), encoding="utf-8")
    (folder / "runs").mkdir()
    environment = dict(os.environ) | {"RIG_CACHE": str(tmp_path_factory.getbasetemp() / "cache")}
    run = record_run(load_rig(quick), folder / "runs", RUN)
    return Place(folder, rig, run, environment)


def drawn(chance: random.Random) -> StopRequest:
    """Draw how a command is asked for its end."""
    again = chance.choice((None, chance.uniform(0.0, 0.3), chance.uniform(0.0, 3.0)))
    number = chance.choice((signal.SIGINT, signal.SIGTERM))
    return StopRequest(number, chance.uniform(0.0, 4.0), again, chance.random() < 0.3)


def check(command: str, left: StoppedCommand, folder: Path) -> None:
    """See to it that a command was ended as it should be."""
    assert left.code in ({0} if command == "serve" else {0, 130}) | {130}, left
    assert not any(word in left.err for word in NOISE), left
    assert not left.processes, left
    assert not [path for path in folder.rglob("*") if ".part" in path.suffixes], left
    for path in folder.glob("data/*.mcap"):
        assert verify(path).verdict is Verdict.SOUND, left
    results = {"thesis": "thesis.html", "sweep": "sweep.parquet", "export": "samples.csv"}
    if command in results:
        assert (folder / results[command]).exists() == (left.code == 0), left


def tried(place: Place, command: str, seed: int, folder: Path) -> StoppedCommand:
    """Try a command with a seed, and check what became of it."""
    folder.mkdir()
    asked = drawn(random.Random(f"{command} {seed}"))  # noqa: S311 - reproducible on purpose
    left = run_and_stop(place.arguments(command, folder), place.environment_for(command, folder), folder, asked)
    try:
        check(command, left, folder)
    except AssertionError as error:
        raise AssertionError(f"seed {seed}, {asked}: {error}") from None
    return left


COMMANDS = ("record", "record shortly", "replay", "serve", "predict", "thesis", "sweep", "export", "index", "verify")


def test_command_that_is_asked_to_end_while_it_is_loaded_ends_without_a_word(place: Place, tmp_path: Path) -> None:
    left = run_and_stop(
        place.arguments("export", tmp_path), place.environment, tmp_path, StopRequest(signal.SIGTERM, 0.0, 0.05)
    )
    check("export", left, tmp_path)
    assert (left.code, left.out, left.err) == (130, "", "")


def test_request_for_the_end_is_noted_then_interrupts_and_is_passed_over_while_the_command_tidies_up() -> None:
    handler = _StopSignalHandler()
    handler(signal.SIGTERM, None)
    assert handler.is_stop_received
    handler.is_interrupting = True
    with pytest.raises(KeyboardInterrupt):
        handler(signal.SIGINT, None)
    handler(signal.SIGINT, None)


def test_terminal_that_closes_does_not_end_what_was_begun_with_nohup() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert signal.SIGHUP not in stop_signals()
    finally:
        signal.signal(signal.SIGHUP, before)
    assert {signal.SIGHUP, signal.SIGINT, signal.SIGTERM} <= set(stop_signals())


@pytest.mark.campaign
@pytest.mark.parametrize("command", COMMANDS)
def test_command_ends_at_any_moment_tidily_and_without_a_word(command: str, place: Place, tmp_path: Path) -> None:
    failed, longest, codes = [], 0.0, []
    for seed in range(int(os.environ.get("ROUNDS", ROUNDS))):
        try:
            left = tried(place, command, seed, tmp_path / str(seed))
        except AssertionError as error:
            failed.append(str(error))
            continue
        longest = max(longest, left.stop_time)
        codes.append(left.code)
    print(f"\n{command}: {len(codes)} times, {codes.count(130)} of them stopped, the longest end {longest:.1f} s")
    assert not failed, "\n\n".join(failed)
