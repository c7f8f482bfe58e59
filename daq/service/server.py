"""The HTTP server, in a thread of its own.

A client's connection: closed where a request does not come in time, refused where there are too many.
"""

import asyncio
import contextlib
import json
import logging
import socket
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any, ClassVar, Final

import h11
import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from daq.errors import ServiceError
from daq.service.problem_types import ProblemType

if sys.platform != "win32":
    import resource

MOST: Final = 2000
REFUSAL: Final = json.dumps(
    {
        "type": f"/docs#{ProblemType.BUSY.slug}",
        "title": ProblemType.BUSY.title,
        "status": ProblemType.BUSY.status,
        "detail": "too many clients are connected",
        "instance": "",
        "faults": [],
        "job": None,
    }
).encode()
REFUSED: Final = (
    b"HTTP/1.1 503 Service Unavailable\r\nContent-Type: application/problem+json\r\nRetry-After: 2\r\n"
    b"Connection: close\r\nContent-Length: %d\r\n\r\n%b" % (len(REFUSAL), REFUSAL)
)


def most_connections() -> int:
    """Return how many connections there may be: half of what files a program may have open, where that is limited."""
    most = MOST
    if sys.platform != "win32":
        allowed, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        if allowed != resource.RLIM_INFINITY:
            most = min(MOST, allowed // 2)
    return most


class Connection(H11Protocol):
    """One client over HTTP/1.1."""

    most: ClassVar[int] = most_connections()
    """Connections at once."""
    patience: ClassVar[float] = 15.0
    """s for a whole request up to its content; who waits between two requests is let go by the server itself."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn has it
        """Take a client in, or turn it away."""
        super().connection_made(transport)
        if len(self.connections) > self.most:
            transport.write(REFUSED)
            transport.close()
        else:
            self._wait()

    def data_received(self, data: bytes) -> None:
        """Take what a client has sent."""
        if self.transport.is_closing():
            return
        super().data_received(data)
        if self.conn.their_state is not h11.IDLE:
            self._wait_no_longer()
        elif self._timer is None:
            self._wait()

    def connection_lost(self, exc: Exception | None) -> None:
        """Let a client go."""
        self._wait_no_longer()
        super().connection_lost(exc)

    def _wait(self) -> None:
        self._timer = self.loop.call_later(self.patience, self.transport.close)

    def _wait_no_longer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


START_DEADLINE = 60.0  # s: a machine that is busy imports slowly
BACKLOG = 128
MOST_PORT = 65_535
MOST_TOLD = 4096  # bytes of a message over a WebSocket: clients have nothing to say there


class ServiceServer:
    """Serves an application over HTTP from a thread that it owns; installs no signal handler.

    Parameters
    ----------
    app : ASGI application
        What is served.
    host : str
        Address or name to listen at.
    port : int
        Port to listen at; 0 takes a free one.
    connection : type
        What serves a client.
    """

    def __init__(
        self, app: ASGIApp, host: str = "127.0.0.1", port: int = 0, connection: type[Connection] = Connection
    ) -> None:
        self._connection = connection
        self._app = app
        self._host = host
        self._port = port
        self._server: _Server | None = None
        self._thread: threading.Thread | None = None

    @property
    def port(self) -> int:
        """The port that is listened at; before `start` the one that was asked for."""
        return self._port

    @property
    def url(self) -> str:
        """The page's address, for a browser on this machine."""
        reachable = {"": "127.0.0.1", "0.0.0.0": "127.0.0.1", "::": "::1"}.get(self._host, self._host)  # noqa: S104 - compared, not bound
        return f"http://{f'[{reachable}]' if ':' in reachable else reachable}:{self._port}"

    def start(self) -> None:
        """Listen and return when requests are answered; ServiceError where the address cannot be had."""
        if self._thread is not None:
            raise ValueError(f"the server at {self.url} was started already")
        listener = _listen(self._host, self._port)
        self._port = int(listener.getsockname()[1])
        config = uvicorn.Config(
            self._app,
            loop="asyncio",
            http=self._connection,
            ws="websockets-sansio",
            ws_max_size=MOST_TOLD,
            lifespan="off",
            log_config=None,
            log_level="error",  # a client that talks nonsense is no news for the operator
            access_log=False,
            server_header=False,
            proxy_headers=False,
        )
        logging.getLogger("uvicorn.error").addFilter(_is_news)
        self._server = _Server(config)
        self._thread = threading.Thread(
            target=self._server.run, kwargs={"sockets": [listener]}, name="service", daemon=True
        )
        self._thread.start()
        deadline = time.monotonic() + START_DEADLINE
        while not self._server.started:
            if not self._thread.is_alive() or time.monotonic() > deadline:
                self.close()
                raise ServiceError(f"the service at {self.url} did not come up; the log tells why")
            time.sleep(0.005)

    def close(self, deadline: float = 3.0) -> None:
        """Stop listening, let answers under way finish, and return within about ``deadline`` s; again does nothing."""
        server, thread = self._server, self._thread
        if server is None or thread is None:
            return
        end = getattr(self._app, "end", None)
        if callable(end):  # an application whose answers may have no end of their own
            end()
        server.should_exit = True
        thread.join(deadline)
        if thread.is_alive():
            server.force_exit = True
            thread.join(1.0)
        self._server = self._thread = None


def _is_news(record: logging.LogRecord) -> bool:
    """Say whether a record is for the operator: not that a socket was refused, or an answer given up at the end."""
    is_given_up = record.exc_info is not None and isinstance(record.exc_info[1], asyncio.CancelledError)
    return not is_given_up and "without completing handshake" not in record.getMessage()


class _Server(uvicorn.Server):
    """uvicorn's server, which leaves signals to the program that it runs in."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


def _listen(host: str, port: int) -> socket.socket:
    wanted = f"{host}:{port}"
    if not 0 <= port <= MOST_PORT:  # getaddrinfo would take it modulo 65536
        raise ServiceError(f"the service cannot listen at {wanted}: the port must lie between 0 and {MOST_PORT}")
    try:
        family, _, _, _, address = socket.getaddrinfo(
            host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = socket.create_server(address[:2], family=family, backlog=BACKLOG)
    except OSError as error:
        raise ServiceError(
            f"the service cannot listen at {wanted}: {error.strerror or error}; port 0 takes a free one"
        ) from error
    # Connections inherit it; asyncio sets it only where the listener names TCP. Without it an answer takes 40 ms.
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listener
