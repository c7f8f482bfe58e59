"""Every REST route with valid and invalid requests over a loopback socket."""

import json
import re
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import httpx
import pytest

from analysis.signals.units import MICROMETRE
from daq.schemas.live import LiveSchema
from daq.schemas.runs import RunSchema
from daq.schemas.snapshot import LiveCurvesSchema
from daq.schemas.summary import SummarySchema
from daq.service.problems import ProblemSchema
from daq.session.live_update import RunState
from recordings.errors import DamagedError, RecordingError, StorageError, UnknownFormatError
from tests.daq.support.live_updates import make_live_updates
from tests.daq.support.service_bench import API, Bench, open_bench, schema_errors
from tests.daq.support.service_fakes import CUT, NEWEST, OTHER_RIG, UNREADABLE


@pytest.fixture(scope="module")
def served() -> Iterator[Bench]:
    opened = open_bench()
    yield opened
    opened.close()


@pytest.fixture
def bench(served: Bench) -> Iterator[Bench]:
    yield served
    served.reset()


def problem(response: httpx.Response) -> ProblemSchema:
    """Return the problem of a response; assert that its form is correct."""
    assert response.headers["content-type"] == "application/problem+json"
    document = ProblemSchema.model_validate_json(response.content)
    assert document.status == response.status_code
    assert document.detail
    return document


def runs_of(response: httpx.Response) -> list[str]:
    assert response.status_code == 200, response.text
    return [run["run"] for run in response.json()["runs"]]


def test_runs_are_listed_newest_first_with_their_faults(bench: Bench) -> None:
    response = bench.get("/runs")
    assert runs_of(response) == [NEWEST, CUT, OTHER_RIG, UNREADABLE]
    unreadable = response.json()["runs"][-1]
    assert unreadable["fault"] == "u.mcap: 12 bytes, no MCAP file"
    assert unreadable["rig"] is None
    assert unreadable["samples"] is None


def test_run_list_filters_by_rig_and_completeness(bench: Bench) -> None:
    assert runs_of(bench.get("/runs", rig="bench2")) == [OTHER_RIG]
    assert runs_of(bench.get("/runs", complete="false")) == [CUT, UNREADABLE]
    assert runs_of(bench.get("/runs", complete="true", rig="gj90c")) == [NEWEST]
    assert runs_of(bench.get("/runs", rig="none-such")) == []


def test_pages_of_runs_form_the_whole_list(bench: Bench) -> None:
    first, second, beyond = (bench.get("/runs", limit=3, offset=offset) for offset in (0, 3, 6))
    assert runs_of(first) + runs_of(second) == [NEWEST, CUT, OTHER_RIG, UNREADABLE]
    assert runs_of(beyond) == []
    assert {page.json()["total"] for page in (first, second, beyond)} == {4}
    assert (second.json()["limit"], second.json()["offset"]) == (3, 3)


@pytest.mark.parametrize(
    ("query", "parameter"),
    [
        ("limit=0", "query.limit"),
        ("limit=201", "query.limit"),
        ("limit=many", "query.limit"),
        ("offset=-1", "query.offset"),
        ("complete=perhaps", "query.complete"),
        ("page=2", "query.page"),
    ],
)
def test_invalid_parameter_is_named_with_its_value(bench: Bench, query: str, parameter: str) -> None:
    response = bench.client.get(f"{API}/runs?{query}")
    reported = problem(response)
    assert reported.status == 422
    assert reported.type == "/docs#invalid-parameter"
    assert [fault.parameter for fault in reported.faults] == [parameter]
    assert query.partition("=")[2] in reported.faults[0].detail


def test_all_invalid_parameters_are_reported_together(bench: Bench) -> None:
    reported = problem(bench.client.get(f"{API}/runs?limit=0&offset=-1"))
    assert {fault.parameter for fault in reported.faults} == {"query.limit", "query.offset"}


def test_run_is_returned_by_its_id(bench: Bench) -> None:
    response = bench.get(f"/runs/{NEWEST}")
    assert response.status_code == 200
    run = RunSchema.model_validate_json(response.content)
    assert (run.run, run.rig, run.duration_s, run.note) == (NEWEST, "gj90c", 300.0, "after the oil change")


def test_unreadable_run_is_returned_with_its_fault(bench: Bench) -> None:
    assert bench.get(f"/runs/{UNREADABLE}").json()["fault"]


