"""Live updates as events and over WebSocket, stopping a run, and access to both."""

import json
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from ipaddress import IPv4Address
from pathlib import Path

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from analysis.signals.header import Severity
from daq.schemas.live import LiveSchema
from daq.service.state import MAX_LIVE_CLIENTS
from tests.daq.support.live_updates import make_live_updates, with_alarm, with_further_alarms
from tests.daq.support.recorded_bench import API, RecordedBench, open_recorded_bench

WORD = "correct-horse"
UPDATES = make_live_updates(30)
NOTEBOOK = "http://notebook.lab:8888"
JSON = {"Content-Type": "application/json"}


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[RecordedBench]:
    served = open_recorded_bench(tmp_path, origins=(NOTEBOOK,))
    yield served
    served.close()


@pytest.fixture
def with_token(tmp_path: Path) -> Iterator[RecordedBench]:
    served = open_recorded_bench(tmp_path, host=str(IPv4Address(0)), token=WORD)
    yield served
    served.close()


def socket_url(bench: RecordedBench, path: str = "/live/socket") -> str:
    return f"ws://127.0.0.1:{bench.client.base_url.port}{API}{path}"


def test_events_follow_every_change_of_the_live_run(bench: RecordedBench) -> None:
    with bench.client.stream("GET", f"{API}/live/events") as response:
        assert response.headers["content-type"].startswith("text/event-stream")
        lines = response.iter_lines()
        assert [next(lines), next(lines), next(lines)] == ["event: live", "data: null", ""]
        for update in UPDATES[:3]:
            bench.live.update = update
            assert next(lines) == "event: live"
            document = LiveSchema.model_validate_json(next(lines).removeprefix("data: "))
            assert document.status.elapsed_s == pytest.approx(update.status.elapsed)
            assert next(lines) == ""


def test_socket_sends_the_current_values_and_then_changes(bench: RecordedBench) -> None:
    bench.live.update = UPDATES[0]
    with connect(socket_url(bench)) as socket:
        first = json.loads(socket.recv(60.0))
        assert first == bench.client.get(f"{API}/live").json()
        bench.live.update = UPDATES[1]
        assert json.loads(socket.recv(60.0))["measured"]["sample"] == 20_000
        bench.live.update = None
        assert json.loads(socket.recv(60.0)) is None


def test_curves_are_sent_as_events_and_over_the_socket(bench: RecordedBench) -> None:
    bench.live.update = UPDATES[0]
    with (
        connect(socket_url(bench, "/live/curves/socket")) as socket,
        bench.client.stream("GET", f"{API}/live/curves/events") as response,
    ):
        lines = response.iter_lines()
        first = json.loads(socket.recv(60.0))
        assert first == bench.client.get(f"{API}/live/curves").json()
        assert [next(lines), json.loads(next(lines).removeprefix("data: ")), next(lines)] == [
            "event: curves",
            first,
            "",
        ]
        same = UPDATES[0]
        bench.live.update = replace(same, status=replace(same.status, elapsed=99.0))
        with pytest.raises(TimeoutError):  # the curves do not change with the clock
            socket.recv(0.8)
        bench.live.update = UPDATES[-1]
        assert json.loads(socket.recv(60.0)) == bench.client.get(f"{API}/live/curves").json() != first
        bench.live.update = None
        assert json.loads(socket.recv(60.0)) is None


def test_slow_client_skips_updates_and_delays_no_other(bench: RecordedBench) -> None:
    with bench.client.stream("GET", f"{API}/live/events"), connect(socket_url(bench)) as quick:
        quick.recv(60.0)
        for update in UPDATES:
            bench.live.update = update
            assert json.loads(quick.recv(60.0))["status"]["elapsed_s"] == pytest.approx(update.status.elapsed)
        assert bench.client.get(f"{API}/live", timeout=60.0).status_code == 200


def test_client_above_the_limit_gets_busy(bench: RecordedBench) -> None:
    with ExitStack() as open_sockets:
        for _ in range(MAX_LIVE_CLIENTS):
            open_sockets.enter_context(connect(socket_url(bench))).recv(60.0)
        with pytest.raises(InvalidStatus) as refused:
            open_sockets.enter_context(connect(socket_url(bench)))
        assert refused.value.response.status_code == 503
        response = bench.client.get(f"{API}/live/events")
        assert (response.status_code, response.headers["retry-after"]) == (503, "2")


def test_service_stops_with_an_open_event_stream(tmp_path: Path) -> None:
    bench = open_recorded_bench(tmp_path)
    with connect(socket_url(bench)) as socket:
        socket.recv(60.0)
        started = time.monotonic()
        bench.close()
        assert time.monotonic() - started < 2.5


def test_head_of_an_event_stream_returns_at_once(bench: RecordedBench) -> None:
    assert bench.client.head(f"{API}/live/events").status_code == 200


def test_stop_request_stops_the_run(bench: RecordedBench) -> None:
    assert bench.client.post(f"{API}/live/stop", json={}).status_code == 404
    bench.live.update = UPDATES[0]
    response = bench.client.post(f"{API}/live/stop", json={})
    assert (response.status_code, response.json()) == (202, {"run": UPDATES[0].header.run})
    assert bench.live.stopped == [UPDATES[0].header.run]


