"""Web server for the page of the rerun viewer, on the chosen address only and without requests to other hosts.

rerun's own web server listens on all addresses, cannot be stopped, and its page requests fonts, news and telemetry.
Therefore its files are fetched once from a short-lived process and served here.
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
_TIMEOUT = 60.0  # s, for the short-lived process
_SERVER_SCRIPT = """
import socket, sys
import rerun
with socket.create_server(("127.0.0.1", 0)) as free:
    port = free.getsockname()[1]
rerun.serve_web_viewer(web_port=port, open_browser=False)
print(port, flush=True)
sys.stdin.read()
"""


def viewer_files(on_server_start: Callable[[subprocess.Popen[bytes]], None] = lambda _: None) -> dict[str, bytes]:
    """Return the files of the web viewer of the installed rerun, by name.

    Parameters
    ----------
    lent : callable, optional
        Called with the short-lived server process, where one is needed; killing it cancels the fetch.

    Raises
    ------
    ServiceError
        The files are not available.
    """
    spec = importlib.util.find_spec("rerun")
    archive = Path(str(spec.origin)).parent / "web_viewer.zip" if spec is not None else None
    if archive is not None and archive.is_file():  # some rerun packages contain them as an archive
        with zipfile.ZipFile(archive) as packed:
            return {name: packed.read(name) for name in _TYPES}
    server = subprocess.Popen(  # noqa: S603 - this program's own interpreter and the text above
        [sys.executable, "-c", _SERVER_SCRIPT], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    with server:
        try:
            on_server_start(server)
            return _fetch_files(server)
        finally:
            server.kill()


def _fetch_files(server: subprocess.Popen[bytes]) -> dict[str, bytes]:
    """Fetch the files from rerun's web server in a process that prints its port."""
    watch = threading.Timer(_TIMEOUT, server.kill)
    watch.daemon = True  # must not delay the exit of the program
    watch.start()
    try:
        port = server.stdout.readline().decode().strip() if server.stdout is not None else ""
        if not port.isdigit():
            raise ServiceError("the page of the live view is not available: rerun's web viewer did not start")
        deadline = time.monotonic() + _TIMEOUT
        return {name: _fetch(f"http://127.0.0.1:{port}/{name}", server, deadline) for name in _TYPES}
    finally:
        watch.cancel()


def _fetch(url: str, server: subprocess.Popen[bytes], deadline: float) -> bytes:
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    while True:
        try:
            with opener.open(url, timeout=10.0) as response:
                return bytes(response.read())
        except (urllib.error.URLError, ConnectionError) as error:
            if time.monotonic() > deadline or server.poll() is not None:
                raise ServiceError(f"the page of the live view is not available: {error}") from error
            time.sleep(0.05)


class _FileHandler(BaseHTTPRequestHandler):
    """Request handler for the files of the viewer."""

    protocol_version = "HTTP/1.1"

    def __init__(self, files: Mapping[str, bytes], policy: str, *arguments: object) -> None:
        self._files = files
        self._policy = policy
        super().__init__(*arguments)  # type: ignore[arg-type]  # socketserver hands them through

    def do_GET(self) -> None:
        """Send the file."""
        self._respond(body=True)

    def do_HEAD(self) -> None:
        """Send the headers of the file."""
        self._respond(body=False)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base class's name
        """Log nothing, to keep the terminal free for the operator."""

    def _respond(self, *, body: bool) -> None:
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
    """Web server of the viewer's page.

    It listens at once; requests wait until `serve`.

    Parameters
    ----------
    host : str
        Address to listen on.
    port : int
        Port; 0 takes a free one.

    Raises
    ------
    ServiceError
        The port is not available.
    """

    def __init__(self, host: str, port: int) -> None:
        self._files: dict[str, bytes] = {}
        self._policy = ""
        try:
            self._http = ThreadingHTTPServer((host, port), self._handler)
        except OSError as error:
            reason = error.strerror or error
            raise ServiceError(
                f"port {port} on {host} for the live view's page: {reason}; choose another, or 0"
            ) from error
        self._http.daemon_threads = True
        self._thread: threading.Thread | None = None
        self._is_ready = threading.Event()
        self._changing = threading.Lock()
        self._is_closing = False
        self._file_server: subprocess.Popen[bytes] | None = None
        self.failure = ""

    @property
    def port(self) -> int:
        """Port of the server."""
        return int(self._http.server_address[1])

    def serve(self, data_origins: list[str]) -> None:
        """Start serving in a thread; the page may connect to ``data_origins`` only."""
        self._policy = (
            "default-src 'self'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; "
            "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; worker-src 'self' blob:; "
            f"connect-src 'self' {' '.join(data_origins)}"
        )
        self._thread = threading.Thread(target=self._run, name="live view's page", daemon=True)
        self._thread.start()

    def wait(self, timeout: float) -> bool:
        """Wait at most ``timeout`` s until requests are served; return whether they are."""
        return self._is_ready.wait(timeout) and not self.failure

    def cancel_fetch(self) -> None:
        """Stop the process that the files are fetched from, if it still runs."""
        with self._changing:
            self._is_closing = True
            if self._file_server is not None:
                self._file_server.kill()

    def close(self) -> None:
        """Stop, and free the port."""
        self.cancel_fetch()
        if self._thread is not None:
            self._is_ready.wait()
            if not self.failure:
                self._http.shutdown()
            self._thread.join()
            self._thread = None
        self._http.server_close()

    def _on_server_start(self, server: subprocess.Popen[bytes]) -> None:
        with self._changing:
            self._file_server = server
            if self._is_closing:
                server.kill()

    def _run(self) -> None:
        try:
            self._files = viewer_files(self._on_server_start)
        except (ServiceError, OSError) as error:
            self.failure = str(error)
            return
        finally:
            self._is_ready.set()
        self._http.serve_forever(0.2)

    def _handler(self, *arguments: object) -> BaseHTTPRequestHandler:
        return partial(_FileHandler, self._files, self._policy)(*arguments)
