"""Recordings of a small simulated rig, and what tests read of them while they run and afterwards."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import SampleBlock
from daq.config.rig import Rig
from daq.session.live_update import LiveUpdate, RunState, Status
from daq.session.predictor import Predictor
from daq.session.recording.recorded_run import RecordedRun
from daq.session.recording.recorder import RecordingRequest
from model.prediction.prediction_map import Prediction
from recordings.mcap.reader import RunReader

RUN = "2026-11-24T09-12-07-test-rig"
REAL_TIME = {"pace": "real time"}  # [simulation] of a rig that delivers samples as slowly as a card


class NoModel(Predictor):
    """A model without a prediction."""

    state = "off"

    def __init__(self) -> None:
        pass

    def at(self, _speed: float) -> Prediction | None:
        return None


class UpdateList:
    """Collects live updates; may stall at each, as no view should."""

    def __init__(self, stall: float = 0.0) -> None:
        self.updates: list[LiveUpdate] = []
        self._stall = stall

    def offer(self, update: LiveUpdate) -> None:
        self.updates.append(update)
        time.sleep(self._stall)


def recording_request(rig: Rig, folder: Path, *, duration: float | None = None) -> RecordingRequest:
    """Return a request to record the run ``RUN`` of a rig into a folder."""
    return RecordingRequest(
        rig=rig, run=RUN, started_ns=1_795_000_000_000_000_000, note="", program="rig test",
        path=folder / f"{RUN}.mcap", duration=duration,
    )  # fmt: skip


def start_recording(
    rig: Rig, folder: Path, updates: UpdateList | None = None, *, duration: float | None = None
) -> RecordedRun:
    """Start recording a rig into a folder; the caller closes the run."""
    return RecordedRun(recording_request(rig, folder, duration=duration), NoModel(), [updates or UpdateList()])


def recorded_codes(path: Path) -> NDArray[np.int16]:
    """Return all codes in a run's file, shape (n_channels, n_samples)."""
    with RunReader(path) as reader:
        return np.hstack([item.codes for item in reader.items() if isinstance(item, SampleBlock)])


def wait_until(condition: Callable[[], bool], timeout: float = 60.0) -> None:
    """Wait until a condition holds; fail after the timeout, s."""
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def wait_for_state(run: RecordedRun, timeout: float, state: RunState) -> Status:
    """Wait until a run is in a state; return its status then."""
    deadline = time.monotonic() + timeout
    while (status := run.latest().status).state is not state:
        assert time.monotonic() < deadline, status
        time.sleep(0.01)
    return status