@pytest.mark.parametrize("tail", ["", "/summary"])
@pytest.mark.parametrize(
    "run_id",
    [
        "no-such-run",
        "..",
        "%2e%2e",
        "..%2fsecret",
        "%2e%2e%2fsecret",
        "..%5csecret",
        "%252e%252e%252fsecret",
        "..%00",
        "%00",
        "a%0d%0ab",
        "....//secret",
        "%2fetc%2fpasswd",
        "C:%5cWindows%5cwin.ini",
        "%c0%ae%c0%ae",
        "%20",
        "x" * 4000,
    ],
)
def test_unknown_or_path_like_run_id_is_not_found(bench: Bench, run_id: str, tail: str) -> None:
    status, headers, content = bench.raw(f"{API}/runs/{run_id}{tail}")
    assert status == 404
    assert headers["content-type"] == "application/problem+json"
    assert ProblemSchema.model_validate_json(content).type in {"/docs#run-not-found", "/docs#not-found"}
    assert b"Traceback" not in content


def test_summary_contains_losses_and_components(bench: Bench) -> None:
    response = bench.get(f"/runs/{NEWEST}/summary")
    assert response.status_code == 200
    summary = SummarySchema.model_validate_json(response.content)
    assert summary.is_gap_free is False
    assert (summary.lost_samples, summary.lost_is_exact) == (2000, False)
    assert summary.sub_synchronous[0].begin.speed_rpm == pytest.approx(10_980.0)


@pytest.mark.parametrize(
    ("error", "status", "kind"),
    [
        (DamagedError("r.mcap: cut before the first samples"), 409, "run-damaged"),
        (UnknownFormatError("r.mcap: format 7, expected 1"), 409, "run-format-unknown"),
        (StorageError("data: cannot be read: permission denied"), 503, "storage-unavailable"),
        (RecordingError("r.mcap: something else"), 500, "internal-error"),
    ],
)
def test_summary_error_is_reported_by_problem_type(bench: Bench, error: RecordingError, status: int, kind: str) -> None:
    bench.summaries.trouble = error
    reported = problem(bench.get(f"/runs/{NEWEST}/summary"))
    assert (reported.status, reported.type, reported.detail) == (status, f"/docs#{kind}", str(error))
    assert reported.instance == f"{API}/runs/{NEWEST}/summary"


def test_summary_of_the_run_in_progress_is_a_conflict_until_its_end(bench: Bench) -> None:
    update = make_live_updates(1)[0]
    bench.live.update = update
    reported = problem(bench.get(f"/runs/{NEWEST}/summary"))
    assert (reported.status, reported.type) == (409, "/docs#run-under-way")
    assert bench.get(f"/runs/{CUT}/summary").status_code == 200
    bench.live.update = replace(update, status=replace(update.status, state=RunState.FINISHED))
    assert bench.get(f"/runs/{NEWEST}/summary").status_code == 200


def test_internal_error_is_logged_and_reported_without_details(bench: Bench, caplog: pytest.LogCaptureFixture) -> None:
    bench.summaries.trouble = LookupError("secret inside")
    reported = problem(bench.get(f"/runs/{NEWEST}/summary"))
    assert (reported.status, reported.type) == (500, "/docs#internal-error")
    assert "secret" not in reported.detail
    assert "secret inside" in caplog.text
    assert f"GET {API}/runs/{NEWEST}/summary failed" in caplog.text
    assert bench.get("/runs").status_code == 200


def test_unreadable_data_folder_affects_run_list_and_health(bench: Bench) -> None:
    bench.catalogue.trouble = StorageError("data: the data folder cannot be read: gone")
    response = bench.get("/runs")
    assert problem(response).status == 503
    assert int(response.headers["retry-after"]) > 0
    health = bench.get("/health")
    assert health.status_code == 200
    assert health.json()["health"] == "trouble"
    assert health.json()["runs"] is None
    assert "gone" in health.json()["detail"]


def test_live_is_not_found_without_a_run(bench: Bench) -> None:
    reported = problem(bench.get("/live"))
    assert (reported.status, reported.type) == (404, "/docs#no-live-run")


def test_live_returns_measurement_and_model_uncached(bench: Bench) -> None:
    bench.live.update = make_live_updates(200)[150]
    response = bench.get("/live")
    assert response.status_code == 200
    assert response.headers["cache-control"] == "no-store"
    live = LiveSchema.model_validate_json(response.content)
    assert live.measured is not None
    assert live.predicted is not None
    assert live.measured.speed_rpm == pytest.approx(live.predicted.speed_rpm)
    assert live.measured.whirl is not None
    assert live.measured.whirl.order == 0.49


