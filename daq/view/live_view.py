"""Live view: a rerun server fed by a separate thread that draws only the latest update."""

import logging
import socket
import threading
import time
import uuid
from collections.abc import Sequence
from dataclasses import replace
from urllib.parse import quote

import rerun as rr

from daq.errors import ServiceError
from daq.session.live_update import LiveUpdate
from daq.view.presenter import Presenter, operator_blueprint
from daq.view.viewer_server import ViewerPages

logger = logging.getLogger(__name__)

_APPLICATION = "rig"
_MEMORY = "16MiB"  # one or two minutes for late viewers, which draw all of it before they are up to date
_MIN_INTERVAL = 0.08  # s between two updates
_ALL_INTERFACES = ("0.0.0.0", "::", "")  # noqa: S104 - compared with, not bound to


class LiveView:
    """Shows the latest update of a run in the rerun viewer in any browser.

    A single thread uses rerun. `offer` never blocks, even if that thread, the server or a slow browser does: an update
    that is still waiting is replaced and counted as dropped.

    Parameters
    ----------
    host : str
        Address to listen on.
    web_port, grpc_port : int
        Ports of the viewer's page and of the data; 0 takes a free one.
    origins : sequence of str
        Further web origins whose pages may read the data, as "http://127.0.0.1:8000".

    Raises
    ------
    ServiceError
        A port is taken or cannot be listened on.
    """

    def __init__(
        self, host: str = "127.0.0.1", web_port: int = 0, grpc_port: int = 0, *, origins: Sequence[str] = ()
    ) -> None:
        self._pages = ViewerPages(host, web_port)
        try:
            self._grpc_port = _usable_port(host, grpc_port)
        except ServiceError:
            self._pages.close()
            raise
        self._name = socket.gethostname() if host in _ALL_INTERFACES else host
        names = sorted({self._name, "localhost", "127.0.0.1"})
        self._data_origins = [f"http://{name}:{self._grpc_port}" for name in names]
        self._sink = rr.GrpcServerSink(
            host or "0.0.0.0",  # noqa: S104 - chosen by the caller
            self._grpc_port,
            server_memory_limit=_MEMORY,
            newest_first=True,
            cors_allow_origin=[*(f"http://{name}:{self._pages.port}" for name in names), *origins],
        )
        self._slot: LiveUpdate | None = None
        self._wake = threading.Condition()
        self._closing = False
        self._dropped = 0
        self._failure = ""
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live view", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """URL of the viewer's page with the address of the data."""
        page = f"http://{self._name}:{self._pages.port}/"
        return f"{page}?url={quote(self.viewer_url, safe='')}&hide_welcome_screen=1&theme=dark"

    @property
    def viewer_url(self) -> str:
        """URL of the data, for an installed viewer: ``rerun <url>``."""
        return f"rerun+http://{self._name}:{self._grpc_port}/proxy"

    @property
    def dropped(self) -> int:
        """Number of updates that were replaced before they were drawn."""
        return self._dropped

    @property
    def failure(self) -> str:
        """Error that stopped the view; empty while it works."""
        return self._failure or self._pages.failure

    def offer(self, update: LiveUpdate) -> None:
        """Queue an update for drawing in place of a waiting one; never blocks."""
        with self._wake:
            if self._slot is not None:
                self._dropped += 1
            self._slot = update
            self._wake.notify()

    @property
    def waiting(self) -> bool:
        """Whether an update waits to be drawn."""
        return self._slot is not None

    def wait_ready(self, timeout: float) -> bool:
        """Wait at most ``timeout`` s until the view can be opened; return whether it can."""
        until = time.monotonic() + timeout
        return self._ready.wait(timeout) and self._pages.wait(until - time.monotonic())

    def close(self, timeout: float = 5.0) -> bool:
        """Draw the waiting update, stop, and free the ports; return whether this took less than ``timeout`` s."""
        with self._wake:
            self._closing = True
            self._wake.notify()
        self._pages.cancel_fetch()
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _wait_for_update(self) -> LiveUpdate | None:
        """Return the next update; None when the view is closed."""
        with self._wake:
            self._wake.wait_for(lambda: self._slot is not None or self._closing)
            update, self._slot = self._slot, None
            return update

    def _run(self) -> None:
        self._pages.serve(self._data_origins)
        try:
            stream = rr.RecordingStream(_APPLICATION, recording_id=str(uuid.uuid4()))
            stream.set_sinks(self._sink)
            stream.log(
                "details", rr.TextDocument("# waiting for a run", media_type=rr.MediaType.MARKDOWN), static=False
            )
            self._ready.set()
            self._draw(stream)
            stream.flush()
            stream.disconnect()
        except Exception as error:  # a failure of the view must not stop the run
            logger.exception("the live view stopped")
            self._failure = f"the live view stopped: {error}"
        finally:
            self._pages.close()

    def _draw(self, stream: rr.RecordingStream) -> None:
        presenter, run = None, None
        while (update := self._wait_for_update()) is not None:
            started = time.monotonic()
            if presenter is None or update.header.run != run:
                presenter, run = Presenter(stream, update.header), update.header.run
                stream.send_blueprint(operator_blueprint(update.header), make_active=True, make_default=True)
            status = replace(update.status, dropped_updates=self._dropped)
            presenter.show(replace(update, status=status))
            rest = _MIN_INTERVAL - (time.monotonic() - started)
            if rest > 0.0 and not self._closing:
                time.sleep(rest)


def _usable_port(host: str, port: int) -> int:
    """Return ``port``, or a free one for 0; ServiceError where it is not available."""
    try:
        with socket.create_server((host, port)) as probe:
            number: int = probe.getsockname()[1]
            return number
    except OSError as error:
        raise ServiceError(
            f"port {port} on {host} for the live view's data: {error.strerror or error}; choose another, or 0"
        ) from error
