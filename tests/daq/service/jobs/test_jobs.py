"""Jobs over REST on a loopback socket: create, follow, cancel, and download results."""

import io
import json
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq.cli.main import main
from daq.config.loader import load_rig
from daq.config.toml_files import to_toml
from daq.reports.analysis_result import ProgressCallback
from daq.reports.registry import KINDS
from daq.schemas.summary import summary_schema
from daq.service.jobs import tasks
from daq.service.jobs.queue import JobQueue, Task, perform
from daq.service.jobs.schemas import (
    ExportRequest,
    IndexRequest,
    JobSchema,
    JobState,
    VerificationRequest,
)
from daq.session.offline import summarise
from model.errors import ParameterError
from recordings.catalogue.catalogue import Catalogue
from recordings.exchange.formats import EXPORT_FORMATS
from recordings.mcap.reader import RunReader
from tests.daq.conftest import CALIBRATION, TABLES, merged
from tests.daq.support.live_updates import make_live_updates
from tests.daq.support.recorded_bench import API, RUN, RecordedBench, open_recorded_bench, record_run

LINEAR = {"calibration": {"coefficients_um": [0.0, 250.0], "volts_low": 0.5, "volts_high": 9.0, "date": "2026-11-24"}}
SPEEDS = {"from_rad_s": 200.0, "to_rad_s": 600.0, "count": 3}
LONG = "2026-11-24T10-00-00-test-rig"  # of a fast rig, whose model takes long


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RecordedBench]:
    folder = tmp_path_factory.mktemp("jobs")
    for name in ("probe-x.toml", "probe-y.toml"):
        (folder / name).write_text(to_toml({"calibration": CALIBRATION}), encoding="utf-8")
    for run, seconds, limit in ((RUN, 2.0, 5000.0), (LONG, 0.2, 20_000.0)):
        profile = [{"time_s": 0.0, "speed_rpm": 3000.0}, {"time_s": seconds, "speed_rpm": 4500.0}]
        tables = merged(TABLES, {"simulation": {"profile": profile}, "limits": {"speed_rpm": limit}})
        (folder / "rig.toml").write_text(to_toml(tables), encoding="utf-8")
        record_run(load_rig(folder / "rig.toml"), folder, run)
    opened = open_recorded_bench(folder)
    yield opened
    opened.close()


@pytest.fixture
def bench(served: RecordedBench) -> Iterator[RecordedBench]:
    """Return the bench; delete all jobs before and after."""
    yield served
    served.live.update = None
    for job in served.client.get(f"{API}/jobs").json()["jobs"]:
        served.client.delete(f"{API}/jobs/{job['job']}")


def start_job(bench: RecordedBench, **job_request: object) -> str:
    """Create a job; return its URL."""
    response = bench.client.post(f"{API}/jobs", json=job_request)
    assert response.status_code == 202, response.text
    assert JobSchema.model_validate_json(response.content).state in {"waiting", "running"}
    return response.headers["location"]


def wait_for_job(bench: RecordedBench, url: str) -> JobSchema:
    """Wait for the end of a job."""
    until = time.monotonic() + 500.0
    while time.monotonic() < until:
        job = JobSchema.model_validate_json(bench.client.get(url).content)
        if job.state.is_final:
            return job
        time.sleep(0.05)
    raise AssertionError(f"{url} did not end")


def run_job(bench: RecordedBench, **job_request: object) -> Any:
    """Run a job and return the response with its result."""
    url = start_job(bench, **job_request)
    job = wait_for_job(bench, url)
    assert job.state == "done", job.detail
    assert job.result == f"{url}/result"
    return bench.client.get(job.result)


def event_data(lines: Iterator[str]) -> Iterator[Any]:
    """Yield the JSON data of an event stream."""
    return (json.loads(line.removeprefix("data: ")) for line in lines if line.startswith("data: "))


def problem(response: Any) -> tuple[int, str]:
    assert response.headers["content-type"] == "application/problem+json"
    return response.status_code, response.json()["type"].removeprefix("/docs#")


