"""How an address is made known to the application and its schema.

HEAD requests: answered as GET, without the content.
Threads for work that waits on files, so that the event loop never does.
"""

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
    """Hands HEAD on as GET; the server, which knows what was asked, leaves the content out.

    Parameters
    ----------
    app : ASGI application
        Who answers.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on."""
        is_head = scope["type"] == "http" and scope["method"] == "HEAD"
        await self._app({**scope, "method": "GET", "rig.head": True} if is_head else scope, receive, send)


T = TypeVar("T")


class BoundedThreadPool:
    """A bounded number of threads with a bounded queue before them.

    Parameters
    ----------
    threads : int
        How many pieces of work go on at once.
    waiting : int
        How many may wait; one more is turned away.
    """

    def __init__(self, threads: int, waiting: int) -> None:
        self._limiter = CapacityLimiter(threads)
        self._room = threads + waiting
        self._inside = 0

    async def run(self, work: Callable[[], T]) -> T:
        """Return what ``work`` returns, done in a thread; ProblemError (busy) where too many are waiting already."""
        if self._inside >= self._room:
            raise ProblemError(ProblemType.BUSY, f"{self._inside} requests for files are under way or waiting already")
        self._inside += 1  # here and not in the limiter, which counts only when the event loop comes round
        try:
            return await to_thread.run_sync(work, limiter=self._limiter)
        finally:
            self._inside -= 1


PREFIX: Final = "/api/v1"
RunId = Annotated[
    str, Path(description="Id of the run, as /api/v1/runs lists it", examples=["2026-11-24T09-12-07-gj90c"])
]
IfMatch = Annotated[
    str | None,
    Header(
        alias="If-Match",
        description="The `ETag` of the answer that the change rests on: 412 where it is another by now",
        examples=["*"],
    ),
]
EVENTS: Final = "text/event-stream"
WITH_JSON: Final = frozenset({"POST", "PATCH"})
JSON_PROBLEMS: Final = (
    ProblemType.INVALID_PARAMETER,
    ProblemType.CROSS_SITE_REQUEST,
    ProblemType.UNSUPPORTED_MEDIA_TYPE,
    ProblemType.CONTENT_TOO_LARGE,
    ProblemType.REQUEST_TIMEOUT,
)
MOST_JSON: Final = 1024**2  # bytes
PATIENCE: Final = 30.0  # s for all of it


def event_stream(name: str) -> dict[int | str, dict[str, Any]]:
    """Return how OpenAPI tells of server-sent events of a name; the schema is that of each event."""
    data = {"type": "string", "contentMediaType": "application/json"}
    properties = {"event": {"type": "string", "const": name}, "data": data}
    event = {"type": "object", "properties": properties, "required": ["event", "data"]}
    return {200: {"content": {EVENTS: {"schema": event}}}}


class JsonRoute(APIRoute):
    """A route that takes JSON, not too much, and says so: no form of another site's page can send that."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the handler, with a look at the content's type before it."""
        handle = super().get_route_handler()

        async def checked(request: Request) -> Response:
            sent = request.headers.get("content-type", "")
            if sent.partition(";")[0].strip().lower() != "application/json":
                raise ProblemError(
                    ProblemType.UNSUPPORTED_MEDIA_TYPE, f"{sent or 'no type'!r}, expected application/json"
                )
            size = "" if "transfer-encoding" in request.headers else request.headers.get("content-length", "")
            if not size.isdecimal() or int(size) > MOST_JSON:
                raise ProblemError(
                    ProblemType.CONTENT_TOO_LARGE, f"{size or 'unknown'} bytes, expected at most {MOST_JSON:,}"
                )
            try:
                with fail_after(PATIENCE):
                    await request.body()  # kept for whoever reads it
            except TimeoutError as error:
                raise ProblemError(
                    ProblemType.REQUEST_TIMEOUT, f"{size} bytes did not come within {PATIENCE:g} s"
                ) from error
            return await handle(request)

        return checked


@dataclass(frozen=True, slots=True)
class Routing:
    """Adds addresses to a router, each with every way in which it can fail.

    Parameters
    ----------
    router : APIRouter
        Where they are added.
    always : tuple of ProblemType
        Problems that every address may answer with.
    """

    router: APIRouter
    always: tuple[ProblemType, ...]

    def add(  # noqa: PLR0913 - each says one thing that the schema says
        self,
        address: str,
        endpoint: Callable[..., Any],
        name: str,
        tag: str,
        summary: str,
        *problem_types: ProblemType,
        status: int = 200,
        model: type | None = None,
        content: dict[str, Any] | None = None,
        answers: Mapping[int | str, dict[str, Any]] | None = None,
    ) -> None:
        """Add an address.

        Parameters
        ----------
        address, endpoint : str, callable
            The path, with the method before it where that is not GET, and who answers.
        name, tag, summary : str
            Its operation, group and meaning in the schema.
        *problem_types : ProblemType
            How it can fail.
        status : int
            Of a good answer.
        model : type or None
            The document of a good answer where the endpoint returns bytes.
        content : dict or None
            What is sent with the request where the endpoint reads it itself, as OpenAPI writes it.
        answers : mapping or None
            Further answers by status, as OpenAPI writes them.
        """
        method, _, path = address.rpartition(" ")
        takes_json = method in WITH_JSON and content is None
        if takes_json:
            problem_types = tuple(dict.fromkeys((*problem_types, *JSON_PROBLEMS)))
        is_raw = model is None and answers is not None and status in answers
        self.router.add_api_route(
            path,
            endpoint,
            methods=[method or "GET"],
            route_class_override=JsonRoute if takes_json else None,
            status_code=status,
            operation_id=name,
            tags=[tag],
            summary=summary,
            response_description=summary,
            response_class=Response if is_raw else JSONResponse,
            response_model=Default(None) if model is None else model,  # without one, what the endpoint says it returns
            openapi_extra=None if content is None else {"requestBody": content},
            responses={**openapi_responses(*problem_types, *self.always), **(answers or {})},
        )
