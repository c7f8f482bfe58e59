"""Web server for the page of the rerun viewer, on the chosen address only and without requests to other hosts.

rerun's own web server listens on all addresses, cannot be stopped, and its page requests fonts, news and telemetry.
Therefore its files are fetched once from a short-lived process and served here.
"""

import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from tempfile import TemporaryDirectory

from daq.errors import ServiceError

_FILES = ("index.html", "favicon.ico", "re_viewer.js", "re_viewer_bg.wasm")
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


def fetch_viewer_files(folder: Path, on_server_start: Callable[[subprocess.Popen[bytes]], None]) -> None:
    """Write the files of the web viewer of the installed rerun to a folder.

    Parameters
    ----------
    folder : Path
        The folder.
    on_server_start : callable
        Called with the short-lived server process; killing it cancels the fetch.

    Raises
    ------
    ServiceError
        The files are not available.
    """
    server = subprocess.Popen(  # noqa: S603 - this program's own interpreter and the text above
        [sys.executable, "-c", _SERVER_SCRIPT], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    watch = threading.Timer(_TIMEOUT, server.kill)
    watch.daemon = True  # must not delay the exit of the program
    watch.start()
    with server:
        try:
            on_server_start(server)
            port = server.stdout.readline().decode().strip() if server.stdout is not None else ""
            if not port.isdigit():
                raise ServiceError("the page of the live view is not available: rerun's web viewer did not start")
            deadline = time.monotonic() + _TIMEOUT
            for name in _FILES:
                (folder / name).write_bytes(_fetch(f"http://127.0.0.1:{port}/{name}", server, deadline))
        finally:
            watch.cancel()
            server.kill()


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


class _FileHandler(SimpleHTTPRequestHandler):
    """Request handler for the files of the viewer."""

    protocol_version = "HTTP/1.1"

    def __init__(self, policy: str, folder: str, *arguments: object) -> None:
        self._policy = policy
        super().__init__(*arguments, directory=folder)  # type: ignore[arg-type]  # socketserver hands them through

    def end_headers(self) -> None:
        """Add the headers that limit what the page may load."""
        self.send_header("Content-Security-Policy", self._policy)
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cache-Control", "no-cache")
        super().end_headers()

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base class's name
        """Log nothing, to keep the terminal free for the operator."""


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
        self._policy = ""
        try:
            self._http = ThreadingHTTPServer((host, port), self._handler)
        except OSError as error:
            reason = error.strerror or error
            raise ServiceError(
                f"port {port} on {host} for the live view's page: {reason}; choose another, or 0"
            ) from error
        self._http.daemon_threads = True
        self._folder = TemporaryDirectory(prefix="rig-viewer-")
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
        self._folder.cleanup()

    def _on_server_start(self, server: subprocess.Popen[bytes]) -> None:
        with self._changing:
            self._file_server = server
            if self._is_closing:
                server.kill()

    def _run(self) -> None:
        try:
            fetch_viewer_files(Path(self._folder.name), self._on_server_start)
        except (ServiceError, OSError) as error:
            self.failure = str(error)
            return
        finally:
            self._is_ready.set()
        self._http.serve_forever(0.2)

    def _handler(self, *arguments: object) -> BaseHTTPRequestHandler:
        return _FileHandler(self._policy, self._folder.name, *arguments)
