"""A run through nidaqmx and gRPC into a file, compared with a direct recording of the simulator."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.signals.blocks import EndReason
from daq.drivers.simulation.card import SimulatedCard
from daq.errors import StoppedError
from daq.session.recording.recorded_run import RecordedRun
from recordings.mcap.reader import RunReader
from tests.daq.conftest import RigFactory
from tests.daq.support.device_server import serving
from tests.daq.support.ni_driver import NiDriver
from tests.daq.support.recording import NoModel, recorded_codes, recording_request, start_recording


def test_run_through_nidaqmx_holds_the_codes_of_the_simulator(rig: RigFactory, tmp_path: Path) -> None:
    simulated = rig()
    direct = start_recording(simulated, folder(tmp_path, "direct"))
    assert direct.wait(60)
    direct.close()
    with serving(NiDriver(lambda: SimulatedCard(simulated))) as server:
        wired = rig(device={"backend": "nidaqmx", "target": server.target})
        run = start_recording(wired, folder(tmp_path, "wire"), duration=1.0)
        assert run.wait(60)
        outcome = run.close()
        assert not server.tasks
    assert outcome.exit_code == 0
    assert outcome.ends[0].reason is EndReason.FINISHED
    got, expected = recorded_codes(run.path), recorded_codes(direct.path)
    assert got.shape[1] >= 20_000
    np.testing.assert_array_equal(got, expected[:, : got.shape[1]])
    with RunReader(run.path) as through_driver, RunReader(direct.path) as direct_run:
        assert through_driver.header.acquisition.device.backend == "nidaqmx"
        same_device = replace(through_driver.header.acquisition, device=direct_run.header.acquisition.device)
        assert same_device == direct_run.header.acquisition


@pytest.mark.parametrize("is_frozen", [True, False])
def test_stop_while_the_device_is_being_opened_leaves_nothing_behind(
    rig: RigFactory, tmp_path: Path, *, is_frozen: bool
) -> None:
    simulated = rig()
    with serving(NiDriver(lambda: SimulatedCard(simulated))) as server:
        wired = rig(device={"backend": "nidaqmx", "target": server.target, "deadline_s": 2.0})
        if is_frozen:
            server.freeze()
        with pytest.raises(StoppedError, match="nothing was recorded") as caught:
            RecordedRun(recording_request(wired, tmp_path), NoModel(), (), lambda: True)
        server.thaw()
        assert not server.tasks
    assert caught.value.exit_code == 130
    assert not list(tmp_path.glob("*.mcap"))


def folder(tmp_path: Path, name: str) -> Path:
    made = tmp_path / name
    made.mkdir()
    return made
