"""JSON routes with limits on the content, HEAD requests, and the OpenAPI description of event streams."""

from collections.abc import Callable, Coroutine
from typing import Annotated, Any, Final

from anyio import fail_after
from fastapi import Header, Request, Response
from fastapi.routing import APIRoute
from starlette.types import ASGIApp, Receive, Scope, Send

from daq.service.problem_types import ProblemType
from daq.service.problems import ProblemError


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


API_PREFIX: Final = "/api/v1"
IfMatch = Annotated[
    str | None,
    Header(
        alias="If-Match",
        description="`ETag` of the version to be changed; 412 if the resource has changed since",
        examples=["*"],
    ),
]
EVENT_STREAM: Final = "text/event-stream"
METHODS_WITH_BODY: Final = frozenset({"POST", "PATCH"})
BODY_PROBLEMS: Final = (
    ProblemType.INVALID_PARAMETER,
    ProblemType.CROSS_SITE_REQUEST,
    ProblemType.UNSUPPORTED_MEDIA_TYPE,
    ProblemType.CONTENT_TOO_LARGE,
    ProblemType.REQUEST_TIMEOUT,
)
MAX_JSON_SIZE: Final = 1024**2  # bytes
BODY_TIMEOUT: Final = 30.0  # s for the whole body


def event_stream(name: str) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI response of a stream of server-sent events with this name; the schema is that of one event."""
    data = {"type": "string", "contentMediaType": "application/json"}
    properties = {"event": {"type": "string", "const": name}, "data": data}
    event = {"type": "object", "properties": properties, "required": ["event", "data"]}
    return {200: {"content": {EVENT_STREAM: {"schema": event}}}}


class JsonRoute(APIRoute):
    """A route that accepts only JSON of limited size as content of POST and PATCH.

    An HTML form of another site cannot send this content type, which prevents cross-site request forgery. FastAPI reads
    the whole content before it runs dependencies, so that only a route can refuse it in time.
    """

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the handler, preceded by checks of content type, size and arrival time."""
        handle = super().get_route_handler()

        async def check_and_handle(request: Request) -> Response:
            if request.method in METHODS_WITH_BODY:
                await _receive_json(request)
            return await handle(request)

        return check_and_handle


async def _receive_json(request: Request) -> None:
    """Receive the content of a request, which caches it for the handler; ProblemError if it exceeds a limit."""
    sent = request.headers.get("content-type", "")
    if sent.partition(";")[0].strip().lower() != "application/json":
        raise ProblemError(ProblemType.UNSUPPORTED_MEDIA_TYPE, f"{sent or 'no type'!r}, expected application/json")
    size = "" if "transfer-encoding" in request.headers else request.headers.get("content-length", "")
    if not size.isdecimal() or int(size) > MAX_JSON_SIZE:
        raise ProblemError(
            ProblemType.CONTENT_TOO_LARGE, f"{size or 'unknown'} bytes, expected at most {MAX_JSON_SIZE:,}"
        )
    try:
        with fail_after(BODY_TIMEOUT):
            await request.body()
    except TimeoutError as error:
        detail = f"{size} bytes did not arrive within {BODY_TIMEOUT:g} s"
        raise ProblemError(ProblemType.REQUEST_TIMEOUT, detail) from error
