"""Who is let in: requests that name this machine, or, where others reach it, those that bear its token.

The headers that every answer carries.
"""

import hmac
from ipaddress import ip_address
from typing import Final

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from daq.service.problem_types import ProblemType
from daq.service.problems import problem_response

NO_CONTENT: Final = "default-src 'none'; frame-ancestors 'none'"


class SecurityHeadersMiddleware:
    """Adds what browsers need to know: nothing is guessed, nothing is embedded, nothing is kept.

    An answer that sets one of these itself keeps its own.

    Parameters
    ----------
    app : ASGI application
        Whose answers they are added to.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on and add to the answer."""

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.setdefault("Content-Security-Policy", NO_CONTENT)
                headers.setdefault("Cache-Control", "no-store")
                headers.setdefault("X-Content-Type-Options", "nosniff")
                headers.setdefault("Referrer-Policy", "no-referrer")
                headers.setdefault("Cross-Origin-Resource-Policy", "same-origin")
            await send(message)

        await self._app(scope, receive, send_with_headers if scope["type"] == "http" else send)


LOOPBACK_NAMES: Final = frozenset({"localhost", "127.0.0.1", "[::1]"})

HARMLESS: Final = frozenset({"GET", "HEAD", "OPTIONS"})
TOKEN_PROTOCOL: Final = "token."  # noqa: S105 - the beginning of a subprotocol's name


def is_loopback(host: str) -> bool:
    """Return whether an address or name that is bound to can only be reached from this machine."""
    if host.lower() == "localhost":
        return True
    try:
        return ip_address(host.strip("[]")).is_loopback
    except ValueError:  # a name, which may point anywhere
        return False


class AccessControlMiddleware:
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
    origins : frozenset of str
        Other sites whose pages may ask.
    """

    def __init__(
        self,
        app: ASGIApp,
        host: str,
        token: str | None,
        public: frozenset[str],
        origins: frozenset[str] = frozenset(),
    ) -> None:
        self._app = app
        self._origins = origins
        self._names = LOOPBACK_NAMES | {_written(host)} if is_loopback(host) else None
        self._token = None if token is None else token.encode()
        self._public = public

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or answer 421, 401 or 403."""
        if scope["type"] not in {"http", "websocket"}:
            await self._app(scope, receive, send)
            return
        headers, path = Headers(scope=scope), str(scope["path"])
        refused = self._refused(scope, headers, path)
        if refused is None:
            await self._app(scope, receive, send)
        else:
            problem_type, detail = refused
            await problem_response(problem_type, detail, path)(scope, receive, send)

    def _refused(self, scope: Scope, headers: Headers, path: str) -> tuple[ProblemType, str] | None:
        """Return why a request is turned away; None where it is not."""
        name = host_name(headers.get("host", ""))
        if self._names is not None and name not in self._names:
            return (
                ProblemType.HOST_NOT_ALLOWED,
                f"the request names {name!r}; expected one of {', '.join(sorted(self._names))}",
            )
        if self._token is not None and path not in self._public and not self._bears_token(headers):
            given = "another token was given" if "authorization" in headers else "no token was given"
            return ProblemType.TOKEN_REQUIRED, f"{given}: send the header Authorization: Bearer <token>"
        is_socket = scope["type"] == "websocket"
        if not is_socket and scope["method"] in HARMLESS:
            return None
        if not self._is_own_page(headers):
            return ProblemType.CROSS_SITE_REQUEST, f"the request comes from {headers.get('origin') or 'another site'}"
        return None

    def _is_own_page(self, headers: Headers) -> bool:
        """Return whether no browser says that a page from elsewhere asks."""
        origin = headers.get("origin")
        if origin is not None:
            return origin in self._origins or origin.partition("://")[2].lower() == headers.get("host", "").lower()
        return headers.get("sec-fetch-site", "none") in {"none", "same-origin"}

    def _bears_token(self, headers: Headers) -> bool:
        if self._token is None:
            return True
        scheme, _, token = headers.get("authorization", "").partition(" ")
        protocols = (name.strip() for name in headers.get("sec-websocket-protocol", "").split(","))
        given = [  # a page can send nothing but protocols with a WebSocket
            *((token.strip(" "),) if scheme.lower() == "bearer" else ()),
            *(name.removeprefix(TOKEN_PROTOCOL) for name in protocols if name.startswith(TOKEN_PROTOCOL)),
        ]
        return any(hmac.compare_digest(one.encode("latin-1"), self._token) for one in given)


def _written(host: str) -> str:
    return f"[{host}]" if ":" in host and not host.startswith("[") else host.lower()


def host_name(header: str) -> str:
    """Return the name in a Host header without its port, in lower case; an IPv6 address keeps its brackets."""
    if header.startswith("["):
        return header[: header.find("]") + 1].lower()
    return header.partition(":")[0].lower()
