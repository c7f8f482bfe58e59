"""A client's connection: closed where a request does not come in time, refused where there are too many."""

import asyncio
import json
import sys
from typing import Any, ClassVar, Final

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from daq.service.problem_types import Kind

if sys.platform != "win32":
    import resource

MOST: Final = 2000
REFUSAL: Final = json.dumps(
    {
        "type": f"/docs#{Kind.BUSY.slug}",
        "title": Kind.BUSY.title,
        "status": Kind.BUSY.status,
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
