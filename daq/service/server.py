"""HTTP server in its own thread, with limits on connections and on the time of a request's header."""

import asyncio
import logging
import socket
import sys
import threading
import time
from typing import Any, ClassVar, Final

import h11
import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from daq.errors import ServiceError
from daq.service.problems import ProblemType, problem_response

if sys.platform != "win32":
    import resource

MAX_CONNECTIONS: Final = 2000
BUSY_BODY: Final = bytes(problem_response(ProblemType.BUSY, "too many clients are connected", "").body)
BUSY_RESPONSE: Final = (
    b"HTTP/1.1 503 Service Unavailable\r\nContent-Type: application/problem+json\r\nRetry-After: 2\r\n"
    b"Connection: close\r\nContent-Length: %d\r\n\r\n%b" % (len(BUSY_BODY), BUSY_BODY)
)


def max_connections() -> int:
    """Return the maximum number of connections: 2000, or half of the limit on open files if that is lower."""
    limit = MAX_CONNECTIONS
    if sys.platform != "win32":
        allowed, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        if allowed != resource.RLIM_INFINITY:
            limit = min(MAX_CONNECTIONS, allowed // 2)
    return limit


class LimitedHttpProtocol(H11Protocol):
    """HTTP/1.1 connection that is refused above a limit and closed if a request's header does not arrive in time.

    uvicorn has no time limit for a header, so that idle connections could use up those allowed.
    """

    max_connections: ClassVar[int] = max_connections()
    """Simultaneous connections."""
    request_timeout: ClassVar[float] = 15.0
    """s for a request's line and headers. uvicorn itself closes connections that are idle between requests."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn has it
        """Start the timeout, or refuse the client if there are too many."""
        super().connection_made(transport)
        if len(self.connections) > self.max_connections:
            transport.write(BUSY_RESPONSE)
            transport.close()
        else:
            self._start_timeout()

    def data_received(self, data: bytes) -> None:
        """Handle received bytes; cancel the timeout once the headers are complete."""
        if self.transport.is_closing():
            return
        super().data_received(data)
        if self.conn.their_state is not h11.IDLE:
            self._cancel_timeout()
        elif self._timer is None:
            self._start_timeout()

    def connection_lost(self, exc: Exception | None) -> None:
        """Cancel the timeout."""
        self._cancel_timeout()
        super().connection_lost(exc)

    def _start_timeout(self) -> None:
        self._timer = self.loop.call_later(self.request_timeout, self.transport.close)

    def _cancel_timeout(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


START_DEADLINE = 60.0  # s: imports are slow on a busy machine
BACKLOG = 128
MAX_PORT = 65_535
MAX_WEBSOCKET_MESSAGE = 4096  # bytes of an incoming message: clients need not send any


class ServiceServer:
    """HTTP server that runs an application in its own thread, where uvicorn installs no signal handler.

    Parameters
    ----------
    app : ASGI application
        The served application.
    host : str
        Address or name to listen on.
    port : int
        Port to listen on, attribute `port`; 0 takes a free one at `start`.
    protocol : type
        Protocol class of a client's connection.
    closing : Event or None
        Set before shutdown, which waits for responses: endless ones end.
    """

    def __init__(
        self,
        app: ASGIApp,
        host: str = "127.0.0.1",
        port: int = 0,
        protocol: type[LimitedHttpProtocol] = LimitedHttpProtocol,
        closing: threading.Event | None = None,
    ) -> None:
        self._closing = closing
        self._protocol = protocol
        self._app = app
        self._host = host
        self.port = port
        self._server: uvicorn.Server | None = None
        self._thread: threading.Thread | None = None

    @property
    def url(self) -> str:
        """The page's URL, for a browser on this machine."""
        reachable = {"": "127.0.0.1", "0.0.0.0": "127.0.0.1", "::": "::1"}.get(self._host, self._host)  # noqa: S104 - compared, not bound
        return f"http://{f'[{reachable}]' if ':' in reachable else reachable}:{self.port}"

    def start(self) -> None:
        """Start listening and return once the server responds; ServiceError if the address is not available."""
        if self._thread is not None:
            raise ValueError(f"the server at {self.url} was started already")
        listener = _listen(self._host, self.port)
        self.port = int(listener.getsockname()[1])
        config = uvicorn.Config(
            self._app,
            loop="asyncio",
            http=self._protocol,
            ws="websockets-sansio",
            ws_max_size=MAX_WEBSOCKET_MESSAGE,
            log_config=None,
            log_level="error",  # malformed requests do not concern the operator
            access_log=False,
            server_header=False,
            proxy_headers=False,
        )
        logging.getLogger("uvicorn.error").addFilter(_is_relevant)
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(
            target=self._server.run, kwargs={"sockets": [listener]}, name="service", daemon=True
        )
        self._thread.start()
        deadline = time.monotonic() + START_DEADLINE
        while not self._server.started:
            if not self._thread.is_alive() or time.monotonic() > deadline:
                self.close()
                raise ServiceError(f"the service at {self.url} did not start within {START_DEADLINE:g} s; see the log")
            time.sleep(0.005)

    def close(self, deadline: float = 3.0) -> None:
        """Stop listening, finish responses in progress, and return within about ``deadline`` s; idempotent."""
        server, thread = self._server, self._thread
        if server is None or thread is None:
            return
        if self._closing is not None:
            self._closing.set()
        server.should_exit = True
        thread.join(deadline)
        if thread.is_alive():
            server.force_exit = True
            thread.join(1.0)
        self._server = self._thread = None


def _is_relevant(record: logging.LogRecord) -> bool:
    """Return whether a record concerns the operator: not a refused socket or a response cancelled at shutdown."""
    message = record.getMessage()
    is_cancelled = record.exc_info is not None and isinstance(record.exc_info[1], asyncio.CancelledError)
    is_lifespan = message.rstrip().endswith(asyncio.CancelledError.__name__)  # a traceback as text, by Starlette
    return not (is_cancelled or is_lifespan or "without completing handshake" in message)


def _listen(host: str, port: int) -> socket.socket:
    wanted = f"{host}:{port}"
    if not 0 <= port <= MAX_PORT:  # getaddrinfo takes ports modulo 65536
        raise ServiceError(f"the service cannot listen at {wanted}: the port must lie between 0 and {MAX_PORT}")
    try:
        family, _, _, _, address = socket.getaddrinfo(
            host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = socket.create_server(address[:2], family=family, backlog=BACKLOG)
    except OSError as error:
        raise ServiceError(
            f"the service cannot listen at {wanted}: {error.strerror or error}; port 0 takes a free one"
        ) from error
    # Connections inherit it; asyncio sets it only if the listener names TCP. Without it a response takes 40 ms.
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listener