def test_live_curves_contain_measured_and_predicted_orbit_and_spectrum(bench: Bench) -> None:
    assert problem(bench.get("/live/curves")).type == "/docs#no-live-run"
    update = make_live_updates(200)[150]
    bench.live.update = update
    picture = LiveCurvesSchema.model_validate_json(bench.get("/live/curves").content)
    assert update.snapshot is not None
    assert update.snapshot.frame is not None
    assert picture.measured is not None
    assert picture.predicted is not None
    assert picture.measured.orbit_x_um == pytest.approx(update.snapshot.frame.orbit[0] / MICROMETRE, abs=1e-4)
    assert len(picture.measured.orbit_y_um) == 4 * picture.points_per_revolution
    first = picture.measured.orders.index(1.0)
    assert picture.measured.spectrum_peak_x_um[first] == pytest.approx(
        abs(update.snapshot.frame.spectrum[0, first]) / MICROMETRE, abs=1e-4
    )
    bench.live.update = replace(update, snapshot=None, prediction=None)
    empty = LiveCurvesSchema.model_validate_json(bench.get("/live/curves").content)
    assert (empty.measured, empty.predicted) == (None, None)


def test_health_names_the_current_run_and_a_failed_one(bench: Bench) -> None:
    assert bench.get("/health").json()["live_run"] is None
    update = make_live_updates(1)[0]
    bench.live.update = update
    health = bench.get("/health").json()
    assert (health["live_run"], health["health"], health["runs"]) == (NEWEST, "good", 4)
    bench.live.update = replace(update, status=replace(update.status, state=RunState.FAILED, detail="card unplugged"))
    health = bench.get("/health").json()
    assert (health["live_run"], health["health"]) == (None, "trouble")
    assert "card unplugged" in health["detail"]


@pytest.mark.parametrize("path", ["/", "/nothing", "/runs/", f"/runs/{NEWEST}/", f"/runs/{NEWEST}/samples", "/v2"])
def test_unknown_path_returns_a_problem(bench: Bench, path: str) -> None:
    assert problem(bench.get(path)).status == 404


@pytest.mark.parametrize("path", [f"{API}/runs", f"{API}/live", "/", "/console/page.js", "/openapi.json"])
def test_head_returns_the_headers_of_get(bench: Bench, path: str) -> None:
    head, get = bench.client.head(path), bench.client.get(path)
    assert head.content == b""
    assert head.status_code == get.status_code
    assert {**head.headers, "date": ""} == {**get.headers, "date": ""}


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH"])
def test_read_only_path_names_its_methods(bench: Bench, method: str) -> None:
    response = bench.client.request(method, f"{API}/runs")
    assert problem(response).status == 405
    assert response.headers["allow"] == "GET"


def test_waiting_summaries_do_not_delay_other_routes_and_are_limited(bench: Bench) -> None:
    bench.live.update = make_live_updates(1)[0]
    bench.summaries.gate.clear()
    answers: list[int] = []

    def request_summary() -> None:
        with httpx.Client(base_url=bench.server.url, timeout=60.0) as client:
            answers.append(client.get(f"{API}/runs/{CUT}/summary").status_code)

    threads = [threading.Thread(target=request_summary) for _ in range(24)]
    for asker in threads:
        asker.start()
    deadline = time.monotonic() + 60.0
    while len(answers) < 6 and time.monotonic() < deadline:
        time.sleep(0.01)
    assert answers == [503] * 6  # 2 run, 16 wait
    assert bench.get("/live").elapsed.total_seconds() < 30.0
    assert bench.get("/runs").status_code == 200
    bench.summaries.gate.set()
    for asker in threads:
        asker.join(60.0)
    assert answers.count(200) == 18


@pytest.fixture
def schema(bench: Bench) -> dict[str, Any]:
    document: dict[str, Any] = bench.client.get("/openapi.json").json()
    return document


