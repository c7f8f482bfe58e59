"""The page in windows from a telephone's to a bench screen's."""

import shutil
from collections.abc import Iterator

import pytest

from analysis.run import Severity
from tests.daq.devtools import Browser
from tests.daq.frames import make_frames, with_alarm
from tests.daq.service_bench import Bench, open_bench

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = [pytest.mark.browser, pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium here")]

FRAME = with_alarm(make_frames(200)[150], Severity.DANGER)
LISTED = "document.querySelector('#runs details')"
# Of every tile, banner and bar in sight: which stick out of the window, which lie over another, whose words are cut.
FAULTS = """(() => {
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
def browser() -> Iterator[Browser]:
    with Browser(str(CHROMIUM)) as one:
        yield one


@pytest.fixture
def bench() -> Iterator[Bench]:
    served = open_bench()
    yield served
    served.close()


@pytest.mark.parametrize("size", [(390, 844), (844, 390), (768, 1024), (1024, 768), (1366, 768), (1920, 1080)])
def test_nothing_sticks_out_is_cut_or_lies_over_something_else(
    size: tuple[int, int], browser: Browser, bench: Bench
) -> None:
    browser.resize(*size)
    for frame in (None, FRAME):
        bench.live.frame = frame
        browser.open(bench.server.url)
        browser.wait(f"{LISTED} && body.dataset.state === '{'recording' if frame else 'idle'}'")
        assert browser.evaluate(FAULTS) == []


def test_page_without_a_run_begins_with_the_recorded_ones(browser: Browser, bench: Bench) -> None:
    browser.resize(1366, 768)
    browser.open(bench.server.url)
    browser.wait(f"{LISTED} && body.dataset.state === 'idle'")
    assert browser.evaluate("document.querySelector('#runs details').getBoundingClientRect().bottom < innerHeight")


def test_bench_screen_shows_all_that_goes_on_without_scrolling(browser: Browser, bench: Bench) -> None:
    bench.live.frame = FRAME
    for size in ((1366, 768), (1920, 1080)):
        browser.resize(*size)
        browser.open(bench.server.url)
        browser.wait(f"{LISTED} && body.dataset.state === 'recording'")
        assert browser.evaluate("document.getElementById('status').getBoundingClientRect().bottom <= innerHeight")
