"""The simulated bench as the benchmarks record it, and a service's source of its live run."""

import time
from pathlib import Path

from daq.config.loader import load_rig
from daq.config.rig import Rig
from daq.session.live_update import LiveUpdate
from daq.session.recording.recorded_run import RecordedRun
from daq.session.recording.recorder import RecordingRequest
from tests.daq.support.service_fakes import FakeLive

RIG_FILE = Path(__file__).parents[2] / "rigs" / "bench.toml"
RUN = "2026-11-24T09-12-07-gj90c"


def rig_with(folder: Path, *changes: tuple[str, str]) -> Rig:
    """Return the simulated bench with texts of its file replaced."""
    text = RIG_FILE.read_text(encoding="utf-8").replace('"calibration/', f'"{RIG_FILE.parent.as_posix()}/calibration/')
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "rig.toml"
    path.write_text(text, encoding="utf-8")
    return load_rig(path)


def request_for(rig: Rig, folder: Path, run: str = RUN, duration: float | None = None) -> RecordingRequest:
    """Return the request to record a run into a folder, for a duration in s."""
    return RecordingRequest(rig, run, time.time_ns(), "", "rig bench", folder / f"{run}.mcap", duration)


class LiveRun(FakeLive):
    """The live run of a service; None until it has started."""

    run: RecordedRun | None = None

    def latest(self) -> LiveUpdate | None:
        return None if self.run is None else self.run.latest()
