"""Results of a recorded run over REST, compared with the library."""

import gzip
import io
import re
from collections.abc import Iterator
from contextlib import closing
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from analysis.live.summary import RunSummary
from analysis.signals.header import Role
from analysis.signals.snapshot import Snapshot
from analysis.signals.units import MICROMETRE, RPM
from daq.config.loader import load_rig
from daq.config.toml_files import to_toml
from daq.schemas.summary import summary_schema
from daq.schemas.units import micrometres, rpm
from daq.session.live_update import RunState
from daq.session.offline import summarise
from recordings.mcap.reader import RunReader
from tests.daq.conftest import CALIBRATION, TABLES, merged
from tests.daq.support.live_updates import make_live_updates
from tests.daq.support.recorded_bench import API, RUN, DefectiveModel, RecordedBench, open_recorded_bench, record_run

PROFILE = [{"time_s": 0.0, "speed_rpm": 3000.0}, {"time_s": 4.0, "speed_rpm": 9000.0}]


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RecordedBench]:
    folder = tmp_path_factory.mktemp("data")
    for name in ("probe-x.toml", "probe-y.toml"):
        (folder / name).write_text(to_toml({"calibration": CALIBRATION}), encoding="utf-8")
    (folder / "rig.toml").write_text(to_toml(merged(TABLES, {"simulation": {"profile": PROFILE}})), encoding="utf-8")
    record_run(load_rig(folder / "rig.toml"), folder)
    served = open_recorded_bench(folder)
    yield served
    served.close()


@pytest.fixture(scope="module")
def path(bench: RecordedBench) -> Path:
    return bench.folder / f"{RUN}.mcap"


@pytest.fixture(scope="module")
def summary(path: Path) -> RunSummary:
    with RunReader(path) as reader:
        return summarise(reader)


@pytest.fixture(scope="module")
def snapshots(path: Path) -> list[Snapshot]:
    with RunReader(path) as reader:
        return list(reader.snapshots())


def get_json(bench: RecordedBench, tail: str, **parameters: str | float) -> Any:
    response = bench.get(tail, **parameters)
    assert response.status_code == 200, response.text
    return response.json()


def problem(bench: RecordedBench, tail: str, **parameters: str | float) -> tuple[int, str]:
    response = bench.get(tail, **parameters)
    assert response.headers["content-type"] == "application/problem+json"
    return response.status_code, response.json()["type"].removeprefix("/docs#")


def recorded(bench: RecordedBench, kind: str, **parameters: str | float) -> tuple[Any, Any]:
    """Return columns and single values of an analysis as recorded."""
    document = get_json(bench, f"/analyses/{kind}", source="recorded", **parameters)
    return document["columns"], document["scalars"]


def test_vectors_and_findings_equal_those_of_library_and_command_line(
    bench: RecordedBench, summary: RunSummary
) -> None:
    expected = summary_schema(summary).model_dump(mode="json")
    assert len(expected["by_speed"]) > 20
    for order in (1, 2):
        columns, _ = recorded(bench, "bode", order=order)
        assert columns["ramp_direction"] == [row["ramp_direction"] for row in expected["by_speed"]]
        assert columns["speed_rpm"] == pytest.approx([row["speed_rpm"] for row in expected["by_speed"]], abs=1e-4)
        assert columns["frames"] == [row["frames"] for row in expected["by_speed"]]
        for name in ("amplitude_peak_x_um", "amplitude_peak_y_um", "lag_x_deg", "lag_y_deg"):
            values = [row[f"order_{order}x"][name] for row in expected["by_speed"]]
            assert columns[name] == pytest.approx(values, abs=1e-4)
        assert recorded(bench, "polar", order=order)[0] == columns
    assert get_json(bench, "/findings")["sub_synchronous"] == expected["sub_synchronous"]
    served = get_json(bench, "/summary")
    assert served["by_speed"] == expected["by_speed"]


