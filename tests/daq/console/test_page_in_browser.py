"""The operator's page in a real browser: values, banners, plots and forms."""

import re
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from starlette.types import ASGIApp, Receive, Scope, Send

from analysis.signals.header import Severity
from analysis.signals.units import MICROMETRE
from daq.service.app import create_app
from daq.service.server import ServiceServer
from daq.session.live_update import Clipping, LiveUpdate, RunState, TimedMarker
from recordings.mcap.results import Marker
from tests.daq.conftest import RigFactory
from tests.daq.support.driven_browser import driven_page
from tests.daq.support.live_updates import (
    make_live_updates,
    with_alarm,
    with_further_alarms,
    with_runout,
    with_second_whirl,
)
from tests.daq.support.recorded_bench import API, open_recorded_bench, record_run
from tests.daq.support.service_bench import Bench, fake_state, open_bench
from tests.daq.support.service_fakes import NEWEST

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = [pytest.mark.browser, pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")]

UPDATE = make_live_updates(200)[150]


@pytest.fixture
def bench() -> Iterator[Bench]:
    served = open_bench()
    yield served
    served.close()


def load_page(url: str, profile: Path) -> str:
    """Return the page's DOM after two seconds; assert that the console shows no errors."""
    command = [
        str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
        "--disable-background-networking", "--disable-component-update", "--disable-sync", f"--user-data-dir={profile}",
        "--virtual-time-budget=2000", "--enable-logging=stderr", "--dump-dom", url,
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    errors = [line for line in done.stderr.splitlines() if "CONSOLE" in line and not re.search("40[34]", line)]
    assert errors == []
    return done.stdout


def text_of(page: str, element: str) -> str:
    """Return the text of the element with this id."""
    found = re.search(rf'id="{element}"[^>]*>(.*?)</(?:b|p|h1|dd|span)>', page, re.DOTALL)
    assert found is not None, element
    return found[1]


def test_page_shows_measured_and_predicted_values_of_the_live_run(bench: Bench, tmp_path: Path) -> None:
    bench.live.update = UPDATE
    page = load_page(bench.server.url, tmp_path)
    assert 'data-state="recording"' in page
    assert text_of(page, "run") == NEWEST
    assert text_of(page, "speed") == "12,005"
    assert text_of(page, "whirl") == "0.49X"
    assert text_of(page, "whirl-model") == "0.70X"
    assert text_of(page, "model") == "ready, interpolated"
    assert text_of(page, "clock") == "00:15"
    assert text_of(page, "disk") == "41 h"
    assert text_of(page, "gap-x") == "5.10 V"
    assert page.count("<polyline") == 8  # two orbits; spectra of x, y and the model; overall x, y and speed over time


def test_page_shows_the_speed_of_an_exact_prediction(bench: Bench, tmp_path: Path) -> None:
    assert UPDATE.prediction is not None
    bench.live.update = replace(UPDATE, prediction=replace(UPDATE.prediction, is_exact=True))
    assert text_of(load_page(bench.server.url, tmp_path), "model") == "ready, exact at 12,005 r/min"


def test_page_draws_markers_in_the_trend_and_shows_the_marker_form_while_recording(
    bench: Bench, tmp_path: Path
) -> None:
    marker = TimedMarker(Marker(0, 100_000, "knocking begins", 0), 1.0, UPDATE.status.elapsed - 1.0)
    bench.live.update = replace(UPDATE, status=replace(UPDATE.status, markers=(marker,)))
    page = load_page(bench.server.url, tmp_path)
    assert re.search(r'class="flag word"', page)
    assert ">knocking begins</text>" in page
    assert re.search(r'<form class="marker-form" id="marker-form">', page)
    bench.live.update = replace(UPDATE, status=replace(UPDATE.status, state=RunState.REPLAYING))
    assert re.search(r'id="marker-form" hidden=""', load_page(bench.server.url, tmp_path))


def test_page_shows_a_latched_alarm_until_it_is_acknowledged(bench: Bench, tmp_path: Path) -> None:
    update = with_alarm(UPDATE, Severity.DANGER)
    bench.live.update = replace(update, status=replace(update.status, lost=2000, lost_is_exact=False))
    page = load_page(bench.server.url, tmp_path)
    assert text_of(page, "verdict") == "DANGER LATCHED"
    assert text_of(page, "alarm") == "▲ DANGER at x: 92 µm peak-to-peak, limit 90, began 00:10 at 12,000 r/min, over."
    assert re.search(r'<button id="acknowledge"[^>]*(?<!hidden="")>Acknowledge', page)
    assert text_of(page, "lost") == "≥ 2,000"
    assert re.search(r'id="lost-cell" class="bad"', page)


def test_page_colours_each_tile_by_the_alarms_of_its_quantity(bench: Bench, tmp_path: Path) -> None:
    bench.live.update = with_further_alarms(UPDATE)
    page = load_page(bench.server.url, tmp_path)
    tiles = {
        tile: re.search(rf'id="{tile}" data-severity="(\w+)"', page)
        for tile in ("speed-tile", "overall", "one", "below")
    }
    assert [None if found is None else found[1] for found in tiles.values()] == ["danger", "normal", "alarm", "alarm"]
    assert [text_of(page, of) for of in ("speed-verdict", "verdict", "one-verdict", "below-verdict")] == [
        "DANGER",
        "NORMAL",
        "ALARM LATCHED",
        "ALARM",
    ]
    assert text_of(page, "tacho").endswith("alarm 18,000 · danger 19,500 r/min")
    assert text_of(page, "one-note").endswith("alarm 20 · danger 30")
    assert re.fullmatch(r" · \d+ % of clearance", text_of(page, "clearance"))
    assert text_of(page, "whirls") == "alarm 13 together"
    assert text_of(page, "alarm").startswith("▲ speed DANGER: 19,642 r/min, limit 19,500, began 00:10")


def test_page_shows_data_quality_in_one_line(bench: Bench, tmp_path: Path) -> None:
    bench.live.update = UPDATE
    assert text_of(load_page(bench.server.url, tmp_path), "quality") == "✓ no samples lost · signals good"
    assert UPDATE.snapshot is not None
    doubtful = replace(UPDATE.snapshot, gap_in_window=np.array([True, False]), gap_volts=np.array([5.1, 0.02]))
    status = replace(UPDATE.status, lost=2000, clipped=(Clipping("y", 1234, 3, 12.0),))
    bench.live.update = replace(UPDATE, snapshot=doubtful, status=status)
    page = load_page(bench.server.url, tmp_path)
    assert text_of(page, "quality") == "▲ 2,000 samples lost · y clipped · probe y reads 0.02 V"
    assert 'class="quality bad"' in page


def test_page_shows_compensated_and_measured_vectors(bench: Bench, tmp_path: Path) -> None:
    bench.live.update = with_second_whirl(with_runout(UPDATE))
    page = load_page(bench.server.url, tmp_path)
    assert text_of(page, "one-source") == "compensated"
    note = text_of(page, "one-note")
    measured = UPDATE.snapshot.frame.vectors[0] if UPDATE.snapshot and UPDATE.snapshot.frame else None
    assert measured is not None
    assert f"as measured x {abs(measured[0]) / MICROMETRE:.1f} " in note
    assert "± 0.08 µm" in note
    assert text_of(page, "one-x") == f"{abs(measured[0] - 2e-6) / MICROMETRE:.0f}"
    assert text_of(page, "whirls") == "also 0.31X 3.2 µm backward"
    assert text_of(page, "whirl-note").endswith("± 0.07 µm")


def test_page_without_a_run_is_idle_and_lists_the_recorded_runs(bench: Bench, tmp_path: Path) -> None:
    page = load_page(bench.server.url, tmp_path)
    assert 'data-state="idle"' in page
    assert text_of(page, "speed") == "–"
    assert page.count("<details data-run") == 4
    assert "no MCAP file" in page


def test_page_shows_why_a_run_failed(bench: Bench, tmp_path: Path) -> None:
    bench.live.update = LiveUpdate(
        UPDATE.header, replace(UPDATE.status, state=RunState.FAILED, detail="card unplugged")
    )
    page = load_page(bench.server.url, tmp_path)
    assert 'data-state="failed"' in page
    assert "card unplugged" in text_of(page, "trouble")


class BlockedLive:
    """Application that blocks live requests of one kind, HTTP or WebSocket."""

    def __init__(self, app: ASGIApp, kind: str) -> None:
        self.app = app
        self.kind = kind

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == self.kind and scope["path"] in {"/api/v1/live", "/api/v1/live/socket"}:
            scope = {**scope, "path": "/nothing"}
        await self.app(scope, receive, send)


@pytest.mark.parametrize("blocked", ["http", "websocket"])
def test_page_follows_the_run_by_socket_or_by_polling_if_one_is_blocked(blocked: str, tmp_path: Path) -> None:
    state = fake_state(tmp_path / "data", UPDATE)
    server = ServiceServer(BlockedLive(create_app(state), blocked), closing=state.closing)
    server.start()
    try:
        page = load_page(server.url, tmp_path)
    finally:
        server.close()
    assert 'data-state="recording"' in page
    assert text_of(page, "speed") == "12,005"


class RequestLog:
    """Application that records the path of each request."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app
        self.requests: list[str] = []

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        self.requests.append(f"{scope['type']} {scope.get('path')}")
        await self.app(scope, receive, send)


def test_page_receives_the_curves_over_the_socket_and_does_not_poll(tmp_path: Path) -> None:
    state = fake_state(tmp_path / "data", UPDATE)
    log = RequestLog(create_app(state))
    server = ServiceServer(log, closing=state.closing)
    server.start()
    try:
        page = load_page(server.url, tmp_path)
    finally:
        server.close()
    assert 'class="curves"' in page
    assert log.requests.count("websocket /api/v1/live/curves/socket") == 1
    assert log.requests.count("http /api/v1/live/curves") <= 2, "only while the socket opens"


def test_page_imports_a_file(tmp_path: Path, rig: RigFactory) -> None:
    folder = tmp_path / "data"
    folder.mkdir()
    still = [{"time_s": 0.0, "speed_rpm": 3000.0}, {"time_s": 0.2, "speed_rpm": 3000.0}]
    record_run(rig(simulation={"profile": still}), folder)
    times = np.arange(4000) / 4000.0
    columns = (5 + np.cos(628.0 * times), 5 + np.sin(628.0 * times), np.where(np.cos(628.0 * times) > 0.9, 4.5, 0.2))
    file = tmp_path / "old bench.csv"
    np.savetxt(file, np.stack(columns, axis=1), delimiter=",", header="x [V],y [V],tacho [V]", comments="")
    bench = open_recorded_bench(folder)
    try:
        with driven_page(str(CHROMIUM), tmp_path / "profile", str(bench.client.base_url)) as page:
            page.until("!document.getElementById('importing').hidden")
            page.value("document.querySelector('#importing > summary').click()")
            page.until("document.getElementById('import-rig').options.length === 1")
            page.choose_file("import-file", file)
            page.until("!document.getElementById('import-form').hidden")
            chosen = "[...document.querySelectorAll('#import-columns select')].map(one => one.value).join()"
            assert page.value(chosen) == "x,V,y,V,tacho,V"
            page.value("document.getElementById('import-rate-value').value = '4000'")
            page.value("document.getElementById('import-comment').value = 'cold oil'")
            page.value("document.querySelector('#import-form button').click()")
            page.until("document.getElementById('import-note').textContent.startsWith('Imported as ')")
            page.until("document.querySelectorAll('#runs details').length === 2")
        runs = bench.client.get(f"{API}/runs", params={"text": "cold oil"}).json()["runs"]
        assert [(run["samples"], run["sample_rate_hz"], run["rig"]) for run in runs] == [(4000, 4000.0, "test-rig")]
    finally:
        bench.close()


def test_page_shows_plots_of_an_opened_run(tmp_path: Path, rig: RigFactory) -> None:
    record_run(rig(), tmp_path)
    bench = open_recorded_bench(tmp_path, host="0.0.0.0", token="open-sesame")  # noqa: S104, S106 - as another machine would reach it
    try:
        address = f"http://127.0.0.1:{bench.client.base_url.port}/"
        with driven_page(str(CHROMIUM), tmp_path / "profile", address) as page:
            page.value("document.getElementById('token-value').value = 'open-sesame'")
            page.value("document.getElementById('token').requestSubmit()")
            page.until("document.querySelector('#runs details') !== null")
            page.value("document.querySelector('#runs details').open = true")
            page.until("document.querySelectorAll('.plots button').length > 15")
            press = "[...document.querySelectorAll('.plots button')].find(one => one.textContent === '{}').click()"
            drawn = "(one => one !== null && one.naturalWidth)(document.querySelector('.plots img'))"
            page.value(press.format("Bode 1X"))
            page.until(f"{drawn} > 600")
            page.value("document.querySelector('.plots input').value = '19000'")
            page.value(press.format("1X orbit"))
            page.until("document.querySelector('.plots .note').textContent.includes('the run has them from')")
            page.value("document.querySelector('.plots input').value = ''")
            page.value(press.format("1X orbit"))
            page.until("document.querySelector('.plots img').alt.startsWith('1X orbit')")
    finally:
        bench.close()
