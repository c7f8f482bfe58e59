"""Other programs read a run without this project: public libraries, Foxglove and rerun."""

import importlib.util
import json
import os
import platform
import re
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf.descriptor import FieldDescriptor
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import RunHeader
from analysis.signals.snapshot import Snapshot
from analysis.signals.units import MICROMETRE, RPM
from recordings.mcap import rig_pb2
from recordings.mcap.layout import TOPICS
from recordings.mcap.results import encode_snapshot
from recordings.mcap.writer import RunWriter

MakeBlock = Callable[..., SampleBlock]
CodesOf = Callable[..., NDArray[np.int16]]
DOCS = Path(__file__).resolve().parents[3] / "docs"
VULKAN = Path("/usr/share/vulkan/icd.d") / f"lvp_icd.{platform.machine()}.json"
BLOCK, N_BLOCKS = 1000, 4


@pytest.fixture
def run(tmp_path: Path, header: RunHeader, make_block: MakeBlock, make_snapshot: Callable[..., Snapshot]) -> Path:
    """Return the file of a short run with results."""
    writer = RunWriter(tmp_path / "run.mcap", header)
    for k in range(N_BLOCKS):
        writer.write_block(make_block(0, BLOCK * k, BLOCK))
        for result in encode_snapshot(make_snapshot(0, BLOCK * (k + 1)), header):
            writer.add_result(result)
    writer.write_segment_end(SegmentEnd(0, BLOCK * N_BLOCKS, EndReason.STOPPED))
    writer.close()
    return writer.path


def test_documented_example_reads_speeds_and_displacement(
    run: Path, tmp_path: Path, header: RunHeader, codes_of: CodesOf, make_snapshot: Callable[..., Snapshot]
) -> None:
    (program,) = re.findall(r"```python\n(.*?)```", (DOCS / "format.md").read_text(encoding="utf-8"), re.DOTALL)
    script = tmp_path / "elsewhere" / "read.py"
    script.parent.mkdir()
    no_project_code = "\nassert not {'analysis', 'daq', 'model', 'recordings', 'numpy'} & set(sys.modules)\n"
    script.write_text(program + no_project_code)
    done = subprocess.run(
        [sys.executable, "-I", str(script), str(run)], capture_output=True, text=True, check=False, cwd=script.parent
    )
    assert done.returncode == 0, done.stderr
    rows = [line.split() for line in done.stdout.splitlines()]
    speeds = np.array([row[1:] for row in rows if row[0] == "speed_rpm"], dtype=np.float64)
    expected = [make_snapshot(0, BLOCK * (k + 1)) for k in range(N_BLOCKS)]
    np.testing.assert_array_equal(speeds[:, 0], [snapshot.time for snapshot in expected])
    np.testing.assert_allclose(speeds[:, 1], [snapshot.speed / RPM for snapshot in expected], rtol=1e-14)
    moves = np.array([row[1:] for row in rows if row[0] == "displacement_um"], dtype=np.float64)
    probe = header.acquisition.channels[0]
    np.testing.assert_array_equal(moves[:, 0], np.arange(BLOCK * N_BLOCKS) / header.acquisition.rate)
    displacement = probe.displacement(codes_of(0, 0, BLOCK * N_BLOCKS)[0]) / MICROMETRE
    np.testing.assert_allclose(moves[:, 1], displacement, rtol=1e-12, atol=1e-9)


NUMBERS = {FieldDescriptor.CPPTYPE_DOUBLE, FieldDescriptor.CPPTYPE_FLOAT}


def panels(node: Any) -> Iterator[str]:
    """Yield the panel names of a layout node."""
    if isinstance(node, str):
        yield node
    else:
        yield from panels(node["first"])
        yield from panels(node["second"])


def field_of(path: str) -> FieldDescriptor:
    """Return the field of a message path."""
    topic, _, name = path.removesuffix("[:]").partition(".")
    field: FieldDescriptor = getattr(rig_pb2, TOPICS[topic]).DESCRIPTOR.fields_by_name[name]
    return field


