"""Middleware: access control (host names, token, other sites), security headers, HEAD, and unhandled errors."""

import asyncio
import hmac
import logging
from ipaddress import ip_address
from typing import Final

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from daq.service.problems import ProblemError, ProblemType, problem_response
from daq.session.processes import SHUTTING_DOWN

logger = logging.getLogger(__name__)

SECURITY_HEADERS: Final = {
    "Content-Security-Policy": "default-src 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class SecurityHeadersMiddleware:
    """Middleware that adds security headers: no MIME sniffing, no embedding, no caching without ETag.

    A header that a response sets itself stays.

    Parameters
    ----------
    app : ASGI application
        The wrapped application.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on and add the headers to the response."""

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.setdefault("Cache-Control", "private, no-cache" if "ETag" in headers else "no-store")
                for name, value in SECURITY_HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        await self._app(scope, receive, send_with_headers if scope["type"] == "http" else send)


PUBLIC_PAGES: Final = frozenset({"/", "/docs", "/openapi.json"})
PUBLIC_FOLDER: Final = "/console/"
LOOPBACK_HOSTS: Final = frozenset({"localhost", "127.0.0.1", "[::1]"})

SAFE_METHODS: Final = frozenset({"GET", "HEAD", "OPTIONS"})
SUBPROTOCOL: Final = "token."


def is_loopback(host: str) -> bool:
    """Return whether a bind address can be reached only from this machine."""
    if host.lower() == "localhost":
        return True
    try:
        return ip_address(host.strip("[]")).is_loopback
    except ValueError:  # a name may resolve to any address
        return False


def is_public(path: str) -> bool:
    """Return whether a path has no data of the rig: a page or one of its files."""
    return path in PUBLIC_PAGES or path.startswith(PUBLIC_FOLDER)


class AccessControlMiddleware:
    """Middleware that rejects requests by host name, token and origin, before any route runs.

    A service bound to loopback accepts only requests whose Host header is a loopback name. A foreign page whose name
    resolves to this machine (DNS rebinding) sends its own name, and is rejected. Starlette's TrustedHostMiddleware
    knows no tokens and no origins, and responds with 400 in plain text.

    Parameters
    ----------
    app : ASGI application
        The wrapped application.
    host : str
        The address that the service is bound to.
    token : str or None
        Bearer token required for all paths but those without data of the rig; None requires none.
    origins : frozenset of str
        Other sites whose pages may send requests.
    """

    def __init__(
        self,
        app: ASGIApp,
        host: str,
        token: str | None,
        origins: frozenset[str] = frozenset(),
    ) -> None:
        self._app = app
        self._origins = origins
        self._allowed_hosts = LOOPBACK_HOSTS | {_host_header_form(host)} if is_loopback(host) else None
        self._token = None if token is None else token.encode()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or respond with 421, 401 or 403."""
        if scope["type"] in {"http", "websocket"}:
            try:
                self._check(scope, Headers(scope=scope))
            except ProblemError as error:
                response = problem_response(error.problem_type, error.detail, scope["path"])
                await response(scope, receive, send)
                return
        await self._app(scope, receive, send)

    def _check(self, scope: Scope, headers: Headers) -> None:
        """Raise ProblemError if the request is rejected."""
        name = host_without_port(headers.get("host", ""))
        if self._allowed_hosts is not None and name not in self._allowed_hosts:
            detail = f"the request's host is {name!r}; expected one of {', '.join(sorted(self._allowed_hosts))}"
            raise ProblemError(ProblemType.HOST_NOT_ALLOWED, detail)
        if self._token is not None and not is_public(scope["path"]) and not _has_token(headers, self._token):
            reason = "another token was given" if "authorization" in headers else "no token was given"
            detail = f"{reason}: send the header Authorization: Bearer <token>"
            raise ProblemError(ProblemType.TOKEN_REQUIRED, detail)
        is_safe = scope["type"] == "http" and scope["method"] in SAFE_METHODS
        if not is_safe and not self._is_same_origin(headers):
            detail = f"the request comes from {headers.get('origin') or 'another site'}"
            raise ProblemError(ProblemType.CROSS_SITE_REQUEST, detail)

    def _is_same_origin(self, headers: Headers) -> bool:
        """Return whether the request comes from the service's own page, an allowed site, or no browser."""
        origin = headers.get("origin")
        if origin is not None:
            return origin in self._origins or origin.partition("://")[2].lower() == headers.get("host", "").lower()
        return headers.get("sec-fetch-site", "none") in {"none", "same-origin"}


def _has_token(headers: Headers, token: bytes) -> bool:
    """Return whether a request has the token: in Authorization, or in a WebSocket's subprotocols, as browsers do."""
    scheme, _, sent = headers.get("authorization", "").partition(" ")
    protocols = [name.strip() for name in headers.get("sec-websocket-protocol", "").split(",")]
    candidates = [name.removeprefix(SUBPROTOCOL) for name in protocols if name.startswith(SUBPROTOCOL)]
    if scheme.lower() == "bearer":
        candidates.append(sent.strip(" "))
    return any(hmac.compare_digest(each.encode("latin-1"), token) for each in candidates)


def _host_header_form(host: str) -> str:
    return f"[{host}]" if ":" in host and not host.startswith("[") else host.lower()


def host_without_port(header: str) -> str:
    """Return the host of a Host header in lower case, without port; an IPv6 address with its brackets."""
    if header.startswith("["):
        return header[: header.find("]") + 1].lower()
    return header.partition(":")[0].lower()


class HeadAsGetMiddleware:
    """Middleware that routes HEAD as GET, which FastAPI does not; the server leaves out the content.

    Parameters
    ----------
    app : ASGI application
        The wrapped application.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, HEAD as GET with `rig.head` set in the scope."""
        is_head = scope["type"] == "http" and scope["method"] == "HEAD"
        await self._app({**scope, "method": "GET", "rig.head": True} if is_head else scope, receive, send)


class UnhandledErrorMiddleware:
    """Middleware that turns an unhandled exception into a problem response and a log entry.

    Starlette's own raises the exception again, so that the server logs it a second time, and stands outside the
    middleware that adds the security headers.

    Parameters
    ----------
    app : ASGI application
        The wrapped application.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on; re-raise only if the response has started."""
        has_started = False

        async def send_on(message: Message) -> None:
            nonlocal has_started
            has_started = True
            await send(message)

        try:
            await self._app(scope, receive, send_on)
        except asyncio.CancelledError:  # at a forced shutdown; uvicorn would answer 500 in plain text
            if not has_started and scope["type"] == "http":
                await problem_response(ProblemType.BUSY, SHUTTING_DOWN, scope["path"])(scope, receive, send)
            raise
        except Exception as error:  # the service must stay available to other clients
            if has_started or scope["type"] != "http":
                raise
            logger.exception("%s %s failed", scope["method"], scope["path"])
            detail = f"{type(error).__name__}; see the service's log"
            await problem_response(ProblemType.INTERNAL_ERROR, detail, scope["path"])(scope, receive, send)
