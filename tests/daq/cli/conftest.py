"""Fixtures of the commands on recorded runs: a data folder and a run in it."""

import os
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from daq.config.rig import Rig
from daq.drivers.factory import open_source
from daq.session.recording.recorder import RecordingRequest, run_header
from recordings.mcap.writer import write_run
from tests.daq.support.recorded_bench import RUN

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
    """Return the file of a run of 2 s at 6000 r/min, with the note "cold oil"."""
    path, loaded = folder / f"{RUN}.mcap", rig()
    request = RecordingRequest(
        rig=loaded, run=RUN, started_ns=STARTED_NS, note="cold oil", program="rig", path=path, duration=None
    )
    with closing(open_source(loaded)) as source:
        write_run(path, run_header(request, source), source.blocks(), {})
    os.utime(path, (1_795_511_530, 1_795_511_530))
    return path