def test_foxglove_layout_plots_existing_fields() -> None:
    layout = json.loads((DOCS / "viewers" / "foxglove.json").read_text(encoding="utf-8"))
    configs = layout["configById"]
    assert sorted(panels(layout["layout"])) == sorted(configs)
    states = configs.pop("StateTransitions!0")
    assert [field_of(line["value"]).cpp_type for line in states["paths"]] == [FieldDescriptor.CPPTYPE_STRING] * 2
    for name, config in configs.items():
        assert name.startswith("Plot!")
        assert config["paths"]
        paths = [line["value"] for line in config["paths"]]
        if config["xAxisVal"] == "timestamp":
            assert "xAxisPath" not in config
        else:
            paths.append(config["xAxisPath"]["value"])
        assert len({path.endswith("[:]") for path in paths}) == 1, "arrays are plotted over arrays"
        assert paths[0].endswith("[:]") == (config["xAxisVal"] == "currentCustom")
        for path in paths:
            assert field_of(path).cpp_type in NUMBERS
            assert field_of(path).is_repeated == path.endswith("[:]")


def test_rounded_fields_for_viewers_match_the_exact_fields(
    make_snapshot: Callable[..., Snapshot], header: RunHeader
) -> None:
    snapshot = make_snapshot(0, 2000)
    assert snapshot.frame is not None
    frame = rig_pb2.OrderFrame.FromString(encode_snapshot(snapshot, header)[0].data)
    np.testing.assert_allclose(frame.spectrum_x_um, np.abs(snapshot.frame.spectrum[0]) / MICROMETRE, rtol=1e-6)
    np.testing.assert_allclose(frame.spectrum_y_um, np.abs(snapshot.frame.spectrum[1]) / MICROMETRE, rtol=1e-6)
    np.testing.assert_allclose([frame.orbit_x_um, frame.orbit_y_um], snapshot.frame.orbit / MICROMETRE, rtol=1e-6)


@contextmanager
def rerun_viewer(program: Path, *files: Path) -> Iterator[Any]:
    """Run rerun's viewer without a screen on files."""
    from rerun.experimental import ViewerClient  # noqa: PLC0415  # only with a viewer

    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    command = [str(program), "--bind", "127.0.0.1", "--port", str(port), "--headless", *map(str, files)]
    environment = os.environ | {"VK_ICD_FILENAMES": str(VULKAN)}
    with subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as running:
        try:
            wait_for(port)
            yield ViewerClient(url=f"rerun+http://127.0.0.1:{port}/proxy")
        finally:
            running.terminate()


def wait_for(port: int) -> None:
    """Wait until the port accepts connections."""
    deadline = time.monotonic() + 60
    while True:
        try:
            socket.create_connection(("127.0.0.1", port), timeout=1).close()
        except OSError:
            assert time.monotonic() < deadline
            time.sleep(0.1)
        else:
            return


@pytest.mark.browser
def test_rerun_plots_a_run_with_the_blueprint(run: Path, tmp_path: Path) -> None:
    if not VULKAN.is_file():
        if os.environ.get("CI"):
            pytest.fail(f"{VULKAN} is missing: install mesa-vulkan-drivers")
        pytest.skip(f"no software Vulkan ({VULKAN}): install mesa-vulkan-drivers")
    spec = importlib.util.find_spec("rerun_cli")
    assert spec is not None
    assert spec.submodule_search_locations is not None
    program = Path(next(iter(spec.submodule_search_locations))) / "rerun"
    converted = tmp_path / "run.rrd"
    command = [str(program), "mcap", "convert", str(run), "--application-id", "rig", "-o", str(converted)]
    subprocess.run(command, check=True, capture_output=True)
    with rerun_viewer(program, converted, DOCS / "viewers" / "rerun.rbl") as viewer:
        deadline = time.monotonic() + 60
        while len(viewer.get_state().views) < 6 and time.monotonic() < deadline:
            time.sleep(0.2)
        views = viewer.get_state().views
        names = ["1X [µm peak]", "1X lag [deg]", "Below 1X [µm peak]", "Gap [V]", "Speed [r/min]"]
        assert sorted(view.name for view in views) == [*names, "Vibration [µm peak-to-peak]"]
        assert [(view.name, view.reports) for view in views if view.reports] == []