def test_order_spectrum_at_a_time_equals_the_recorded_frame(bench: RecordedBench, snapshots: list[Snapshot]) -> None:
    snapshot = next(each for each in snapshots if each.time == 2.0)
    frame = snapshot.frame
    assert frame is not None
    columns, scalars = recorded(bench, "order-spectrum", time_s=2.04)
    assert scalars["sample"] == snapshot.sample
    assert scalars["speed_rpm"] == pytest.approx(frame.speed / RPM, rel=1e-8)
    assert columns["amplitude_peak_y_um"] == pytest.approx(np.abs(frame.spectrum[1]) / MICROMETRE, rel=1e-8)
    assert columns["order"] == frame.orders.tolist()


def test_orbit_at_a_speed_equals_that_of_the_nearest_frame(bench: RecordedBench, snapshots: list[Snapshot]) -> None:
    frames = [each.frame for each in snapshots if each.frame is not None]
    nearest = min(frames, key=lambda frame: abs(frame.speed - 5000.0 * RPM))
    columns, scalars = recorded(bench, "orbit", speed_rpm=5000.0)
    assert scalars["speed_rpm"] == pytest.approx(nearest.speed / RPM, rel=1e-8)
    assert columns["X_um"] == pytest.approx(nearest.orbit[0] / MICROMETRE, rel=1e-8, abs=1e-8)
    assert columns["angle_deg"].count(0.0) == columns["revolution"][-1] + 1


def test_frame_without_time_and_speed_is_that_of_the_maximum_vibration(
    bench: RecordedBench, snapshots: list[Snapshot]
) -> None:
    largest = max((s for s in snapshots if s.frame is not None), key=lambda s: s.peak_to_peak.max())
    assert recorded(bench, "orbit")[1]["sample"] == largest.sample


def test_full_spectrum_of_a_forward_orbit_peaks_at_plus_1x(bench: RecordedBench) -> None:
    columns, _ = recorded(bench, "full-spectrum", speed_rpm=8000.0)
    largest = int(np.argmax(columns["amplitude_peak_um"]))
    assert columns["order"][largest] == 1.0
    minus = columns["order"].index(-1.0)
    assert columns["amplitude_peak_um"][minus] < columns["amplitude_peak_um"][largest]
    assert columns["uncertain"][largest] == "no"


@pytest.mark.parametrize(
    ("kind", "parameters", "refused"),
    [
        ("orbit", {"source": "recorded", "revolutions": 8, "filter": "direct"}, ["filter", "revolutions"]),
        ("cascade", {"source": "recorded", "segment": 0}, ["segment"]),
        ("cascade", {"source": "recorded", "lines": "frequencies"}, ["lines"]),
        ("cascade", {"rows": 20, "columns": 20}, ["columns", "rows"]),
        ("waterfall", {"columns": 20}, ["columns"]),
        ("average", {"source": "recorded"}, ["source"]),
    ],
)
def test_parameters_of_the_other_source_are_refused(
    bench: RecordedBench, kind: str, parameters: dict[str, str | float], refused: list[str]
) -> None:
    response = bench.get(f"/analyses/{kind}", **parameters)
    assert response.status_code == 422
    assert [fault["parameter"] for fault in response.json()["faults"]] == [f"query.{name}" for name in refused]


def test_decimated_trend_preserves_extremes(bench: RecordedBench, snapshots: list[Snapshot]) -> None:
    every = get_json(bench, "/trend")
    assert every["results_per_entry"] == 1
    assert every["peak_to_peak_max_x_um"] == [micrometres(s.peak_to_peak[0]) for s in snapshots]
    few = get_json(bench, "/trend", entries=5)
    assert len(few["time_s"]) == 5
    for name, pick in (("min", min), ("max", max)):
        for what in (f"peak_to_peak_{name}_x_um", f"order_1x_{name}_y_um"):
            assert pick(v for v in few[what] if v is not None) == pick(v for v in every[what] if v is not None)
    part = get_json(bench, "/trend", from_s=1.0, duration_s=1.0)
    assert (part["time_s"][0], part["time_s"][-1]) == (1.0, 2.0)
    assert get_json(bench, "/trend", segment=7)["time_s"] == []


def test_cascade_has_screen_size_and_preserves_the_maximum(bench: RecordedBench, snapshots: list[Snapshot]) -> None:
    columns, _ = recorded(bench, "cascade", rows=20, columns=16)
    assert len(set(columns["speed_rpm"])) <= 20
    assert len(set(columns["order"])) <= 16
    assert len(columns["amplitude_peak_um"]) == len(set(columns["speed_rpm"])) * len(set(columns["order"]))
    largest = max(np.abs(s.frame.spectrum).max() for s in snapshots if s.frame is not None)
    assert max(columns["amplitude_peak_um"]) == pytest.approx(largest / MICROMETRE)


