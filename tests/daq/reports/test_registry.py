"""Analyses of a whole run: the same numbers from the library, the command line, REST and a job."""

import io
import json
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.resampling.angular_record import (
    AngularRecord,
    angular_record_from_codes,
    probe_displacement,
    synchronous_average,
)
from analysis.shaft.orbit import centreline, direct_orbit
from analysis.shaft.overall import overall
from analysis.shaft.poincare import bifurcation_diagram, poincare_section
from analysis.signals.header import Acquisition
from analysis.signals.units import MICROMETRE, RPM, phase_lag_degrees
from analysis.spectra.frequency_spectrum import frequency_spectrum
from analysis.spectra.full_spectrum import full_cascade, full_spectrum, probe_mismatch
from analysis.spectra.order_map import order_map
from analysis.vectors.order_track import track_order
from analysis.vectors.runout import slow_roll
from analysis.vectors.speed_curve import speed_curves
from analysis.vectors.vold_kalman import probe_envelopes
from analysis.whirl.tracks import subsynchronous_tracks
from daq.cli.main import main
from daq.config.loader import load_rig
from daq.config.toml_files import to_toml
from daq.reports.analysis_result import AnalysisSchema
from daq.reports.kinds.envelopes import OrderFilter, solve_orders
from daq.reports.registry import KINDS
from daq.reports.run_samples import RunSamples, SampleRange
from recordings.mcap.reader import RunReader
from tests.daq.conftest import CALIBRATION, TABLES, merged
from tests.daq.support.recorded_bench import API, RUN, RecordedBench, open_recorded_bench, record_run

FloatArray = NDArray[np.float64]
Codes = NDArray[np.int16]

UP_AND_DOWN = {
    "profile": [{"time_s": at, "speed_rpm": rpm} for at, rpm in ((0.0, 1500), (0.6, 1500), (3.0, 9000), (5.0, 2000))],
    "whirl": [{"order": 0.45, "onset_rpm": 5000, "end_rpm": 20_000, "amplitude_um": 12, "forward": True}],
    "run_out_um": 2.0,
}
OFTEN = {"order-spectrum", "orbit", "cascade", "envelopes", "overall"}  # the others in the campaign
PARAMETERS: dict[str, dict[str, Any]] = {"envelopes": {"orders": "0.45,1,2"}, "slow-roll": {"slow_roll_rpm": 1550}}
OF_A_MOMENT = {"order-spectrum", "full-spectrum", "orbit", "waveforms", "average", "poincare"}


def record(folder: Path, run: str, **simulation: Any) -> None:
    for name in ("probe-x.toml", "probe-y.toml"):
        (folder / name).write_text(to_toml({"calibration": CALIBRATION}), encoding="utf-8")
    (folder / "rig.toml").write_text(to_toml(merged(TABLES, {"simulation": simulation})), encoding="utf-8")
    record_run(load_rig(folder / "rig.toml"), folder, run)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RecordedBench]:
    folder = tmp_path_factory.mktemp("analyses")
    record(folder, RUN, **UP_AND_DOWN)
    served = open_recorded_bench(folder)
    yield served
    served.close()


@pytest.fixture(scope="module")
def reader(bench: RecordedBench) -> Iterator[RunReader]:
    with RunReader(bench.folder / f"{RUN}.mcap") as opened:
        yield opened


def npz_columns(bench: RecordedBench, kind: str, **parameters: Any) -> Mapping[str, NDArray[Any]]:
    """Return the columns of an analysis in full precision."""
    answer = bench.get(f"/analyses/{kind}", format="npz", **parameters)
    assert answer.status_code == 200, answer.text
    with np.load(io.BytesIO(answer.content)) as archive:
        return dict(archive)


def no_progress(_doing: str, _part: float | None) -> None:
    """Progress callback that does nothing."""


def whole(reader: RunReader) -> tuple[Acquisition, Codes]:
    return reader.header.acquisition, reader.samples(0, 0, reader.n_samples)


