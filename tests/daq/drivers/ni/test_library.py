"""The NI source through the C interface, with a double of NI's library.

The dynamic loader finds the library when the interpreter starts, so the source runs in a separate process.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.daq.support.ni_library import SOURCE, TOOLS, build

PROGRAM = """
import ctypes, json, sys
from pathlib import Path
from analysis.signals.header import Calibration
from analysis.signals.blocks import SampleBlock
from daq.config.rig import Rig
from daq.config.schema import RigConfig
from daq.drivers.ni import open_ni_source

inputs = [("x", "probe_x"), ("y", "probe_y"), ("tacho", "tacho")]
config = RigConfig.model_validate({
    "device": {"backend": "nidaqmx", "serial": "1A2B32"},
    "timing": {"rate_hz": 20_000, "block_s": 0.05},
    "tacho": {"counter": {}},
    "channel": [{"name": n, "role": r, "physical": f"ai{k}"} for k, (n, r) in enumerate(inputs)],
})
calibration = Calibration((0.0, 1e-4), 0.0, 10.0)
source = open_ni_source(Rig(Path("rig.toml"), config, {"x": calibration, "y": calibration}))
items = []
for item in source.blocks():
    items.append(item)
    if len(items) == 7:
        source.stop()
source.close()
acquisition = source.acquisition
json.dump({
    "rate": acquisition.rate, "convert_rate": acquisition.convert_rate, "buffer": acquisition.buffer,
    "serial": acquisition.device.serial,
    "driver": acquisition.device.driver, "scaling": acquisition.channels[0].scaling,
    "alive": ctypes.c_int.in_dll(ctypes.CDLL("libnidaqmx.so.1"), "alive").value,
    "blocks": [[i.segment, i.first_sample, i.backlog, i.codes.tolist()] for i in items if isinstance(i, SampleBlock)],
    "ticks": [[i.segment, i.ticks.tolist()] for i in items if isinstance(i, SampleBlock)],
    "ends": [[i.segment, i.samples, i.reason, i.lost, i.detail] for i in items if not isinstance(i, SampleBlock)],
}, sys.stdout)
"""


pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not all(shutil.which(tool) for tool in TOOLS),
    reason=f"needs Linux with {', '.join(TOOLS)}",
)


def run(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the program with the folder's library instead of NI's."""
    (folder / "libnidaqmx.so").symlink_to("libnidaqmx.so.1")
    environment = os.environ | {"LD_LIBRARY_PATH": str(folder), "NIDAQMX_DOUBLE_WARNS": "1"}
    command = [sys.executable, "-W", "error", "-c", PROGRAM]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The acquisition, blocks and ends read through the double."""
    folder = tmp_path_factory.mktemp("library")
    build(folder / "libnidaqmx.so.1", SOURCE)
    done = run(folder)
    assert done.returncode == 0, done.stderr
    read: dict[str, Any] = json.loads(done.stdout)
    return read | {"printed": done.stderr}


def test_codes_come_through_the_c_interface_bit_for_bit(recorded: dict[str, Any]) -> None:
    first = [block for block in recorded["blocks"] if block[0] == 0]
    codes = np.concatenate([np.array(block[3]) for block in first], axis=1)
    index = np.arange(codes.shape[1])
    expected = (7 * index + 1000 * np.arange(3)[:, np.newaxis]).astype(np.int16)
    np.testing.assert_array_equal(codes, expected)


def test_late_block_is_delivered_and_the_next_follows_without_a_gap(recorded: dict[str, Any]) -> None:
    assert [block[:2] for block in recorded["blocks"]] == [[0, 0], [0, 1000], [0, 2000], [0, 2500], [1, 0], [1, 1000]]
    assert [len(block[3][0]) for block in recorded["blocks"]] == [1000, 1000, 500, 1000, 1000, 1000]
    assert {block[2] for block in recorded["blocks"]} == {42}


def test_stamps_come_through_the_c_interface_with_the_samples_they_belong_to(recorded: dict[str, Any]) -> None:
    ticks = 80e6 / recorded["rate"] * 250 * np.arange(1, 20)
    expected = [np.floor(ticks[:3]), np.floor(ticks[3:7]), np.floor(ticks[7:9]), np.floor(ticks[9:13])]
    assert [stamps for segment, stamps in recorded["ticks"] if segment == 0] == [part.tolist() for part in expected]
    assert [stamps for segment, stamps in recorded["ticks"] if segment == 1] == [part.tolist() for part in expected[:2]]


def test_overrun_has_the_librarys_code_and_text(recorded: dict[str, Any]) -> None:
    (overrun, stopped) = recorded["ends"]
    assert overrun[:4] == [0, 3500, "overrun", 5000]
    assert "the library's text (driver code -200279)" in overrun[4]
    assert stopped == [1, 2000, "stopped", 0, ""]


def test_warning_of_the_library_is_reported_once(recorded: dict[str, Any]) -> None:
    warned = [part for part in recorded["ends"][0][4].split("; ") if part.startswith("the driver warns")]
    assert warned == [
        "the driver warns: too fast to settle (driver code 200011)",
        "the driver warns: read twice (driver code 200060)",
    ]
    assert recorded["printed"] == ""


def test_acquisition_is_read_back_from_the_library(recorded: dict[str, Any]) -> None:
    assert recorded["rate"] == 20_000.25
    assert recorded["convert_rate"] == 90_000.0
    assert recorded["buffer"] == 8 * 20_000
    assert recorded["scaling"] == [6e-4, 3.2e-4, 1.4e-13, -7.1e-18]
    assert (recorded["serial"], recorded["driver"]) == ("1A2B32", "NI-DAQmx 24.0.0")


def test_no_task_is_left_in_the_library(recorded: dict[str, Any]) -> None:
    assert recorded["alive"] == 0


def test_library_without_a_function_is_too_old(tmp_path: Path) -> None:
    build(tmp_path / "libnidaqmx.so.1", SOURCE, "-DOLD")
    done = run(tmp_path)
    assert "daq.errors.DeviceError: the NI-DAQmx driver on this machine is too old" in done.stderr
    assert "DAQmxSetTrigAttribute" in done.stderr


def test_library_that_does_not_load_is_a_driver_error(tmp_path: Path) -> None:
    needed = tmp_path / "libneeded.so"
    build(needed, SOURCE)
    build(tmp_path / "libnidaqmx.so.1", SOURCE, "-Wl,--no-as-needed", needed)
    needed.unlink()
    done = run(tmp_path)
    assert "daq.errors.DeviceError: NI-DAQmx: libneeded.so: cannot open shared object file" in done.stderr