def test_waterfall_has_its_times_and_preserves_the_maximum(bench: RecordedBench, snapshots: list[Snapshot]) -> None:
    columns, _ = recorded(bench, "waterfall", from_s=1.0, duration_s=2.0, rows=10, columns=64)
    assert columns["time_s"] == sorted(columns["time_s"])
    assert columns["speed_rpm"] == sorted(columns["speed_rpm"]), "the shaft runs up"
    assert 1.0 < columns["time_s"][0] < columns["time_s"][-1] < 3.0
    frames = [s.frame for s in snapshots if s.frame is not None and 1.0 <= s.time <= 3.0]
    largest = max(np.abs(frame.spectrum).max() for frame in frames)
    assert max(columns["amplitude_peak_um"]) == pytest.approx(largest / MICROMETRE)


@pytest.mark.parametrize("kind", ["cascade", "waterfall"])
def test_full_spectra_over_speed_and_time_show_the_whirl_direction(bench: RecordedBench, kind: str) -> None:
    columns, _ = recorded(bench, kind, lines="full", rows=5, columns=512, highest_order=3.0)
    orders = sorted(set(columns["order"]))
    assert (min(orders), max(orders)) == (-3.0, 3.0)
    row = columns["amplitude_peak_um"][-len(orders) :]
    assert row[orders.index(1.0)] == max(row)
    assert row[orders.index(-1.0)] < row[orders.index(1.0)]


def test_samples_equal_the_file_in_every_format_and_unit(bench: RecordedBench, path: Path) -> None:
    with RunReader(path) as reader:
        codes, channels = reader.samples(0, 20_000, 20_200), reader.header.acquisition.channels
        x = channels[reader.header.acquisition.row(Role.PROBE_X)]
    stretch: dict[str, str | float] = {"from_s": 1.0, "duration_s": 0.01}
    document = get_json(bench, "/samples", **stretch, unit="codes")
    assert (document["first_sample"], document["samples"], document["rate_hz"]) == (20_000, 200, 20_000.0)
    assert [channel["values"] for channel in document["channels"]] == codes.tolist()
    archive = np.load(io.BytesIO(bench.get("/samples", **stretch, format="npz").content))
    np.testing.assert_array_equal(archive["channel:x"], x.displacement(codes[0]) / MICROMETRE)
    assert dict(archive["about"].tolist())["unit:x"] == "µm"
    arrow = bench.get("/samples", {"Accept": "application/vnd.apache.arrow.stream"}, **stretch, unit="volts")
    ipc: Any = import_module("pyarrow.ipc")
    table = ipc.open_stream(arrow.content).read_all()
    np.testing.assert_array_equal(table["tacho"].to_numpy(), channels[2].volts(codes[2]))


@pytest.mark.parametrize(
    ("tail", "parameters", "expected"),
    [
        ("/analyses/orbit", {"source": "recorded", "time_s": 400.0}, (404, "no-data")),
        ("/analyses/orbit", {"source": "recorded", "speed_rpm": 40_000.0}, (404, "no-data")),
        ("/analyses/orbit", {"source": "recorded", "segment": 3}, (404, "no-data")),
        ("/analyses/orbit", {"time_s": -1.0}, (422, "invalid-parameter")),
        ("/analyses/orbit", {"time": 1.0}, (422, "invalid-parameter")),
        ("/analyses/orbit", {"time_s": "nan"}, (422, "invalid-parameter")),
        ("/analyses/cascade", {"source": "recorded", "rows": 401}, (422, "invalid-parameter")),
        ("/analyses/waterfall", {"source": "recorded", "segment": 1}, (404, "no-data")),
        ("/analyses/bode", {"source": "recorded", "order": 3}, (404, "no-data")),
        ("/samples", {"from_s": 4.0}, (404, "no-data")),
        ("/samples", {"duration_s": 4.0}, (413, "response-too-large")),
        ("/prediction", {}, (422, "invalid-parameter")),
        ("/prediction", {"speed_rpm": 30_000.0}, (404, "no-data")),
        ("/comparison", {"speed_rpm": 15_000.0}, (404, "no-data")),
    ],
)
def test_missing_data_is_reported_by_problem_type(
    bench: RecordedBench, tail: str, parameters: dict[str, str | float], expected: tuple[int, str]
) -> None:
    assert problem(bench, tail, **parameters) == expected