def test_every_response_matches_its_schema(bench: Bench, schema: dict[str, Any]) -> None:
    def check(response: httpx.Response, path: str, status: int) -> None:
        assert response.status_code == status, response.text
        content = schema["paths"][API + path]["get"]["responses"][str(status)]["content"]
        media_type = response.headers["content-type"]
        assert list(content) == [media_type]
        assert schema_errors(response.json(), content[media_type]["schema"], schema["components"]["schemas"]) == []

    check(bench.get("/live"), "/live", 404)
    for update in make_live_updates(40)[::13]:
        bench.live.update = update
        check(bench.get("/live"), "/live", 200)
        check(bench.get("/live/curves"), "/live/curves", 200)
    bench.live.update = replace(update, snapshot=None, prediction=None)
    check(bench.get("/live"), "/live", 200)
    check(bench.get("/health"), "/health", 200)
    check(bench.get("/runs"), "/runs", 200)
    check(bench.get("/runs", limit=0), "/runs", 422)
    check(bench.get(f"/runs/{UNREADABLE}"), "/runs/{run}", 200)
    check(bench.get("/runs/none"), "/runs/{run}", 404)
    check(bench.get(f"/runs/{CUT}/summary"), "/runs/{run}/summary", 200)
    check(bench.get(f"/runs/{NEWEST}/summary"), "/runs/{run}/summary", 409)
    check(bench.get("/runs/none/summary"), "/runs/{run}/summary", 404)
    bench.summaries.trouble = ValueError("inside")
    check(bench.get(f"/runs/{CUT}/summary"), "/runs/{run}/summary", 500)
    bench.catalogue.trouble = StorageError("gone")
    check(bench.get("/runs"), "/runs", 503)


def test_schema_checker_finds_mismatches(schema: dict[str, Any]) -> None:
    schemas = schema["components"]["schemas"]
    health = {"health": "fine", "detail": 1, "version": "1", "uptime_s": 1.0, "runs": -1, "more": True}
    found = schema_errors(health, schemas["HealthSchema"], schemas)
    assert {fault.partition(":")[0].partition(" ")[0] for fault in found} == {
        "$.health", "$.detail", "$.runs", "$.live_run", "$.more",
    }  # fmt: skip


def test_openapi_schema_names_every_operation_and_resolves_every_reference(schema: dict[str, Any]) -> None:
    operations = [operation for path in schema["paths"].values() for operation in path.values()]
    names = [operation["operationId"] for operation in operations]
    assert len(set(names)) == len(names)
    assert {"list_runs", "get_run", "get_run_summary", "get_live_run", "stream_live_run", "get_health"} <= set(names)
    assert {tag for operation in operations for tag in operation["tags"]} == {tag["name"] for tag in schema["tags"]}
    text = json.dumps(schema)
    references = {part.split('"')[0] for part in text.split('"#/components/schemas/')[1:]}
    assert references <= set(schema["components"]["schemas"])
    assert "HTTPValidationError" not in text


def response_schemas(schema: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the object schemas of all responses, by name."""
    components = schema["components"]["schemas"]
    operations = [operation for path in schema["paths"].values() for operation in path.values()]
    pending, found = [json.dumps([operation["responses"] for operation in operations])], {}
    while pending:
        for name in re.findall(r'"#/components/schemas/(\w+)"', pending.pop()):
            if name not in found:
                found[name] = components[name]
                pending.append(json.dumps(components[name]))
    return {name: document for name, document in found.items() if "properties" in document}


def test_openapi_schema_describes_every_field_with_an_example(schema: dict[str, Any]) -> None:
    for name, document in response_schemas(schema).items():
        assert document["additionalProperties"] is False, name
        assert set(document["required"]) == set(document["properties"]), name
        for field, content in document["properties"].items():
            is_value = "$ref" not in json.dumps(content) or content.get("examples")
            assert content.get("description") or "$ref" in content, f"{name}.{field}"
            assert content.get("examples") or not is_value, f"{name}.{field}"


def test_openapi_schema_has_units_in_field_names(schema: dict[str, Any]) -> None:
    suffixes = {"µm": "_um", "r/min": ("_rpm", "_rpm_per_s"), "degrees": "_deg", "Hz": "_hz", "µs": "_us", "V": "_v"}
    for name, document in schema["components"]["schemas"].items():
        for field, content in document.get("properties", {}).items():
            words = content.get("description", "").replace(",", " ").replace(";", " ").split()
            if content.get("type") == "string" or "$ref" in content:
                continue
            for unit, suffix in suffixes.items():
                if unit in words:
                    assert field.endswith(suffix), f"{name}.{field}: {content['description']}"
