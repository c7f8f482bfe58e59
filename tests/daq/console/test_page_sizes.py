"""The operator's page at window sizes from a telephone to a bench screen."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from analysis.signals.header import Severity
from daq.session.live_update import LiveUpdate
from tests.daq.support.driven_browser import Page, driven_page
from tests.daq.support.live_updates import make_live_updates, with_alarm
from tests.daq.support.recorded_bench import open_recorded_bench
from tests.daq.support.service_bench import Bench, open_bench

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = [pytest.mark.browser, pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")]

UPDATE = with_alarm(make_live_updates(200)[150], Severity.DANGER)
STATE = {True: "idle", False: "recording"}
# Layout errors of visible tiles, banners and bars: outside the window, overlapping, or with clipped text.
LAYOUT_ERRORS = """(() => {
  const parts = [...document.querySelectorAll('.tile, .view, .status, .banner, .runs details')];
  const boxes = parts.filter((one) => one.offsetParent)
    .map((one) => [one.id || one.className, one.getBoundingClientRect(), one]);
  const faults = document.documentElement.scrollWidth > innerWidth ? ['the page is wider than the window'] : [];
  for (const [name, box, node] of boxes) {
    if (box.right > innerWidth + 1) faults.push(`${name} sticks out`);
    if (node.matches('.tile, .status') && node.scrollHeight > node.clientHeight + 3) faults.push(`${name} is cut`);
    for (const [other, its] of boxes) {
      const beside = box.right <= its.left + 1 || its.right <= box.left + 1;
      const above = box.bottom <= its.top + 1 || its.bottom <= box.top + 1;
      if (other !== name && !beside && !above) faults.push(`${name} lies over ${other}`);
    }
  }
  return faults;
})()"""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with driven_page(str(CHROMIUM), tmp_path_factory.mktemp("profile"), "about:blank") as one:
        yield one


@pytest.fixture
def bench() -> Iterator[Bench]:
    served = open_bench()
    yield served
    served.close()


def load(page: Page, bench: Bench, update: LiveUpdate | None) -> None:
    """Load the page with a run in progress, or none, and wait until it is drawn."""
    bench.live.update = update
    page.show(bench.server.url)
    page.until(f"document.querySelector('#runs details') && document.body.dataset.state === '{STATE[update is None]}'")


@pytest.mark.parametrize("size", [(390, 844), (844, 390), (768, 1024), (1024, 768), (1366, 768), (1920, 1080)])
def test_page_has_no_layout_errors(size: tuple[int, int], page: Page, bench: Bench) -> None:
    page.resize(*size)
    for update in (None, UPDATE):
        load(page, bench, update)
        assert page.value(LAYOUT_ERRORS) == []


def test_page_without_a_run_starts_with_the_recorded_runs(page: Page, bench: Bench) -> None:
    page.resize(1366, 768)
    load(page, bench, None)
    assert page.value("document.querySelector('#runs details').getBoundingClientRect().bottom < innerHeight")


def test_bench_screen_shows_all_live_values_without_scrolling(page: Page, bench: Bench) -> None:
    for size in ((1366, 768), (1920, 1080)):
        page.resize(*size)
        load(page, bench, UPDATE)
        assert page.value("document.getElementById('status').getBoundingClientRect().bottom <= innerHeight")


def test_page_without_a_run_does_not_poll_while_its_socket_is_open(page: Page, bench: Bench) -> None:
    load(page, bench, None)
    page.until("performance.now() > 2500")
    polls = "performance.getEntriesByType('resource').filter((one) => one.name.endsWith('/live')).length"
    assert page.value(polls) == 0
    assert page.value("document.getElementById('connection').hidden")
    bench.live.update = UPDATE
    page.until("document.body.dataset.state === 'recording'")


def test_page_reports_a_lost_connection_with_and_without_a_run(page: Page) -> None:
    for update in (None, UPDATE):
        bench = open_bench()
        try:
            load(page, bench, update)
        finally:
            bench.close()
        page.until("document.getElementById('connection').offsetParent !== null")
        text = page.value("document.getElementById('connection').textContent")
        assert text.startswith("CONNECTION LOST: no response from the service for 00:")


def test_page_rejects_a_wrong_token_and_accepts_the_right_one(page: Page) -> None:
    token = "two words"  # noqa: S105 - no valid subprotocol name, so that no socket can send it
    bench = open_bench(token=token)
    try:
        page.show(bench.server.url)
        page.until("document.getElementById('token').offsetParent !== null")
        for typed, then in (
            ("wrong", "textContent.startsWith('The token is wrong')"),
            (token, "offsetParent === null"),
        ):
            page.value(f"document.getElementById('token-value').value = '{typed}'")
            page.value("document.querySelector('#token button').click()")
            page.until(f"document.getElementById('token-label').{then}")
        page.until("document.querySelector('#runs details') !== null")
    finally:
        bench.close()


def test_stop_button_stops_the_run_on_the_second_press_only(page: Page, tmp_path: Path) -> None:
    bench = open_recorded_bench(tmp_path)
    try:
        bench.live.update = UPDATE
        page.show(str(bench.client.base_url))
        page.until("!document.getElementById('stop').hidden")
        page.value("document.getElementById('stop').click()")
        page.until("document.getElementById('stop').textContent === 'Press again to stop'")
        assert bench.live.stopped == []
        page.value("document.getElementById('stop').click()")
        page.until("document.getElementById('stop').textContent === 'Stopping …'")
        assert bench.live.stopped == [UPDATE.header.run]
    finally:
        bench.close()
