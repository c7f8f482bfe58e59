"""HTTP server: address, thread, shutdown and connection limits."""

import asyncio
import signal
import socket
import threading
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from ipaddress import IPv4Address

import httpx
import pytest
from fastapi import FastAPI
from starlette.types import Receive, Scope, Send

from daq.errors import ServiceError
from daq.service.middleware import UnhandledErrorMiddleware
from daq.service.problems import ProblemSchema
from daq.service.server import LimitedHttpProtocol, ServiceServer


class HelloApp:
    """Application that responds after ``delay`` s."""

    def __init__(self, delay: float = 0.0) -> None:
        self.delay = delay
        self.requested = threading.Event()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        assert scope["type"] == "http"  # the server then runs it without lifespan
        self.requested.set()
        if self.delay:
            await asyncio.sleep(self.delay)
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"hello"})


def test_server_responds_on_a_free_port_from_start_to_close() -> None:
    server = ServiceServer(HelloApp())
    server.start()
    port = server.port
    assert port > 0
    assert server.url == f"http://127.0.0.1:{port}"
    assert httpx.get(server.url).text == "hello"
    server.close()
    with pytest.raises(httpx.ConnectError):
        httpx.get(f"http://127.0.0.1:{port}")


def test_server_leaves_no_thread_and_no_signal_handler_behind() -> None:
    threads, handlers = set(threading.enumerate()), [signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)]
    server = ServiceServer(HelloApp())
    server.start()
    assert [signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)] == handlers
    server.close()
    server.close()
    assert set(threading.enumerate()) == threads


def test_start_names_an_address_in_use() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ServiceError, match=f"127.0.0.1:{port}.*in use"):
            ServiceServer(HelloApp(), port=port).start()


def test_start_succeeds_once_the_address_is_free() -> None:
    first = ServiceServer(HelloApp())
    first.start()
    httpx.get(first.url)
    second = ServiceServer(HelloApp(), port=first.port)
    with pytest.raises(ServiceError, match="in use"):
        second.start()
    first.close()
    second.start()
    assert httpx.get(second.url).text == "hello"
    second.close()


@pytest.mark.parametrize(("host", "port"), [("203.0.113.7", 0), ("no such host", 0), ("127.0.0.1", 70_000)])
def test_start_names_an_invalid_address(host: str, port: int) -> None:
    with pytest.raises(ServiceError, match=f"cannot listen at {host}:{port}"):
        ServiceServer(HelloApp(), host, port).start()


def test_close_waits_for_a_response_in_progress() -> None:
    application = HelloApp(delay=0.3)
    server = ServiceServer(application)
    server.start()
    answers: list[str] = []
    asker = threading.Thread(target=lambda: answers.append(httpx.get(server.url).text))
    asker.start()
    assert application.requested.wait(60.0)
    server.close()
    asker.join(60.0)
    assert answers == ["hello"]


def test_close_does_not_wait_for_an_idle_connection() -> None:
    server = ServiceServer(HelloApp())
    server.start()
    with httpx.Client(base_url=server.url) as client:
        client.get("/")
        began = time.monotonic()
        server.close(deadline=60.0)
        assert time.monotonic() - began < 30.0


def test_close_does_not_wait_longer_than_its_deadline(caplog: pytest.LogCaptureFixture) -> None:
    application = HelloApp(delay=60.0)
    server = ServiceServer(application)
    server.start()
    with socket.create_connection(("127.0.0.1", server.port)) as asker:
        asker.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert application.requested.wait(60.0)
        began = time.monotonic()
        server.close(deadline=0.3)
        assert time.monotonic() - began < 30.0
    assert not caplog.records