def test_alarms_of_1x_below_1x_and_speed_have_their_own_units(bench: RecordedBench) -> None:
    bench.live.update = with_further_alarms(UPDATES[0])
    live = bench.client.get(f"{API}/live").json()
    one, below, speed = live["status"]["alarms"]
    assert (one["quantity"], one["probe"], one["limit_peak_um"], one["largest_peak_um"]) == ("1X", "x", 20.0, 24.04)
    assert one["limit_peak_to_peak_um"] is one["limit_rpm"] is None
    assert (below["name"], below["message"]) == ("below 1X alarm at y", "14.1 µm peak, limit 12.5")
    assert (speed["quantity"], speed["probe"], speed["limit_rpm"], speed["largest_rpm"]) == (
        "speed",
        None,
        19_500.0,
        19_642.0,
    )
    assert (speed["name"], speed["message"]) == ("speed danger", "19,642 r/min, limit 19,500")
    assert live["limits"]["order_1x_peak_danger_um"] == 30.0
    assert live["limits"]["below_1x_peak_danger_um"] is None
    assert live["limits"]["speed_alarm_rpm"] == 18_000.0


def test_alarms_are_reported_and_acknowledged(bench: RecordedBench) -> None:
    assert bench.client.post(f"{API}/live/acknowledge", json={}).status_code == 404
    bench.live.update = with_alarm(UPDATES[0], Severity.DANGER)
    (alarm,) = bench.client.get(f"{API}/live").json()["status"]["alarms"]
    assert (alarm["probe"], alarm["severity"], alarm["limit_peak_to_peak_um"]) == ("x", "danger", 90.0)
    assert (alarm["begin"]["time_s"], alarm["end"]["time_s"]) == (10.0, 12.0)
    response = bench.client.post(f"{API}/live/acknowledge", json={})
    assert (response.status_code, response.json()["alarms"]) == (200, [alarm])
    assert bench.client.post(f"{API}/live/acknowledge", json={"who": "me"}).status_code == 422


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 415),
        ({"Content-Type": "text/plain"}, 415),
        ({"Content-Type": "application/x-www-form-urlencoded"}, 415),
        ({**JSON, "Origin": "http://evil.example"}, 403),
        ({**JSON, "Origin": "null"}, 403),
        ({**JSON, "Origin": "http://127.0.0.1:1"}, 403),
        ({**JSON, "Sec-Fetch-Site": "cross-site-request"}, 403),
        ({**JSON, "Sec-Fetch-Site": "same-site"}, 403),
        ({**JSON, "Sec-Fetch-Site": "same-origin"}, 202),
        ({**JSON, "Origin": NOTEBOOK}, 202),
    ],
)
def test_only_the_service_s_own_page_may_stop_a_run(bench: RecordedBench, headers: dict[str, str], status: int) -> None:
    bench.live.update = UPDATES[0]
    response = bench.client.post(f"{API}/live/stop", headers=headers, content=b"{}")
    assert response.status_code == status
    assert bool(bench.live.stopped) == (status == 202)


def test_page_of_another_site_cannot_open_a_socket(bench: RecordedBench) -> None:
    with pytest.raises(InvalidStatus) as refused, connect(socket_url(bench), origin=Origin("http://evil.example")):
        pass
    assert refused.value.response.status_code == 403


@pytest.mark.parametrize("protocols", [[], ["rig.live"], ["rig.live", "token.wrong"]])
def test_socket_without_the_token_is_refused_without_terminal_output(
    with_token: RecordedBench, protocols: list[str], caplog: pytest.LogCaptureFixture
) -> None:
    offered = [Subprotocol(name) for name in protocols] or None
    with pytest.raises(InvalidStatus) as refused, connect(socket_url(with_token), subprotocols=offered):
        pass
    assert refused.value.response.status_code == 401
    with_token.client.get(f"{API}/health")  # all log records are written by now
    assert caplog.records == []


def test_socket_accepts_the_token_as_header_or_subprotocol(with_token: RecordedBench) -> None:
    with connect(socket_url(with_token), additional_headers={"Authorization": f"Bearer {WORD}"}) as socket:
        assert socket.recv(60.0) == "null"
    protocols = [Subprotocol("rig.live"), Subprotocol(f"token.{WORD}")]
    with connect(socket_url(with_token), subprotocols=protocols) as socket:
        assert socket.subprotocol == "rig.live"
        assert socket.recv(60.0) == "null"


def test_cors_headers_are_sent_only_to_configured_sites(bench: RecordedBench, with_token: RecordedBench) -> None:
    preflight = {"Origin": NOTEBOOK, "Access-Control-Request-Method": "POST"}
    assert bench.client.options(f"{API}/live/stop", headers=preflight).status_code == 200
    answer = bench.client.get(f"{API}/runs", headers={"Origin": NOTEBOOK})
    assert answer.headers["access-control-allow-origin"] == NOTEBOOK
    for served, origin in ((bench, "http://evil.example"), (with_token, NOTEBOOK)):
        answer = served.client.get(f"{API}/runs", headers={"Origin": origin, "Authorization": f"Bearer {WORD}"})
        assert "access-control-allow-origin" not in answer.headers