def library_record(reader: RunReader, revolutions: int, **at: float) -> AngularRecord:
    """Return the angular record that the library computes for a time of the run."""
    run = RunSamples(reader, no_progress)
    span, end = run.range_before_frame(0, at.get("time_s"), at.get("speed_rpm"), revolutions)
    made = angular_record_from_codes(reader.header.acquisition, reader.samples(0, span.first, span.stop))
    last = int(np.searchsorted(made.times + span.first / run.rate, end + 0.5 / run.rate)) - 1
    return made.section(last - revolutions, last)


def close(found: NDArray[Any], expected: NDArray[Any], *, rtol: float = 1e-6, atol: float = 1e-9) -> None:
    np.testing.assert_allclose(np.asarray(found, float), expected, rtol=rtol, atol=atol)


@pytest.mark.parametrize(
    "kind", [kind if kind in OFTEN else pytest.param(kind, marks=pytest.mark.campaign) for kind in KINDS]
)
def test_command_and_rest_return_equal_numbers(
    bench: RecordedBench, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    parameters = PARAMETERS.get(kind, {})
    answer = bench.get(f"/analyses/{kind}", **parameters)
    assert answer.status_code == 200, answer.text
    document = AnalysisSchema.model_validate_json(answer.content)
    assert tuple(document.columns) == KINDS[kind].columns
    assert document.descriptions.keys() == {*document.columns, *document.scalars}
    assert document.scalars, "how good it is"
    options = [part for name, value in parameters.items() for part in (f"--{name.replace('_', '-')}", str(value))]
    place = ["--folder", str(bench.folder), "--json"]
    assert main(["analyse", kind, RUN, *options, *place]) == 0
    assert json.loads(capsys.readouterr().out) == answer.json()


@pytest.mark.parametrize("kind", [name for name, kind in KINDS.items() if kind.analyse_recorded is not None])
def test_recorded_source_returns_equal_numbers_from_command_and_rest(
    bench: RecordedBench, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    answer = bench.get(f"/analyses/{kind}", source="recorded")
    assert answer.status_code == 200, answer.text
    assert " · recorded " in answer.json()["title"]
    assert main(["analyse", kind, RUN, "--source", "recorded", "--folder", str(bench.folder), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == answer.json()


def test_command_refuses_options_that_the_source_does_not_take(
    bench: RecordedBench, capsys: pytest.CaptureFixture[str]
) -> None:
    both = ["--source", "recorded", "--revolutions", "8", "--folder", str(bench.folder)]
    assert main(["analyse", "orbit", RUN, *both]) == 2
    assert "--revolutions 8: only source=samples takes it" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["analyse", "average", RUN, "--source", "recorded"])
    assert "unrecognized arguments: --source recorded" in capsys.readouterr().err


def test_spectra_at_a_time_equal_library_results(bench: RecordedBench, reader: RunReader) -> None:
    lines = order_map(library_record(reader, 16, speed_rpm=6000.0), overlap=0.0)
    found = npz_columns(bench, "order-spectrum", speed_rpm=6000)
    close(found["order"], lines.orders)
    for row, probe in enumerate("xy"):
        close(found[f"amplitude_peak_{probe}_um"], np.abs(lines.spectrum[row, 0]) / MICROMETRE)
        strong = np.abs(lines.spectrum[row, 0]) > 1e-8
        close(found[f"lag_{probe}_deg"][strong], phase_lag_degrees(lines.spectrum[row, 0, strong]), rtol=1e-5)
    assert found["order"][np.argmax(found["amplitude_peak_x_um"])] == pytest.approx(0.45, abs=0.0625)
    full = full_spectrum(lines.orders, lines.spectrum[:, 0], lines.pair, probe_mismatch(lines))
    found = npz_columns(bench, "full-spectrum", speed_rpm=6000)
    close(found["order"], full.axis)
    close(found["amplitude_peak_um"], full.amplitudes / MICROMETRE)


def test_spectrum_uses_requested_scaling_and_window(bench: RecordedBench) -> None:
    peak = npz_columns(bench, "order-spectrum", time_s=2.0, window="flat top")
    double = npz_columns(bench, "order-spectrum", time_s=2.0, window="flat top", scaling="peak-to-peak")
    close(double["amplitude_peak_to_peak_x_um"], 2.0 * peak["amplitude_peak_x_um"])
    hann = npz_columns(bench, "order-spectrum", time_s=2.0)
    assert np.abs(hann["amplitude_peak_x_um"] - peak["amplitude_peak_x_um"]).max() > 0.01


def test_frequency_spectrum_and_overall_equal_library_results(bench: RecordedBench, reader: RunReader) -> None:
    acquisition, codes = whole(reader)
    displacement = probe_displacement(acquisition, codes)
    lines = frequency_spectrum(displacement, acquisition.rate, resolution=2.0)
    found = npz_columns(bench, "frequency-spectrum")
    shown = lines.frequencies <= 2000.0
    close(found["frequency_hz"], lines.frequencies[shown])
    close(found["amplitude_peak_y_um"], lines.amplitudes[1, shown] / MICROMETRE)
    level = overall(displacement, acquisition.rate, reader.header.limits.clearance)
    found = npz_columns(bench, "overall")
    close(found["time_s"], level.times)
    close(found["peak_to_peak_x_um"], level.peak_to_peak[0] / MICROMETRE)
    close(found["clearance_fraction_y"], level.clearance_fraction[1])
    middle = (found["time_s"] > 1.0) & (found["time_s"] < 2.5)
    close(found["speed_rpm"][middle], 1500 + 3125 * (found["time_s"][middle] - 0.6), rtol=0.02)


def test_cascade_and_waterfall_equal_library_results(bench: RecordedBench, reader: RunReader) -> None:
    lines = order_map(angular_record_from_codes(*whole(reader)), highest_order=4.0)
    speeds, rows = full_cascade(lines, 200.0 * RPM, probe_mismatch(lines))
    found = npz_columns(bench, "cascade", lines="full")
    close(np.unique(found["speed_rpm"]), speeds / RPM)
    close(found["amplitude_peak_um"].reshape(speeds.size, -1), rows.amplitudes / MICROMETRE, rtol=1e-5, atol=1e-6)
    found = npz_columns(bench, "waterfall", rows=400)
    assert np.unique(found["time_s"]).size <= 400
    largest = lines.amplitudes().max(axis=(0, 1)) / MICROMETRE
    close(found["amplitude_peak_um"].reshape(-1, lines.orders.size).max(axis=0), largest, rtol=1e-5, atol=1e-6)
    hertz = npz_columns(bench, "waterfall", lines="frequencies")
    times = np.unique(hertz["time_s"])
    then = hertz["time_s"] == times[np.argmin(np.abs(times - 2.6))]
    strongest = hertz["frequency_hz"][then][np.argmax(hertz["amplitude_peak_um"][then])]
    assert strongest == pytest.approx(0.45 * 7750 / 60, abs=4.0), "the whirl follows the speed"


@pytest.mark.parametrize("order", [1.0, 2.0, 0.45])
def test_vectors_over_speed_equal_library_results_for_run_up_and_run_down(
    bench: RecordedBench, reader: RunReader, order: float
) -> None:
    curves = speed_curves(track_order(angular_record_from_codes(*whole(reader)), order), 100.0 * RPM)
    found = npz_columns(bench, "bode", order=order)
    assert set(found["ramp_direction"]) == {"run-up", "run-down"}
    for curve in curves:
        here = found["ramp_direction"] == curve.direction.value
        close(found["speed_rpm"][here], curve.speeds / RPM)
        for row, probe in enumerate("xy"):
            close(found[f"amplitude_peak_{probe}_um"][here], curve.amplitudes[row] / MICROMETRE, rtol=1e-4, atol=1e-5)
            close(found[f"sigma_peak_{probe}_um"][here], curve.sigma[row] / MICROMETRE, rtol=1e-3, atol=1e-5)
    drawn = npz_columns(bench, "polar", order=order)
    close(drawn["lag_x_deg"], np.asarray(found["lag_x_deg"]))


def test_slow_roll_parameter_subtracts_run_out(bench: RecordedBench, reader: RunReader) -> None:
    record = angular_record_from_codes(*whole(reader))
    begin = int(np.argmax(record.times > 0.7))
    roll = slow_roll(record.section(0, begin), 0.0, 1650.0 * RPM)
    found = npz_columns(bench, "slow-roll", slow_roll_rpm=1650)
    close(found["runout_x_um"], roll.waveform[0] / MICROMETRE, rtol=0.02, atol=0.03)
    assert np.ptp(found["runout_x_um"]) > 3.0
    parameters = {"order": 1.0, "duration_s": 3.0}
    measured = npz_columns(bench, "bode", **parameters)
    left = npz_columns(bench, "bode", **parameters, slow_roll_rpm=1650)
    vectors = [one["amplitude_peak_x_um"] * np.exp(-1j * np.radians(one["lag_x_deg"])) for one in (measured, left)]
    np.testing.assert_allclose((vectors[0] - vectors[1]) * MICROMETRE, roll.vectors(1)[0], atol=0.06e-6)
    answer = bench.get("/analyses/bode", slow_roll_rpm=1650, format="svg")
    assert "compensated" in answer.text


def test_orbits_equal_library_results_and_sum_up(bench: RecordedBench, reader: RunReader) -> None:
    made = direct_orbit(library_record(reader, 16, speed_rpm=7000.0))
    direct = npz_columns(bench, "orbit", speed_rpm=7000)
    close(direct["X_um"], made.motion[0].ravel() / MICROMETRE, atol=1e-6)
    one = npz_columns(bench, "orbit", speed_rpm=7000, filter="orders", orders="1")
    rest = npz_columns(bench, "orbit", speed_rpm=7000, filter="without", orders="1")
    total = one["Y_um"] + rest["Y_um"]
    close(total - total.mean(), direct["Y_um"] - direct["Y_um"].mean(), atol=1e-6)
    scalars = bench.get("/analyses/orbit", speed_rpm=7000, filter="orders").json()["scalars"]
    assert np.hypot(one["X_um"], one["Y_um"]).max() == pytest.approx(scalars["major_peak_um"], rel=0.01)
    assert scalars["sigma_peak_um"] < 0.1


def test_average_and_keyphasor_points_equal_library_results(bench: RecordedBench, reader: RunReader) -> None:
    mean = synchronous_average(library_record(reader, 32, time_s=2.5))
    found = npz_columns(bench, "average", time_s=2.5, revolutions=32)
    expected = mean.waveform - mean.waveform.mean(axis=1, keepdims=True)
    close(found["average_x_um"], expected[0] / MICROMETRE, atol=1e-6)
    section = poincare_section(library_record(reader, 64, time_s=2.5))
    found = npz_columns(bench, "poincare", time_s=2.5, revolutions=64)
    close(found["X_um"], section.points[0] / MICROMETRE, atol=1e-6)
    speeds, positions = bifurcation_diagram(angular_record_from_codes(*whole(reader)))
    found = npz_columns(bench, "bifurcation")
    close(found["speed_rpm"], speeds / RPM)
    close(found["Y_um"], positions[1] / MICROMETRE, atol=1e-6)


def test_centreline_and_components_below_1x_equal_library_results(bench: RecordedBench, reader: RunReader) -> None:
    record = angular_record_from_codes(*whole(reader))
    line = centreline(record, np.array([-450e-6, -430e-6]), reader.header.limits.clearance)
    found = npz_columns(bench, "centreline", rest_x_um=-450, rest_y_um=-430)
    close(found["X_um"], line.positions[0] / MICROMETRE, atol=1e-6)
    close(found["eccentricity_ratio"], line.eccentricity_ratio)
    tracks = subsynchronous_tracks(order_map(record, highest_order=2.0))
    found = npz_columns(bench, "sub-synchronous")
    assert len(tracks) >= 1
    close(found["order"], np.array([track.order for track in tracks]), rtol=1e-5)
    close(found["onset_rpm"], np.array([track.onset_speed for track in tracks]) / RPM)
    assert found["behaviour"].tolist() == [track.behaviour.value for track in tracks]
    assert found["onset_rpm"][0] == pytest.approx(5000, rel=0.05)


def test_envelopes_equal_library_results_and_waveforms_match_them(bench: RecordedBench, reader: RunReader) -> None:
    acquisition, codes = whole(reader)
    run = RunSamples(reader, no_progress)
    angle = run.shaft_angle(SampleRange(0, 0, reader.n_samples))[1]
    displacement = probe_displacement(acquisition, codes)
    times, (x, _) = probe_envelopes(displacement, acquisition.rate, angle, (0.45, 1.0), bandwidth=6.0)
    found = npz_columns(bench, "envelopes", orders="0.45,1", bandwidth_hz=6, entries=200)
    shown = found["time_s"][found["order"] == 1.0]
    assert shown.size == 200
    inner = slice(1, -1)  # the ends lie between no two of the library's
    for row, order in enumerate((0.45, 1.0)):
        here = found["order"] == order
        expected = np.interp(shown, times, np.abs(x.envelopes[row])) / MICROMETRE
        close(found["amplitude_peak_x_um"][here][inner], expected[inner], rtol=1e-3, atol=1e-3)
        sigma = np.interp(shown, times, x.sigma[row]) / MICROMETRE
        close(found["sigma_peak_x_um"][here][inner], sigma[inner], rtol=1e-3)
    hum = np.asarray(2.0 * np.pi * 50.0 * np.arange(displacement.shape[1]) / acquisition.rate, dtype=np.float64)
    times, (x, _) = probe_envelopes(displacement, acquisition.rate, angle, (1.0,), bandwidth=6.0, others=(hum,))
    beside = npz_columns(bench, "envelopes", orders="1", bandwidth_hz=6, entries=200, frequencies_hz="50")
    expected = np.interp(beside["time_s"], times, np.abs(x.envelopes[0])) / MICROMETRE
    close(beside["amplitude_peak_x_um"][inner], expected[inner], rtol=1e-3, atol=1e-3)
    assert bench.get("/analyses/envelopes", orders="1", frequencies_hz="0").status_code == 422
    waves = npz_columns(bench, "waveforms", orders="0.45,1", time_s=2.6, bandwidth_hz=6)
    size = np.ptp(waves["displacement_x_um"][waves["order"] == 0.45]) / 2
    assert size == pytest.approx(12.0, rel=0.05)


def test_envelopes_solved_in_pieces_equal_single_solution(reader: RunReader) -> None:
    output: list[float | None] = []
    run = RunSamples(reader, lambda doing, part: output.append(part) if doing.startswith("solving") else None)
    span, chosen = run.sample_range(0), OrderFilter((0.45, 1.0), 20.0, None)
    angle, wanted = run.shaft_angle(span)[1], np.linspace(0.5, 4.5, 300)
    once = solve_orders(run, span, angle, wanted, chosen, min_duration=10.0)
    assert output == [1.0]
    pieces = solve_orders(run, span, angle, wanted, chosen, min_duration=0.5)
    assert output[1:] == [0.5, 1.0]
    np.testing.assert_allclose(pieces.envelopes, once.envelopes, atol=2e-11)


def test_samples_read_in_chunks_give_equal_record(reader: RunReader) -> None:
    pieces = RunSamples(reader, no_progress, chunk_size=7_000).angular_record(SampleRange(0, 0, reader.n_samples))
    once = angular_record_from_codes(*whole(reader))
    assert pieces.first_turn == once.first_turn
    np.testing.assert_allclose(pieces.times, once.times, atol=1e-12)
    np.testing.assert_allclose(pieces.waveform, once.waveform, atol=1e-13)
    assert pieces.clipped == once.clipped


def test_truncated_run_is_analysed_again_once(bench: RecordedBench, tmp_path: Path) -> None:
    content = (bench.folder / f"{RUN}.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: len(content) // 2])
    tasks: list[str] = []
    with RunReader(tmp_path / "cut.mcap") as cut:
        first = RunSamples(cut, lambda task, _fraction: tasks.append(task)).history()
        assert set(tasks) == {"analysing"}
        tasks.clear()
        assert RunSamples(cut, lambda task, _fraction: tasks.append(task)).history() is first
    assert tasks == []


def test_time_interval_returns_part_of_run(bench: RecordedBench) -> None:
    part = npz_columns(bench, "bifurcation", from_s=2.0, duration_s=1.0)
    everything = npz_columns(bench, "bifurcation")
    assert part["time_s"].min() >= 2.0
    assert part["time_s"].max() <= 3.0
    same = np.isin(np.round(everything["time_s"], 4), np.round(part["time_s"], 4))
    assert same.sum() > 100


def test_progress_rises_while_samples_are_read(reader: RunReader) -> None:
    output: list[tuple[str, float | None]] = []
    run = RunSamples(reader, lambda doing, part: output.append((doing, part)), chunk_size=10_000)
    KINDS["bifurcation"].analyse(run, KINDS["bifurcation"].parameters())
    parts = [part for doing, part in output if doing == "reading samples against angle" and part is not None]
    assert len(parts) > 5
    assert parts == sorted(parts)
    assert parts[-1] == 1.0


def done(bench: RecordedBench, **order: object) -> Any:
    """Run a job and return the response with its result."""
    begun = bench.client.post(f"{API}/jobs", json={"kind": "result", "run": RUN, **order})
    assert begun.status_code == 202, begun.text
    place = begun.headers["location"]
    until = time.monotonic() + 120.0
    while (job := bench.client.get(place).json())["state"] in {"waiting", "running"} and time.monotonic() < until:
        time.sleep(0.05)
    assert job["state"] == "done", job
    return bench.client.get(job["result"])


def test_job_result_equals_direct_response_and_can_be_plotted(bench: RecordedBench) -> None:
    parameters = {"orders": "0.45,1,2"}
    made = done(bench, path="analyses/envelopes", parameters=parameters)
    assert made.json() == bench.get("/analyses/envelopes", **parameters).json()
    drawn = done(bench, path="analyses/bifurcation", parameters={"format": "svg"})
    assert drawn.headers["content-type"] == "image/svg+xml"
    assert drawn.text == bench.get("/analyses/bifurcation", format="svg").text
    wrong = {"kind": "result", "run": RUN, "path": "analyses/bode", "parameters": {"order": -1}}
    assert bench.client.post(f"{API}/jobs", json=wrong).status_code == 422


def test_format_follows_parameter_or_accept_header(bench: RecordedBench) -> None:
    pa = pytest.importorskip("pyarrow.ipc", reason="the extra `formats` is not installed")
    sent = bench.get("/analyses/bode", {"Accept": "application/vnd.apache.arrow.stream"})
    table = pa.open_stream(sent.content).read_all()
    assert table.schema.field("speed_rpm").metadata[b"unit"].decode() == "r/min"
    assert table.column("speed_rpm").to_pylist() == npz_columns(bench, "bode")["speed_rpm"].tolist()
    assert "Accept" in sent.headers["vary"]
    assert bench.get("/analyses/bode", {"Accept": "image/png"}).content.startswith(b"\x89PNG")
    assert bench.get("/analyses/bode", {"Accept": "text/html"}).status_code == 406
    tag = bench.get("/analyses/bode", format="svg").headers["etag"]
    assert bench.get("/analyses/bode", {"If-None-Match": tag}, format="svg").status_code == 304


@pytest.mark.parametrize(
    ("kind", "parameters", "status", "message"),
    [
        ("bode", {"order": 60}, 409, "order 60 reaches 8,967 Hz"),
        ("poincare", {"revolutions": 4000}, 409, "expected at least 4000"),
        ("orbit", {"speed_rpm": 19_000}, 404, "the run has them from 1,5"),
        ("bode", {"from_s": 60}, 404, "no samples from 60 s"),
        ("slow-roll", {"slow_roll_rpm": 100}, 409, "never turned as slowly as 100 r/min"),
        ("envelopes", {"bandwidth_hz": 0.001}, 409, "bandwidth"),
        ("envelopes", {"orders": "99"}, 409, "0.45 of the rate"),
        ("frequency-spectrum", {"resolution_hz": 10, "duration_s": 0.01}, 409, "expected at least"),
        ("envelopes", {"orders": "1,1"}, 422, "all different"),
        ("orbit", {"orders": "0"}, 422, "above 0"),
        ("envelopes", {"bandwidth_hz": 4, "bandwidth_percent": 4}, 422, "expected one of"),
        ("orbit", {"orders": "one"}, 422, ""),
    ],
)
def test_insufficient_data_is_reported_with_values(
    bench: RecordedBench,
    kind: str,
    parameters: dict[str, Any],
    status: int,
    message: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    answer = bench.get(f"/analyses/{kind}", **parameters)
    assert answer.status_code == status, answer.text
    assert message in answer.json()["detail"]
    options = [part for name, value in parameters.items() for part in (f"--{name.replace('_', '-')}", str(value))]
    assert main(["analyse", kind, RUN, *options, "--folder", str(bench.folder)]) == (1 if status == 409 else 2)
    output = capsys.readouterr().err
    assert message in output
    assert output.startswith("rig: ")
    assert len(output.splitlines()) == 1


def test_command_writes_plots_and_tables_without_overwriting(
    bench: RecordedBench, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = ("orbit.svg", "orbit.png", "orbit.pdf", "orbit.csv", "orbit.parquet")
    files = [part for name in names for part in ("-o", str(tmp_path / name))]
    parameters = ["analyse", "orbit", RUN, "--time-s", "2.5", "--folder", str(bench.folder)]
    assert main([*parameters, *files]) == 0
    out = capsys.readouterr().out
    assert "24 of 256 rows" in out
    assert "jitter_us" in out
    assert (tmp_path / "orbit.svg").read_text(encoding="utf-8") == bench.get(
        "/analyses/orbit", time_s=2.5, format="svg"
    ).text
    rows = np.loadtxt(tmp_path / "orbit.csv", delimiter=",", skiprows=_heading(tmp_path / "orbit.csv"))
    np.testing.assert_array_equal(rows[:, 3], npz_columns(bench, "orbit", time_s=2.5)["X_um"])
    shown = (tmp_path / "orbit.csv").read_bytes()
    for file, message in (
        ("orbit.csv", "exists already"),
        ("orbit.gif", "expected a name that ends with"),
        ("no/a.svg", "no folder"),
    ):
        assert main([*parameters, "-o", str(tmp_path / file)]) == 2
        assert message in capsys.readouterr().err
    assert (tmp_path / "orbit.csv").read_bytes() == shown


def _heading(file: Path) -> int:
    """Return how many lines stand before the numbers."""
    lines = file.read_text(encoding="utf-8").splitlines()
    return 1 + next(number for number, line in enumerate(lines) if not line.startswith("#"))


def test_all_invalid_options_are_reported_together(bench: RecordedBench, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = ["--order", "abc", "--width-rpm", "-5", "--from-s", "inf"]
    assert main(["analyse", "bode", RUN, *wrong, "--folder", str(bench.folder)]) == 2
    output = capsys.readouterr().err
    assert all(option in output for option in ("--order abc", "--width-rpm -5", "--from-s inf"))
    assert main(["analyse", "orbit", RUN, "--orders", "1;2", "--folder", str(bench.folder)]) == 2
    assert "expected numbers with commas" in capsys.readouterr().err
    assert main(["analyse", "orbit", "no-such-run", "--folder", str(bench.folder)]) == 2
    assert "no-such-run" in capsys.readouterr().err


def test_default_frame_has_the_largest_vibration(bench: RecordedBench) -> None:
    largest = bench.get("/analyses/orbit", source="recorded").json()["scalars"]
    for kind in OF_A_MOMENT:
        title = bench.get(f"/analyses/{kind}").json()["title"]
        assert f"at {largest['time_s']:.1f} s" in title or f"to {largest['time_s']:.1f} s" in title
