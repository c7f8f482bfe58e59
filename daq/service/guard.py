"""Who is let in: requests that name this machine, or, where others reach it, those that bear its token."""

import hmac
from ipaddress import ip_address
from typing import Final

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from daq.service.problems import HOST, TOKEN, problem_response

LOOPBACK_NAMES: Final = frozenset({"localhost", "127.0.0.1", "[::1]"})


def is_loopback(host: str) -> bool:
    """Return whether an address or name that is bound to can only be reached from this machine."""
    if host.lower() == "localhost":
        return True
    try:
        return ip_address(host.strip("[]")).is_loopback
    except ValueError:  # a name, which may point anywhere
        return False


class Guard:
    """Turns away what has no business here, before any route sees it.

    A service that is bound to a loopback address answers only requests that name it so: a page from elsewhere whose
    name was made to point at this machine (DNS rebinding) sends its own name.

    Parameters
    ----------
    app : ASGI application
        What is guarded.
    host : str
        The address that the service is bound to.
    token : str or None
        What requests must bear, except for ``public`` paths; None asks for none.
    public : frozenset of str
        Paths that tell nothing of the rig: the page's own files.
    """

    def __init__(self, app: ASGIApp, host: str, token: str | None, public: frozenset[str]) -> None:
        self._app = app
        self._names = LOOPBACK_NAMES | {_written(host)} if is_loopback(host) else None
        self._expected = None if token is None else f"Bearer {token}".encode()
        self._public = public

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or answer 421 or 401."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers, path = Headers(scope=scope), str(scope["path"])
        name = host_name(headers.get("host", ""))
        if self._names is not None and name not in self._names:
            detail = f"the request names {name!r}; expected one of {', '.join(sorted(self._names))}"
            await problem_response(HOST, detail, path)(scope, receive, send)
        elif self._expected is not None and path not in self._public and not self._bears_token(headers):
            given = "another token was given" if "authorization" in headers else "no token was given"
            await problem_response(TOKEN, f"{given}: send the header Authorization: Bearer <token>", path)(
                scope, receive, send
            )
        else:
            await self._app(scope, receive, send)

    def _bears_token(self, headers: Headers) -> bool:
        given = headers.get("authorization", "").encode("latin-1")
        return self._expected is not None and hmac.compare_digest(given, self._expected)


def _written(host: str) -> str:
    return f"[{host}]" if ":" in host and not host.startswith("[") else host.lower()


def host_name(header: str) -> str:
    """Return the name in a Host header without its port, in lower case; an IPv6 address keeps its brackets."""
    if header.startswith("["):
        return header[: header.find("]") + 1].lower()
    return header.partition(":")[0].lower()