def test_unsupported_accept_header_is_refused(bench: RecordedBench) -> None:
    assert bench.get("/samples", {"Accept": "image/png"}).status_code == 406


def test_defect_is_an_internal_error_with_a_logged_traceback(
    bench: RecordedBench, caplog: pytest.LogCaptureFixture
) -> None:
    with closing(open_recorded_bench(bench.folder, model=DefectiveModel())) as defective:
        assert problem(defective, "/prediction", speed_rpm=6000.0) == (500, "internal-error")
    assert "secret inside" in caplog.text
    assert "in prediction_for" in caplog.text  # the traceback


def test_comparison_returns_measured_bin_and_prediction(bench: RecordedBench, summary: RunSummary) -> None:
    row = min(summary.rows, key=lambda row: abs(row.speed - 6000.0 * RPM))
    document = get_json(bench, "/comparison", speed_rpm=6000.0)
    assert document["measured"]["speed_rpm"] == document["predicted"]["speed_rpm"] == rpm(row.speed)
    predicted = document["predicted"]["order_1x"]["amplitude_peak_x_um"]
    measured = document["measured"]["order_1x"]["amplitude_peak_x_um"]
    assert document["amplitude_ratio_x"] == pytest.approx(measured / predicted, rel=1e-3)
    lags = [document[part]["order_1x"]["lag_x_deg"] for part in ("measured", "predicted")]
    turned = document["lag_difference_x_deg"] - (lags[0] - lags[1])
    assert abs((turned + 180.0) % 360.0 - 180.0) < 1e-3


def test_known_response_is_not_sent_again(bench: RecordedBench) -> None:
    first = bench.get("/trend")
    assert first.headers["content-encoding"] == "gzip"
    again = bench.get("/trend", {"If-None-Match": f'"other", {first.headers["etag"]}'})
    assert (again.status_code, again.content) == (304, b"")
    plain = bench.get("/trend", {"If-None-Match": first.headers["etag"], "Accept-Encoding": "identity"})
    assert plain.status_code == 200
    assert "content-encoding" not in plain.headers
    assert plain.json() == first.json()


def test_file_is_downloaded_whole_and_in_ranges(bench: RecordedBench, path: Path) -> None:
    content = path.read_bytes()
    whole = bench.get("/file")
    assert (whole.status_code, whole.content) == (200, content)
    tag, size = whole.headers["etag"], len(content)
    for sent, begin, end in (("0-7", 0, 8), ("100-", 100, size), ("-5", size - 5, size), ("7-9999999999", 7, size)):
        part = bench.get("/file", {"Range": f"bytes={sent}", "If-Range": tag})
        assert (part.status_code, part.content) == (206, content[begin:end])
        assert part.headers["content-range"] == f"bytes {begin}-{end - 1}/{size}"
    assert bench.get("/file", {"Range": "bytes=0-7", "If-Range": '"another"'}).status_code == 200
    assert bench.get("/file", {"If-None-Match": tag}).status_code == 304
    for passed_over in ("bytes=9-3", "bytes=0-1,4-5", "lines=0-7", "bytes=-", "bytes=a-b"):
        assert bench.get("/file", {"Range": passed_over}).status_code == 200
    beyond = bench.get("/file", {"Range": f"bytes={size}-"})
    assert (beyond.status_code, beyond.headers["content-range"]) == (416, f"bytes */{size}")


def test_download_continues_with_the_same_file_after_a_replacement(tmp_path: Path, path: Path) -> None:
    content = path.read_bytes()
    file = tmp_path / f"{RUN}.mcap"
    file.write_bytes(content + bytes(20_000_000))  # more than socket buffers hold
    served = open_recorded_bench(tmp_path)
    try:
        with served.client.stream("GET", f"{API}/runs/{RUN}/file") as response:
            pieces = response.iter_raw()
            received = next(pieces)
            (tmp_path / "other").write_bytes(b"another file")
            (tmp_path / "other").replace(file)
            assert received + b"".join(pieces) == content + bytes(20_000_000)
        refused = served.get("/file")
        assert (refused.status_code, refused.json()["type"]) == (409, "/docs#run-damaged")
    finally:
        served.close()


