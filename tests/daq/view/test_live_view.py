"""Live view: non-blocking offer, dropped updates, clean shutdown."""

import importlib.util
import os
import platform
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast
from urllib.parse import parse_qs, urlsplit

import psutil
import pytest
from rerun.experimental import ViewerClient

from analysis.signals.header import RunHeader
from daq.errors import ServiceError
from daq.session.live_update import LiveUpdate
from daq.view import open_live_view
from daq.view.live_view import LiveView
from tests.daq.support.live_updates import make_header, make_live_updates

_LAVAPIPE = Path("/usr/share/vulkan/icd.d") / f"lvp_icd.{platform.machine()}.json"


class StallingHeader:
    """Run header that blocks access to its name until the gate opens, to stall drawing."""

    def __init__(self) -> None:
        self.gate = threading.Event()
        self._header = make_header()

    def __getattr__(self, name: str) -> Any:
        if name == "run":
            self.gate.wait(30.0)
        return getattr(self._header, name)


class BrokenHeader:
    """A run's header that has nothing."""


@pytest.fixture
def view() -> Iterator[LiveView]:
    live = LiveView()
    assert live.wait_ready(60.0), live.failure
    yield live
    live.close(60.0)


def _drawn(view: LiveView, updates: list[LiveUpdate]) -> None:
    """Offer frames one after the other, each as soon as the one before was taken."""
    for update in updates:
        view.offer(update)
        deadline = time.monotonic() + 60.0
        while view.waiting and time.monotonic() < deadline:
            time.sleep(0.002)


def _is_taken(port: int) -> bool:
    try:
        socket.create_server(("127.0.0.1", port)).close()
    except OSError:
        return True
    return False


def test_url_opens_viewer_with_data_and_without_welcome_screen(view: LiveView) -> None:
    parts = urlsplit(view.url)
    query = parse_qs(parts.query)
    assert parts.hostname == "127.0.0.1"
    assert query["url"] == [view.viewer_url]
    assert query["hide_welcome_screen"] == ["1"]
    assert query["theme"] == ["dark"]
    with urllib.request.urlopen(view.url, timeout=60.0) as answer:  # noqa: S310 - our own address
        assert b"<html" in answer.read()


def test_page_may_connect_to_its_data_only(view: LiveView) -> None:
    with urllib.request.urlopen(view.url, timeout=60.0) as answer:  # noqa: S310 - our own address
        policy = dict(part.strip().split(" ", 1) for part in answer.headers["Content-Security-Policy"].split(";"))
    assert policy["default-src"] == "'self'"
    port = urlsplit(view.viewer_url).port
    allowed = {f"http://{name}:{port}" for name in ("127.0.0.1", "localhost")}
    assert set(policy["connect-src"].split()) == {"'self'", *allowed}


def test_page_server_serves_viewer_files_only(view: LiveView) -> None:
    page = view.url.partition("?")[0]
    request = urllib.request.Request(f"{page}re_viewer_bg.wasm", method="HEAD")  # noqa: S310 - our own address
    with urllib.request.urlopen(request, timeout=60.0) as answer:  # noqa: S310 - our own address
        assert answer.headers["Content-Type"] == "application/wasm"
        assert int(answer.headers["Content-Length"]) > 1_000_000
    with pytest.raises(urllib.error.HTTPError, match="404"):
        urllib.request.urlopen(f"{page}../pyproject.toml", timeout=60.0)  # noqa: S310 - our own address


def test_fast_updates_are_replaced_and_counted(view: LiveView) -> None:
    for update in make_live_updates(50):
        view.offer(update)
    deadline = time.monotonic() + 60.0
    while view.waiting and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not view.failure
    assert 0 < view.dropped < 50


def test_offer_returns_at_once_while_drawing_is_stalled(view: LiveView) -> None:
    header = StallingHeader()
    update = replace(make_live_updates(1)[0], header=cast("RunHeader", header))
    started = time.perf_counter()
    for _ in range(2_000):
        view.offer(update)
    took = time.perf_counter() - started
    assert took < 20.0  # of the 30 s that the first is held up
    assert view.dropped >= 1_990
    assert not view.close(0.1)
    header.gate.set()
    assert view.close(60.0)


