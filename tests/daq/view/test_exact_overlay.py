"""The overlay at exactly the speed at which the shaft stays, on its way to the operator."""

import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from analysis.signals.units import RPM
from daq.drivers.replay import ReplaySource
from daq.schemas.live import live_schema
from daq.session.predictor import Predictor
from daq.session.replayed_run import ReplayedRun
from daq.view.status import details
from model.rotor.gj90c import gj90c
from recordings.mcap.reader import RunReader
from tests.daq.conftest import RigFactory
from tests.daq.support.live_updates import make_live_updates
from tests.daq.support.recorded_bench import record_run

SPEED = 520.0  # rad/s


def test_updates_at_steady_speed_have_exact_prediction(rig: RigFactory, tmp_path: Path) -> None:
    rpm = SPEED / RPM
    steady = [{"time_s": 0.0, "speed_rpm": rpm}, {"time_s": 2.0, "speed_rpm": rpm}]
    path = record_run(rig(simulation={"profile": steady}), tmp_path)
    with RunReader(path) as reader:
        header = reader.header
    with closing(Predictor(gj90c(), header.settings, np.array([500.0, 526.0, 552.0]), tmp_path)) as model:
        assert model.wait(60.0) is not None
        end = time.monotonic() + 60.0
        while (known := model.at(SPEED)) is None or not known.is_exact:
            assert time.monotonic() < end
            time.sleep(0.01)
        replayed = ReplayedRun(header, ReplaySource(path, None), model)
        assert replayed.wait(30.0)
        with closing(replayed):
            document = live_schema(replayed.latest())
    assert document.predicted is not None
    assert document.measured is not None
    assert document.predicted.is_exact
    assert document.predicted.speed_rpm is not None
    assert document.measured.speed_rpm is not None
    assert abs(document.predicted.speed_rpm - document.measured.speed_rpm) < 1e-3 * rpm


def test_details_state_whether_prediction_is_exact() -> None:
    update = make_live_updates(60)[-1]
    assert update.prediction is not None
    assert "model: ready; interpolated; oil film" in details(update)
    exact = replace(update, prediction=replace(update.prediction, is_exact=True, speed=400 * np.pi))
    assert "model: ready; exact at 12,000 r/min; oil film" in details(exact)