def test_download_refuses_other_files_and_links(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("root:x:0:0")
    folder = tmp_path / "data"
    folder.mkdir()
    (folder / "link.mcap").symlink_to(tmp_path / "secret")
    (folder / "nowhere.mcap").symlink_to(tmp_path / "nothing")
    (folder / "circle.mcap").symlink_to("circle.mcap")
    (folder / "folder.mcap").mkdir()
    (folder / "Läufer.mcap").write_bytes(b"x")
    served = open_recorded_bench(folder)
    try:
        assert [run["run"] for run in served.client.get(f"{API}/runs").json()["runs"]] == ["link"]
        answers = {
            name: served.client.get(f"{API}/runs/{name}/file") for name in ("link", "nowhere", "circle", "folder")
        }
        assert {name: answer.status_code for name, answer in answers.items()} == {
            "link": 409, "nowhere": 404, "circle": 404, "folder": 404,
        }  # fmt: skip
        assert not any("root:x" in answer.text for answer in answers.values())
    finally:
        served.close()


def test_head_of_a_file_returns_its_size(bench: RecordedBench, path: Path) -> None:
    whole, part = (bench.client.head(f"{API}/runs/{RUN}/file", headers=h) for h in ({}, {"Range": "bytes=0-7"}))
    assert (whole.status_code, whole.headers["content-length"]) == (200, str(path.stat().st_size))
    assert (part.status_code, part.headers["content-length"]) == (206, "8")
    assert bench.get("/file", {"If-None-Match": "*"}).status_code == 304


def test_results_of_the_run_in_progress_are_refused(bench: RecordedBench) -> None:
    update = make_live_updates(1)[0]
    assert update.status.state is RunState.RECORDING
    bench.live.update = update
    try:
        for tail in ("/trend", "/analyses/orbit?source=recorded", "/file", "/samples", "/comparison?speed_rpm=6000"):
            assert bench.client.get(f"{API}/runs/{update.header.run}{tail}").status_code == 409
    finally:
        bench.live.update = None


def test_gzipped_response_equals_the_plain_one(bench: RecordedBench) -> None:
    with bench.client.stream("GET", f"{API}/runs/{RUN}/findings") as response:
        assert gzip.decompress(b"".join(response.iter_raw())).startswith(b'{"run":')


SVG = "{http://www.w3.org/2000/svg}"


@pytest.mark.parametrize("what", ["order-spectrum", "full-spectrum", "orbit", "bode", "cascade", "waterfall", "polar"])
def test_plot_is_an_svg_with_its_curves_inside(bench: RecordedBench, what: str) -> None:
    response = bench.get(f"/analyses/{what}", source="recorded", format="svg")
    assert response.headers["content-type"] == "image/svg+xml"
    root = ET.fromstring(response.text)  # noqa: S314 - the service's own
    width, height = (float(number) for number in root.attrib["viewBox"].split()[2:])
    curves = [group for group in root.iter(f"{SVG}g") if re.fullmatch(r"panel-\d+-curve-\d+", group.get("id", ""))]
    assert curves
    for curve in curves:
        drawn_paths = "".join(path.attrib["d"] for path in curve.findall(f"{SVG}path"))
        points = np.array([pair.split() for pair in re.findall(r"[ML] (\S+ \S+)", drawn_paths)], dtype=np.float64)
        assert points.size == 0 or points.min() >= 0.0  # a curve of dots has no path of its own
        assert points.size == 0 or (points.max(axis=0) <= (width, height)).all()
    assert RUN in response.text
    drawn = bench.get(f"/analyses/{what}", {"Accept": "image/png"}, source="recorded")
    assert drawn.headers["content-type"] == "image/png"
    assert drawn.content.startswith(b"\x89PNG")
    assert bench.get(f"/analyses/{what}", source="recorded", format="pdf").content.startswith(b"%PDF")