def test_close_stops_thread_and_frees_data_port() -> None:
    view = LiveView()
    port = urlsplit(view.viewer_url).port
    assert port
    view.offer(make_live_updates(1)[0])
    assert view.close(60.0)
    assert not [thread for thread in threading.enumerate() if thread.name == "live view"]
    deadline = time.monotonic() + 60.0
    while _is_taken(port) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not _is_taken(port)


@pytest.mark.skipif(sys.platform == "win32", reason="no such signal there")
def test_close_does_not_wait_for_stalled_file_server() -> None:
    view = LiveView()
    deadline = time.monotonic() + 60.0
    while not (
        lenders := [one for one in psutil.Process().children() if "serve_web_viewer" in " ".join(one.cmdline())]
    ):
        assert time.monotonic() < deadline
        time.sleep(0.001)
    lenders[0].suspend()
    assert view.close(60.0)
    assert not lenders[0].is_running()


def test_close_is_idempotent() -> None:
    view = LiveView()
    assert view.close(60.0)
    assert view.close(60.0)


def test_drawing_error_is_reported_and_offer_still_returns(view: LiveView) -> None:
    view.offer(replace(make_live_updates(1)[0], header=cast("RunHeader", BrokenHeader())))
    deadline = time.monotonic() + 60.0
    while not view.failure and time.monotonic() < deadline:
        time.sleep(0.01)
    assert view.failure.startswith("the live view stopped: ")
    view.offer(make_live_updates(1)[0])


def test_occupied_port_is_reported_with_number() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ServiceError, match=f"port {port} on 127.0.0.1"):
            LiveView(grpc_port=port)


def test_missing_rerun_is_reported_with_install_command() -> None:
    program = (
        "import sys; sys.modules['rerun'] = None\n"
        "from daq.errors import ServiceError\n"
        "from daq.view import open_live_view\n"
        "try: open_live_view()\n"
        "except ServiceError as error: print(error)\n"
    )
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60.0)
    assert "pip install .[view]" in said.stdout


def test_open_live_view_returns_working_view() -> None:
    view = open_live_view()
    try:
        _drawn(view, make_live_updates(3))
        assert not view.failure
    finally:
        assert view.close(60.0)


@pytest.mark.browser
def test_native_viewer_draws_two_runs_without_warnings(view: LiveView, tmp_path: Path) -> None:
    if not _LAVAPIPE.is_file():
        if os.environ.get("CI"):
            pytest.fail(f"{_LAVAPIPE} is missing: install mesa-vulkan-drivers")
        pytest.skip(f"no software Vulkan ({_LAVAPIPE}): install mesa-vulkan-drivers")
    spec = importlib.util.find_spec("rerun_cli")
    assert spec is not None
    assert spec.submodule_search_locations is not None
    program = Path(next(iter(spec.submodule_search_locations))) / "rerun"
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    os.environ.setdefault("VK_ICD_FILENAMES", str(_LAVAPIPE))
    with ViewerClient.spawn(headless=True, port=port, hide_welcome_screen=True, executable_path=str(program)) as viewer:
        viewer.open(view.viewer_url)
        for run in ("first", "second"):
            header = make_header(run)
            _drawn(view, [replace(update, header=header) for update in make_live_updates(20)])
        assert not view.failure
        deadline = time.monotonic() + 60.0
        while len(viewer.get_state().views) < 6 and time.monotonic() < deadline:
            time.sleep(0.2)
        views = viewer.get_state().views
        assert len(views) >= 6
        assert [(each.name, each.reports) for each in views if each.reports] == []
        picture = tmp_path / "view.png"
        viewer.save_screenshot(str(picture))
        assert picture.stat().st_size > 20_000
        viewer.quit()