def test_result_job_returns_the_response_of_the_route(bench: RecordedBench) -> None:
    made = run_job(bench, kind="result", run=RUN, path="trend", parameters={"entries": 20})
    assert made.headers["content-type"] == "application/json"
    assert made.json() == bench.get("/trend", entries=20).json()
    parameters: dict[str, str | float] = {"source": "recorded", "rows": 20}
    made = run_job(bench, kind="result", run=RUN, path="analyses/cascade", parameters=parameters)
    assert made.json() == bench.get("/analyses/cascade", **parameters).json()


def test_summary_job_returns_the_summary_of_route_and_command(
    bench: RecordedBench, capsys: pytest.CaptureFixture[str]
) -> None:
    made = run_job(bench, kind="result", run=RUN, path="summary").json()
    assert made["agreement"] is not None, "a job has time for the model"
    assert bench.get("/summary").json() == made
    assert main(["summary", RUN, "--folder", str(bench.folder), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == made


def test_reanalysis_job_reproduces_the_live_results(bench: RecordedBench) -> None:
    with RunReader(bench.folder / f"{RUN}.mcap") as reader:
        expected = summary_schema(summarise(reader)).model_dump(mode="json")
    made = run_job(bench, kind="reanalysis", run=RUN).json()
    assert made["by_speed"] == expected["by_speed"]


def test_reanalysis_job_uses_a_corrected_calibration(bench: RecordedBench) -> None:
    plain = bench.get("/summary").json()["by_speed"][0]["order_1x"]
    doubled = {
        "calibration": {"coefficients_um": [0.0, 250.0], "volts_low": 0.5, "volts_high": 9.0, "date": "2026-11-24"}
    }
    made = run_job(bench, kind="reanalysis", run=RUN, calibrations={"x": doubled}).json()["by_speed"][0]["order_1x"]
    assert made["amplitude_peak_x_um"] != plain["amplitude_peak_x_um"]
    assert made["amplitude_peak_y_um"] == pytest.approx(plain["amplitude_peak_y_um"], rel=0.05)


def test_prediction_job_uses_changed_parameters(bench: RecordedBench) -> None:
    plain, thick = (
        run_job(bench, kind="prediction", run=RUN, **changes).json() for changes in ({}, {"viscosity_pa_s": 0.05})
    )
    speeds = [row["speed_rpm"] for row in plain["by_speed"]]
    assert (speeds[0], speeds[-1]) == (500.0, 5000.0)
    assert speeds == [row["speed_rpm"] for row in thick["by_speed"]]
    assert plain["by_speed"][-1]["order_1x"] != thick["by_speed"][-1]["order_1x"]


def test_study_job_of_a_run_s_rig_returns_the_numbers_of_the_command(
    bench: RecordedBench, capsys: pytest.CaptureFixture[str]
) -> None:
    made = run_job(bench, kind="onset", run=RUN, speeds={**SPEEDS, "count": 2}).json()
    assert main(["model", "onset", str(bench.folder / "rig.toml"), "--speeds-rad-s", "200:600:2", "--json"]) == 0
    assert made == json.loads(capsys.readouterr().out)


@pytest.mark.parametrize(
    ("job_request", "named"),
    [
        ({"kind": "onset", "speeds": {**SPEEDS, "to_rad_s": 100.0}}, "expected more than from_rad_s 200"),
        ({"kind": "onset", "speeds": {**SPEEDS, "from_rad_s": 0.0}}, "greater than 0"),
        ({"kind": "response", "speeds": {**SPEEDS, "count": 100_000}}, "less than or equal to 2000"),
        ({"kind": "modes", "stiffness_n_m": -1.0}, "greater than 0"),
        ({"kind": "critical", "stiffnesses": {"from_n_m": 2.0, "to_n_m": 1.0, "count": 2}}, "expected more than"),
        ({"kind": "campbell", "station": 1}, "extra inputs"),
    ],
)
def test_invalid_study_request_is_refused(bench: RecordedBench, job_request: dict[str, object], named: str) -> None:
    refused = bench.client.post(f"{API}/jobs", json=job_request)
    assert refused.status_code == 422
    assert named in refused.json()["detail"]
    assert bench.client.post(f"{API}/jobs", json={"kind": "modes", "run": "no-such"}).status_code == 404


@pytest.mark.parametrize(
    ("job_request", "field", "named"),
    [
        ({"kind": "export", "format": "xls"}, "format", EXPORT_FORMATS),
        ({"kind": "result", "path": "analyses/none"}, "path", [f"analyses/{kind}" for kind in KINDS]),
    ],
)
def test_schema_and_refusal_name_every_registered_choice(
    bench: RecordedBench, job_request: dict[str, object], field: str, named: Iterable[str]
) -> None:
    component = {"export": "ExportRequest", "result": "ResultRequest"}[str(job_request["kind"])]
    schema = bench.client.get("/openapi.json").json()["components"]["schemas"][component]
    refused = bench.client.post(f"{API}/jobs", json={"run": RUN, **job_request})
    assert refused.status_code == 422
    for name in named:
        assert name.removeprefix(".") in schema["properties"][field]["enum"]
        assert name.removeprefix(".") in refused.json()["detail"]


def test_export_result_can_be_downloaded_by_ranges(bench: RecordedBench) -> None:
    answer = run_job(bench, kind="export", run=RUN, format="csv", until_s=0.01)
    assert f'filename="{RUN}.csv"' in answer.headers["content-disposition"]
    rows = [line for line in answer.text.splitlines() if not line.startswith("#")]
    assert rows[0].split(",")[0].strip('"').startswith("time_s")
    with RunReader(bench.folder / f"{RUN}.mcap") as reader:
        assert len(rows) - 1 == round(0.01 * reader.header.acquisition.rate)
    part = bench.client.get(answer.request.url.path, headers={"Range": "bytes=10-19"})
    assert part.status_code == 206
    assert part.content == answer.content[10:20]


def test_verification_job_stores_the_verdict(bench: RecordedBench) -> None:
    made = run_job(bench, kind="verification", run=RUN).json()
    assert made["verdict"] == "intact"
    assert Catalogue(bench.folder).run(RUN).verdict == "intact"


def test_recovery_job_lists_the_recovered_copy(bench: RecordedBench) -> None:
    whole = (bench.folder / f"{RUN}.mcap").read_bytes()
    (bench.folder / "cut.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    made = run_job(bench, kind="recovery", run="cut").json()
    assert made["samples"] > 0
    listed = bench.client.get(f"{API}/runs/cut-recovered").json()
    assert listed["samples"] == made["samples"]
    again = wait_for_job(bench, start_job(bench, kind="recovery", run="cut"))
    assert again.state == "failed"
    assert "exists already" in again.detail


def test_index_job_reports_changes(bench: RecordedBench) -> None:
    made = run_job(bench, kind="index", verify=True).json()
    assert RUN not in made["missing"]
    assert Catalogue(bench.folder).run(RUN).verdict == "intact"


def test_job_events_end_with_the_job(bench: RecordedBench) -> None:
    url = start_job(bench, kind="result", run=RUN, path="findings")
    with bench.client.stream("GET", f"{url}/events") as response:
        assert response.headers["content-type"].startswith("text/event-stream")
        states = [progress["state"] for progress in event_data(response.iter_lines())]
    assert states[-1] == "done"
    assert states == sorted(states, key=["waiting", "running", "done"].index)


def test_deleted_job_is_cancelled_and_the_next_one_runs(bench: RecordedBench) -> None:
    slow = start_job(bench, kind="prediction", run=LONG, viscosity_pa_s=0.0123)
    behind = start_job(bench, kind="result", run=RUN, path="findings")
    until = time.monotonic() + 60.0
    while bench.client.get(slow).json()["state"] != "running" and time.monotonic() < until:
        time.sleep(0.05)
    with bench.client.stream("GET", f"{slow}/events") as response:
        lines = response.iter_lines()
        assert next(lines) == "event: job"
        cancelled = bench.client.delete(slow)
        assert cancelled.json()["state"] == "cancelled"
        assert list(event_data(lines))[-1]["state"] == "cancelled"
    assert problem(bench.client.get(slow)) == (404, "job-not-found")
    assert problem(bench.client.delete(slow)) == (404, "job-not-found")
    assert wait_for_job(bench, behind).state == "done"
    assert [job["job"] for job in bench.client.get(f"{API}/jobs").json()["jobs"]] == [behind.rpartition("/")[2]]


def test_result_of_a_failed_or_unfinished_job_is_a_conflict(bench: RecordedBench) -> None:
    slow = start_job(bench, kind="prediction", run=LONG, viscosity_pa_s=0.0124)
    failing = start_job(bench, kind="export", run=RUN, format="csv", segment=7)
    assert problem(bench.client.get(f"{failing}/result")) == (409, "no-result")
    bench.client.delete(slow)
    failed = wait_for_job(bench, failing)
    assert failed.state == "failed"
    assert "segment 7" in failed.detail
    assert problem(bench.client.get(f"{failing}/result")) == (409, "no-result")


@pytest.mark.parametrize(
    ("job_request", "expected"),
    [
        ({"kind": "result", "run": "no-such-run", "path": "trend"}, (404, "run-not-found")),
        ({"kind": "result", "run": RUN, "path": "trend", "parameters": {"entries": 0}}, (422, "invalid-parameter")),
        ({"kind": "result", "run": RUN, "path": "findings", "parameters": {"rows": 3}}, (422, "invalid-parameter")),
        ({"kind": "washing", "run": RUN}, (422, "invalid-parameter")),
        ({"kind": "reanalysis", "run": RUN, "calibrations": {"x": {"point": []}}}, (422, "invalid-parameter")),
        ({"kind": "reanalysis", "run": RUN, "calibrations": {"z": LINEAR}}, (422, "invalid-parameter")),
        ({"kind": "prediction", "run": RUN, "viscosity_pa_s": -1}, (422, "invalid-parameter")),
    ],
)  # fmt: skip
def test_invalid_job_request_is_refused(
    bench: RecordedBench, job_request: dict[str, object], expected: tuple[int, str]
) -> None:
    assert problem(bench.client.post(f"{API}/jobs", json=job_request)) == expected


def test_request_above_its_time_limit_names_the_job_for_it(served: RecordedBench, tmp_path: Path) -> None:
    (tmp_path / f"{RUN}.mcap").write_bytes((served.folder / f"{RUN}.mcap").read_bytes())
    hasty = open_recorded_bench(tmp_path, request_limit=0.0)
    try:
        refused = hasty.get("/analyses/cascade", source="recorded", rows=20, format="svg")
        assert problem(refused) == (503, "time-limit-exceeded")
        job_request = refused.json()["job"]
        parameters: dict[str, str | float] = {"source": "recorded", "rows": 20, "format": "svg"}
        assert job_request == {"kind": "result", "run": RUN, "path": "analyses/cascade", "parameters": parameters}
        assert run_job(hasty, **job_request).text == served.get("/analyses/cascade", **parameters).text
    finally:
        hasty.close()


def test_job_for_the_run_in_progress_is_refused(bench: RecordedBench) -> None:
    bench.live.update = make_live_updates(2)[1]
    job_request = {"kind": "verification", "run": bench.live.update.header.run}
    assert problem(bench.client.post(f"{API}/jobs", json=job_request)) == (409, "run-under-way")


def test_request_body_too_large_or_without_size_is_refused(bench: RecordedBench) -> None:
    json_type = {"Content-Type": "application/json"}
    file_chunks = (b" " for _ in range(3))
    assert problem(bench.client.post(f"{API}/jobs", content=b" " * 2**21, headers=json_type)) == (
        413,
        "content-too-large",
    )
    assert problem(bench.client.post(f"{API}/jobs", content=file_chunks, headers=json_type)) == (
        413,
        "content-too-large",
    )
    assert bench.client.get(f"{API}/jobs").status_code == 200


def test_too_many_jobs_are_refused(bench: RecordedBench) -> None:
    statuses = [
        bench.client.post(f"{API}/jobs", json={"kind": "prediction", "run": LONG, "viscosity_pa_s": 0.01 + k / 1e4})
        for k in range(9)
    ]
    assert [answer.status_code for answer in statuses] == [202] * 8 + [429]
    assert problem(statuses[-1]) == (429, "too-many-jobs")


def test_service_stops_at_once_with_a_running_job_and_an_open_event_stream(
    served: RecordedBench, tmp_path: Path
) -> None:
    (tmp_path / f"{LONG}.mcap").write_bytes((served.folder / f"{LONG}.mcap").read_bytes())
    bench = open_recorded_bench(tmp_path)
    url = start_job(bench, kind="prediction", run=LONG, viscosity_pa_s=0.0125)
    until = time.monotonic() + 60.0
    while bench.client.get(url).json()["state"] != "running" and time.monotonic() < until:
        time.sleep(0.05)
    with bench.client.stream("GET", f"{url}/events") as response:
        next(response.iter_lines())
        begun_at = time.monotonic()
        bench.close()
    assert time.monotonic() - begun_at < 6.0
    assert list((bench.folder / ".rig" / "jobs").glob("*")) == []


def test_exported_table_equals_the_samples(bench: RecordedBench) -> None:
    answer = run_job(bench, kind="export", run=RUN, format="parquet", until_s=0.02)
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(io.BytesIO(answer.content))
    shown = np.load(io.BytesIO(bench.get("/samples", from_s=0.0, duration_s=0.02, format="npz").content))
    assert np.allclose(table.column("x_um").to_numpy(), shown["channel:x"])


def test_export_of_counter_timestamps_needs_a_run_that_has_them(bench: RecordedBench) -> None:
    failed = wait_for_job(bench, start_job(bench, kind="export", run=RUN, format="csv", content="pulses"))
    assert failed.state == "failed"
    assert "has no counter timestamps" in failed.detail


def test_verification_and_export_report_the_completed_fraction(bench: RecordedBench, tmp_path: Path) -> None:
    catalogue = Catalogue(bench.folder)
    verifying: list[tuple[str, float | None]] = []
    verification = VerificationRequest(kind="verification", run=RUN)
    tasks.verification_job(lambda *step: verifying.append(step), tmp_path / "v.json", catalogue, verification)
    exporting: list[tuple[str, float | None]] = []
    export = ExportRequest.model_validate({"kind": "export", "run": RUN, "format": "csv"})
    tasks.export_job(lambda *step: exporting.append(step), tmp_path / "run.csv", catalogue, export)
    assert {step for step, _ in verifying} == {"verifying"}
    assert exporting[0][0] == "reading"
    assert exporting[-1][0] == "writing 40,000 rows"
    for _, fraction in verifying + exporting:
        assert fraction is not None
        assert 0.0 <= fraction <= 1.0


REQUEST = IndexRequest(kind="index", verify=False)


def defective_job(report: ProgressCallback, target: Path, _catalogue: Catalogue, _request: IndexRequest) -> None:
    report(f"failing to write {target.name}", None)
    raise ValueError("secret inside")


def failing_job(report: ProgressCallback, target: Path, _catalogue: Catalogue, _request: IndexRequest) -> None:
    report(f"failing to write {target.name}", None)
    raise ParameterError("station: 99, expected 1 to 14")


def failed_job(folder: Path, work: Callable[..., None]) -> JobSchema:
    """Run a job to its end."""
    with closing(JobQueue(Catalogue(folder))) as jobs:
        job = jobs.submit(Task(REQUEST, "a failing job", work, "result.json"))
        end_time = time.monotonic() + 60.0
        while not (job := jobs.job(job.job)).state.is_final:
            assert time.monotonic() < end_time
            time.sleep(0.02)
    assert job.state is JobState.FAILED
    assert job.step == "failing to write result.json"
    return job


def test_defect_in_a_job_is_an_internal_error_with_a_logged_traceback(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    detail = failed_job(tmp_path, defective_job).detail
    assert detail.startswith("internal error")
    assert "secret" not in detail
    assert "secret inside" in caplog.text
    assert "in defective_job" in caplog.text  # the traceback of the worker process


def test_error_of_the_model_in_a_job_is_its_message(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    assert failed_job(tmp_path, failing_job).detail == "station: 99, expected 1 to 14"
    assert not caplog.records


def test_progress_is_reported_at_limited_rate(tmp_path: Path) -> None:
    reported: list[tuple[str, float | None]] = []
    perform(lambda *step: reported.append(step), Task(REQUEST, "", busy_job, "r"), tmp_path / "r", Catalogue(tmp_path))
    assert reported == [("first", 0.0), ("second", 0.0)]
    assert (tmp_path / "r").read_bytes() == b"result"


def busy_job(report: ProgressCallback, _target: Path, _catalogue: Catalogue, _request: IndexRequest) -> bytes:
    for step in ("first", "second"):
        for index in range(10):
            report(step, index / 10)
    return b"result"
