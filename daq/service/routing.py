"""Route registration with OpenAPI responses, HEAD requests, and bounded thread pools for blocking work."""

from collections.abc import Callable, Coroutine, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Final, TypeVar

from anyio import CapacityLimiter, fail_after, to_thread
from fastapi import APIRouter, Header, Path, Request, Response
from fastapi.datastructures import Default
from fastapi.responses import JSONResponse
from fastapi.routing import APIRoute
from starlette.types import ASGIApp, Receive, Scope, Send

from daq.service.problem_types import ProblemType
from daq.service.problems import ProblemError, openapi_responses


class HeadAsGetMiddleware:
    """Middleware that routes HEAD as GET; the server leaves out the content.

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


ResultT = TypeVar("ResultT")


class BoundedThreadPool:
    """Runs blocking functions in a bounded number of threads with a bounded queue.

    Parameters
    ----------
    threads : int
        Maximum number of functions that run at once.
    waiting : int
        Maximum number that wait; further ones are rejected.
    """

    def __init__(self, threads: int, waiting: int) -> None:
        self._limiter = CapacityLimiter(threads)
        self._capacity = threads + waiting
        self._pending = 0

    async def run(self, function: Callable[[], ResultT]) -> ResultT:
        """Return the result of ``function``, run in a thread; ProblemError (busy) if too many are waiting."""
        if self._pending >= self._capacity:
            raise ProblemError(ProblemType.BUSY, f"{self._pending} requests are in progress or waiting already")
        self._pending += 1  # here and not in the limiter, which counts only when the event loop comes round
        try:
            return await to_thread.run_sync(function, limiter=self._limiter)
        finally:
            self._pending -= 1


API_PREFIX: Final = "/api/v1"
RunId = Annotated[str, Path(description="Id of the run, from /api/v1/runs", examples=["2026-11-24T09-12-07-gj90c"])]
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
    """A route that accepts only JSON of limited size.

    An HTML form of another site cannot send this content type, which prevents cross-site request forgery.
    """

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the handler, preceded by checks of content type, size and arrival time."""
        handle = super().get_route_handler()

        async def checked(request: Request) -> Response:
            sent = request.headers.get("content-type", "")
            if sent.partition(";")[0].strip().lower() != "application/json":
                raise ProblemError(
                    ProblemType.UNSUPPORTED_MEDIA_TYPE, f"{sent or 'no type'!r}, expected application/json"
                )
            size = "" if "transfer-encoding" in request.headers else request.headers.get("content-length", "")
            if not size.isdecimal() or int(size) > MAX_JSON_SIZE:
                raise ProblemError(
                    ProblemType.CONTENT_TOO_LARGE, f"{size or 'unknown'} bytes, expected at most {MAX_JSON_SIZE:,}"
                )
            try:
                with fail_after(BODY_TIMEOUT):
                    await request.body()  # cached by the request for the handler
            except TimeoutError as error:
                raise ProblemError(
                    ProblemType.REQUEST_TIMEOUT, f"{size} bytes did not arrive within {BODY_TIMEOUT:g} s"
                ) from error
            return await handle(request)

        return checked


@dataclass(frozen=True, slots=True)
class Routing:
    """Adds routes to a router, each with its problem types in the OpenAPI schema.

    Parameters
    ----------
    router : APIRouter
        The router.
    common_problems : tuple of ProblemType
        Problem types of every route.
    """

    router: APIRouter
    common_problems: tuple[ProblemType, ...]

    def add(  # noqa: PLR0913 - each is one part of the OpenAPI operation
        self,
        route: str,
        endpoint: Callable[..., Any],
        operation_id: str,
        tag: str,
        summary: str,
        *problem_types: ProblemType,
        status: int = 200,
        model: type | None = None,
        content: dict[str, Any] | None = None,
        responses: Mapping[int | str, dict[str, Any]] | None = None,
    ) -> None:
        """Add a route.

        Parameters
        ----------
        route, endpoint : str, callable
            Method and path ("POST /jobs"; GET may be left out), and the request handler.
        operation_id, tag, summary : str
            Operation id, group and summary in the OpenAPI schema.
        *problem_types : ProblemType
            Problem types of the route.
        status : int
            HTTP status of a successful response.
        model : type or None
            Schema of a successful response if the handler returns bytes.
        content : dict or None
            OpenAPI request body if the handler reads the body itself.
        responses : mapping or None
            Further OpenAPI responses by status.
        """
        method, _, path = route.rpartition(" ")
        takes_json = method in METHODS_WITH_BODY and content is None
        if takes_json:
            problem_types = tuple(dict.fromkeys((*problem_types, *BODY_PROBLEMS)))
        is_raw = model is None and responses is not None and status in responses
        self.router.add_api_route(
            path,
            endpoint,
            methods=[method or "GET"],
            route_class_override=JsonRoute if takes_json else None,
            status_code=status,
            operation_id=operation_id,
            tags=[tag],
            summary=summary,
            response_description=summary,
            response_class=Response if is_raw else JSONResponse,
            response_model=Default(None) if model is None else model,  # Default: the handler's return annotation
            openapi_extra=None if content is None else {"requestBody": content},
            responses={**openapi_responses(*problem_types, *self.common_problems), **(responses or {})},
        )