def test_request_cut_off_by_a_forced_shutdown_gets_a_problem_response(caplog: pytest.LogCaptureFixture) -> None:
    application = HelloApp(delay=60.0)
    server = ServiceServer(UnhandledErrorMiddleware(application))
    server.start()
    with socket.create_connection(("127.0.0.1", server.port)) as asker, asker.makefile("rb") as answer:
        asker.sendall(b"GET /slow HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert application.requested.wait(60.0)
        server.close(deadline=0.1)
        head, _, body = answer.read().partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 503 ")
    assert b"content-type: application/problem+json" in head
    assert ProblemSchema.model_validate_json(body).detail == "the program is shutting down"
    assert not caplog.records


def test_close_ends_the_lifespan_beside_a_hung_response(caplog: pytest.LogCaptureFixture) -> None:
    requested, ended = threading.Event(), threading.Event()

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        try:
            yield
        finally:
            ended.set()

    application = FastAPI(lifespan=lifespan)

    @application.get("/")
    async def hang() -> None:
        requested.set()
        await asyncio.sleep(60.0)

    server = ServiceServer(application)
    server.start()
    with socket.create_connection(("127.0.0.1", server.port)) as client:
        client.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert requested.wait(60.0)
        server.close(deadline=0.3)
    assert ended.wait(60.0)
    assert not caplog.records


def test_server_cannot_be_started_twice() -> None:
    server = ServiceServer(HelloApp())
    server.start()
    with pytest.raises(ValueError, match="started already"):
        server.start()
    server.close()


def test_response_in_two_writes_does_not_wait_for_acknowledgement() -> None:
    server = ServiceServer(HelloApp())
    server.start()
    took = []
    with httpx.Client(base_url=server.url) as client:
        for _ in range(60):
            began = time.monotonic()
            client.get("/")
            took.append(time.monotonic() - began)
    server.close()
    assert min(took[30:]) < 0.03  # Nagle's algorithm with delayed acknowledgement takes 0.04 s each


@pytest.mark.parametrize(
    ("host", "url"),
    [
        (str(IPv4Address(0)), "http://127.0.0.1:80"),
        ("::", "http://[::1]:80"),
        ("::1", "http://[::1]:80"),
        ("bench", "http://bench:80"),
    ],
)
def test_url_opens_in_a_browser_on_this_machine(host: str, url: str) -> None:
    assert ServiceServer(HelloApp(), host, 80).url == url


def test_response_that_fails_after_its_start_is_not_completed() -> None:
    class BreaksOff:
        async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
            assert scope["type"] == "http"
            await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"10")]})
            await send({"type": "http.response.body", "body": b"half", "more_body": True})
            raise ValueError("broke off")

    server = ServiceServer(UnhandledErrorMiddleware(BreaksOff()))
    server.start()
    with pytest.raises(httpx.RemoteProtocolError):
        httpx.get(server.url)
    server.close()


class StrictProtocol(LimitedHttpProtocol):
    """Protocol with a small connection limit and a short timeout."""

    max_connections = 3
    request_timeout = 0.3


@pytest.fixture
def strict_server() -> Iterator[ServiceServer]:
    server = ServiceServer(HelloApp(), protocol=StrictProtocol)
    server.start()
    yield server
    server.close()


def send_text(server: ServiceServer, text: bytes) -> socket.socket:
    client = socket.create_connection(("127.0.0.1", server.port), timeout=10.0)
    client.sendall(text)
    return client


def receive_rest(client: socket.socket) -> bytes:
    """Return what arrives until the server closes the connection."""
    with client:
        return b"".join(iter(lambda: client.recv(65_536), b""))


@pytest.mark.parametrize("partial_request", [b"", b"GET / HTTP/1.1\r\nHost: localhost\r\nX-"])
def test_connection_without_a_complete_request_is_closed(strict_server: ServiceServer, partial_request: bytes) -> None:
    assert receive_rest(send_text(strict_server, partial_request)) == b""


def test_timeout_applies_to_the_next_request_too(strict_server: ServiceServer) -> None:
    request = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"
    client, answered = send_text(strict_server, request), b""
    while not answered.endswith(b"0\r\n\r\n"):
        answered += client.recv(65_536)
    client.sendall(request[:9])
    assert receive_rest(client) == b""


def trickle(client: socket.socket) -> None:
    """Send a request byte by byte."""
    for _ in range(600):
        client.sendall(b"X")
        time.sleep(0.1)


def test_connection_of_a_slow_sender_is_closed(strict_server: ServiceServer) -> None:
    with send_text(strict_server, b"GET / HTTP/1.1\r\n") as client, pytest.raises(ConnectionError):
        trickle(client)


def test_connection_above_the_limit_gets_busy_and_succeeds_later(strict_server: ServiceServer) -> None:
    idle = [send_text(strict_server, b"") for _ in range(StrictProtocol.max_connections)]
    refused = receive_rest(send_text(strict_server, b""))
    assert refused.startswith(b"HTTP/1.1 503 Service Unavailable\r\n")
    problem = ProblemSchema.model_validate_json(refused.partition(b"\r\n\r\n")[2])
    assert problem.type == "/docs#busy"
    for client in idle:
        assert receive_rest(client) == b""
    assert httpx.get(strict_server.url).status_code == 200
