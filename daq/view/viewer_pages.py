"""The viewer's page, served where it was asked for and nowhere else, and kept from calling the outside world.

rerun's own web server listens on every address of the machine, cannot be stopped, and its page asks for founts, news
and telemetry. So the files are taken from it once, by a short-lived process of its own, and served from here.
"""

import contextlib
import importlib.util
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
import zipfile
from collections.abc import Callable, Mapping
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from daq.errors import ServiceError

_TYPES = {
    "index.html": "text/html; charset=utf-8",
    "favicon.ico": "image/x-icon",
    "re_viewer.js": "text/javascript; charset=utf-8",
    "re_viewer_bg.wasm": "application/wasm",
}
_PATIENCE = 60.0  # s for the short-lived process
_LOANER = """
import socket, sys
import rerun
with socket.create_server(("127.0.0.1", 0)) as free:
    port = free.getsockname()[1]
rerun.serve_web_viewer(web_port=port, open_browser=False)
print(port, flush=True)
sys.stdin.read()
"""


def viewer_files(lent: Callable[[subprocess.Popen[bytes]], None] = lambda _: None) -> dict[str, bytes]:
    """Return the files of the viewer that belongs to the installed rerun, by name.

    Parameters
    ----------
    lent : callable, optional
        Told of the process that lends them, where one is needed; who kills it ends the borrowing.

    Raises
    ------
    ServiceError
        They cannot be had.
    """
    spec = importlib.util.find_spec("rerun")
    archive = Path(str(spec.origin)).parent / "web_viewer.zip" if spec is not None else None
    if archive is not None and archive.is_file():  # some of rerun's packages hold them so
        with zipfile.ZipFile(archive) as packed:
            return {name: packed.read(name) for name in _TYPES}
    loaner = subprocess.Popen(  # noqa: S603 - this program's own interpreter and the text above
        [sys.executable, "-c", _LOANER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    with loaner:
        try:
            lent(loaner)
            return _borrowed(loaner)
        finally:
            loaner.kill()


def _borrowed(loaner: subprocess.Popen[bytes]) -> dict[str, bytes]:
    """Fetch the files from rerun's web server in a process that prints its port."""
    watch = threading.Timer(_PATIENCE, loaner.kill)
    watch.daemon = True  # it must not hold up the end of the program
    watch.start()
    try:
        port = loaner.stdout.readline().decode().strip() if loaner.stdout is not None else ""
        if not port.isdigit():
            raise ServiceError("the live view's page cannot be had: rerun's web viewer did not start")
        deadline = time.monotonic() + _PATIENCE
        return {name: _fetched(f"http://127.0.0.1:{port}/{name}", loaner, deadline) for name in _TYPES}
    finally:
        watch.cancel()


def _fetched(url: str, loaner: subprocess.Popen[bytes], deadline: float) -> bytes:
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    while True:
        try:
            with opener.open(url, timeout=10.0) as answer:
                return bytes(answer.read())
        except (urllib.error.URLError, ConnectionError) as error:
            if time.monotonic() > deadline or loaner.poll() is not None:
                raise ServiceError(f"the live view's page cannot be had: {error}") from error
            time.sleep(0.05)


class _Answer(BaseHTTPRequestHandler):
    """Answers one request for a file of the viewer."""

    protocol_version = "HTTP/1.1"

    def __init__(self, files: Mapping[str, bytes], policy: str, *arguments: object) -> None:
        self._files = files
        self._policy = policy
        super().__init__(*arguments)  # type: ignore[arg-type]  # socketserver hands them through

    def do_GET(self) -> None:
        """Answer with the file."""
        self._answer(body=True)

    def do_HEAD(self) -> None:
        """Answer with the file's size."""
        self._answer(body=False)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base class's name
        """Say nothing: the terminal is the operator's."""

    def _answer(self, *, body: bool) -> None:
        name = self.path.partition("?")[0].lstrip("/") or "index.html"
        content = self._files.get(name)
        self.send_response(404 if content is None else 200)
        self.send_header("Content-Type", _TYPES.get(name, "text/plain; charset=utf-8"))
        self.send_header("Content-Length", str(len(content or b"")))
        self.send_header("Content-Security-Policy", self._policy)
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cache-Control", "no-cache")
        self.end_headers()
        if body and content is not None:
            with contextlib.suppress(ConnectionError):  # the browser went away
                self.wfile.write(content)


class ViewerPages:
    """Serves the viewer's page.

    The port is listened on at once; requests wait until `serve`.

    Parameters
    ----------
    host : str
        Address to listen on.
    port : int
        Port; 0 takes a free one.

    Raises
    ------
    ServiceError
        The port cannot be listened on.
    """

    def __init__(self, host: str, port: int) -> None:
        self._files: dict[str, bytes] = {}
        self._policy = ""
        try:
            self._server = ThreadingHTTPServer((host, port), self._handler)
        except OSError as error:
            reason = error.strerror or error
            raise ServiceError(
                f"port {port} on {host} for the live view's page: {reason}; choose another, or 0"
            ) from error
        self._server.daemon_threads = True
        self._thread: threading.Thread | None = None
        self._begun = threading.Event()
        self._changing = threading.Lock()
        self._is_closing = False
        self._loaner: subprocess.Popen[bytes] | None = None
        self.failure = ""

    @property
    def port(self) -> int:
        """Port it listens on."""
        return int(self._server.server_address[1])

    def serve(self, data_origins: list[str]) -> None:
        """Begin to answer soon, with a page that may talk to ``data_origins`` and to nobody else."""
        self._policy = (
            "default-src 'self'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; "
            "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; worker-src 'self' blob:; "
            f"connect-src 'self' {' '.join(data_origins)}"
        )
        self._thread = threading.Thread(target=self._run, name="live view's page", daemon=True)
        self._thread.start()

    def wait(self, timeout: float) -> bool:
        """Wait until requests are answered, at most ``timeout`` s; returns whether they are."""
        return self._begun.wait(timeout) and not self.failure

    def give_up(self) -> None:
        """End the process that lends the files, if it still does: nobody waits for them any more."""
        with self._changing:
            self._is_closing = True
            if self._loaner is not None:
                self._loaner.kill()

    def close(self) -> None:
        """End, and free the port."""
        self.give_up()
        if self._thread is not None:
            self._begun.wait()
            if not self.failure:
                self._server.shutdown()
            self._thread.join()
            self._thread = None
        self._server.server_close()

    def _lent(self, loaner: subprocess.Popen[bytes]) -> None:
        with self._changing:
            self._loaner = loaner
            if self._is_closing:
                loaner.kill()

    def _run(self) -> None:
        try:
            self._files = viewer_files(self._lent)
        except (ServiceError, OSError) as error:
            self.failure = str(error)
            return
        finally:
            self._begun.set()
        self._server.serve_forever(0.2)

    def _handler(self, *arguments: object) -> BaseHTTPRequestHandler:
        return partial(_Answer, self._files, self._policy)(*arguments)
