"""Problem responses (RFC 9457): their OpenAPI description, exception handlers, and middleware for unhandled errors."""

import logging
from collections.abc import Mapping
from typing import Any, Final, TypeAlias

from fastapi import Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.routing import Match
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from daq.reports.errors import (
    ArrowUnavailableError,
    DataNotFoundError,
    InsufficientDataError,
    RequestTooLargeError,
)
from daq.service.problem_types import Fault, ProblemSchema, ProblemType
from daq.session.processes import WorkerStoppedError, WorkerTimeoutError
from recordings.errors import (
    AnnotationError,
    DamagedError,
    NotFoundError,
    RecordingError,
    StorageError,
    UnknownFormatError,
)

PROBLEM_MEDIA_TYPE: Final = "application/problem+json"
HTTP_NOT_MODIFIED: Final = 304
HTTP_BAD_REQUEST: Final = 400
MAX_ECHOED_CHARACTERS: Final = 200  # of a request's value in a response
HTTP_METHODS: Final = ("DELETE", "GET", "PATCH", "POST", "PUT")
PROBLEM_REFERENCE: Final = "/docs#"
PROBLEM_SCHEMA_REFERENCE: Final = f"#/components/schemas/{ProblemSchema.__name__}"
TRANSIENT: Final = frozenset(
    {
        ProblemType.BUSY,
        ProblemType.STORAGE_UNAVAILABLE,
        ProblemType.MODEL_NOT_READY,
        ProblemType.TOO_MANY_JOBS,
        ProblemType.TOO_MANY_UPLOADS,
    }
)
"""Transient problems, sent with `Retry-After`."""


logger = logging.getLogger(__name__)

JobHint: TypeAlias = dict[str, Any]


class ProblemError(Exception):
    """A request that fails with a problem response.

    Parameters
    ----------
    problem_type : ProblemType
        Problem type.
    detail : str
        Cause in this request.
    job : dict or None
        Job request for the same result; None if there is none.
    headers : mapping of str to str or None
        Further headers of the response.
    """

    def __init__(
        self,
        problem_type: ProblemType,
        detail: str,
        *,
        job: JobHint | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> None:
        self.problem_type = problem_type
        self.detail = detail
        self.job = job
        self.headers = headers
        super().__init__(detail)


def problem_response(
    problem_type: ProblemType,
    detail: str,
    instance: str,
    *,
    faults: tuple[Fault, ...] = (),
    status: int | None = None,
    job: JobHint | None = None,
    headers: Mapping[str, str] | None = None,
) -> Response:
    """Return a problem response.

    Parameters
    ----------
    problem_type : ProblemType
        Problem type.
    detail, instance : str
        Cause in this request, and its path.
    faults : tuple of Fault
        Invalid parameters.
    status : int or None
        HTTP status; None for that of the problem type.
    job : dict or None
        Job request for the same result.
    headers : mapping of str to str or None
        Further headers.
    """
    problem = _problem_schema(problem_type, detail, instance, faults, status, job)
    extra = {"Cache-Control": "no-store", **(headers or {})}
    if problem_type is ProblemType.TOKEN_REQUIRED:
        extra["WWW-Authenticate"] = 'Bearer realm="rig"'
    if problem_type in TRANSIENT:
        extra["Retry-After"] = "2"
    if problem_type is ProblemType.BUSY:  # a client that retries later need not hold a connection meanwhile
        extra["Connection"] = "close"
    return Response(problem.model_dump_json(), status_code=problem.status, headers=extra, media_type=PROBLEM_MEDIA_TYPE)


def problems(*problem_types: ProblemType) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI responses of problem types, by status, as ``responses`` of a route."""
    responses: dict[int | str, dict[str, Any]] = {}
    for status in dict.fromkeys(problem_type.status for problem_type in problem_types):
        of_status = [each for each in dict.fromkeys(problem_types) if each.status == status]
        examples = {
            each.slug: {
                "summary": each.title,
                "value": _problem_schema(each, each.explanation, "/api/v1/…").model_dump(mode="json"),
            }
            for each in of_status
        }
        content = {"schema": {"$ref": PROBLEM_SCHEMA_REFERENCE}, "examples": examples}
        responses[status] = {
            "description": "; ".join(f"{each.title} (`{each.slug}`)" for each in of_status),
            "content": {PROBLEM_MEDIA_TYPE: content},
        }
    return responses


def _problem_schema(
    problem_type: ProblemType,
    detail: str,
    instance: str,
    faults: tuple[Fault, ...] = (),
    status: int | None = None,
    job: JobHint | None = None,
) -> ProblemSchema:
    return ProblemSchema(
        type=PROBLEM_REFERENCE + problem_type.slug,
        title=problem_type.title,
        status=status or problem_type.status,
        detail=detail,
        instance=_truncated(instance),
        faults=faults,
        job=job,
    )


async def _handle_problem(request: Request, error: ProblemError) -> Response:
    return problem_response(error.problem_type, error.detail, request.url.path, job=error.job, headers=error.headers)


PROBLEMS_BY_ERROR: Final[dict[type[Exception], ProblemType]] = {
    NotFoundError: ProblemType.RUN_NOT_FOUND,
    DamagedError: ProblemType.RUN_DAMAGED,
    UnknownFormatError: ProblemType.RUN_FORMAT_UNKNOWN,
    AnnotationError: ProblemType.INVALID_PARAMETER,
    StorageError: ProblemType.STORAGE_UNAVAILABLE,
    RecordingError: ProblemType.INTERNAL_ERROR,
    DataNotFoundError: ProblemType.NO_DATA,
    InsufficientDataError: ProblemType.INSUFFICIENT_DATA,
    RequestTooLargeError: ProblemType.RESPONSE_TOO_LARGE,
    ArrowUnavailableError: ProblemType.NOT_ACCEPTABLE,
    WorkerTimeoutError: ProblemType.TIME_LIMIT_EXCEEDED,
    WorkerStoppedError: ProblemType.BUSY,
}


async def _handle_known_error(request: Request, error: Exception) -> Response:
    problem_type = next(PROBLEMS_BY_ERROR[each] for each in type(error).__mro__ if each in PROBLEMS_BY_ERROR)
    if problem_type is ProblemType.INTERNAL_ERROR:
        logger.error("%s %s failed", request.method, request.url.path, exc_info=error)
    return problem_response(problem_type, str(error), request.url.path)


async def _handle_validation_error(request: Request, error: RequestValidationError) -> Response:
    faults = tuple(
        Fault(
            parameter=".".join(str(part) for part in fault["loc"]),
            detail=f"{_truncated(repr(fault['input']))}: {fault['msg'][:1].lower()}{fault['msg'][1:]}",
        )
        for fault in error.errors()
    )
    detail = "; ".join(f"{fault.parameter} = {fault.detail}" for fault in faults)
    return problem_response(ProblemType.INVALID_PARAMETER, detail, request.url.path, faults=faults)


async def _handle_http_exception(request: Request, error: HTTPException) -> Response:
    path = request.url.path
    if error.status_code == HTTP_NOT_MODIFIED:  # `responses.require_modified`
        return Response(status_code=HTTP_NOT_MODIFIED, headers=error.headers)
    if error.status_code == ProblemType.METHOD_NOT_ALLOWED.status:
        return problem_response(
            ProblemType.METHOD_NOT_ALLOWED,
            ProblemType.METHOD_NOT_ALLOWED.explanation,
            path,
            headers={"Allow": ", ".join(_allowed_methods(request))},
        )
    if error.status_code == HTTP_BAD_REQUEST:  # the content is not JSON
        return problem_response(ProblemType.INVALID_PARAMETER, str(error.detail), path)
    detail = (
        f"no route at {_truncated(path)}" if error.status_code == ProblemType.NOT_FOUND.status else str(error.detail)
    )
    return problem_response(ProblemType.NOT_FOUND, detail, path, status=error.status_code, headers=error.headers)


def _truncated(text: str) -> str:
    return text if len(text) <= MAX_ECHOED_CHARACTERS else f"{text[:MAX_ECHOED_CHARACTERS]}…"


def _allowed_methods(request: Request) -> list[str]:
    """Return the methods of all routes that match the request's path."""
    scope = dict(request.scope)
    return sorted(
        method
        for method in HTTP_METHODS
        if any(route.matches({**scope, "method": method})[0] is Match.FULL for route in request.app.routes)
    )


EXCEPTION_HANDLERS: Final[dict[int | type[Exception], Any]] = {
    ProblemError: _handle_problem,
    **dict.fromkeys(PROBLEMS_BY_ERROR, _handle_known_error),
    RequestValidationError: _handle_validation_error,
    HTTPException: _handle_http_exception,
}
"""Handlers that turn expected errors into problem responses."""


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
        except Exception as error:  # the service must stay available to other clients
            if has_started or scope["type"] != "http":
                raise
            logger.exception("%s %s failed", scope["method"], scope["path"])
            detail = f"{type(error).__name__}; see the service's log"
            await problem_response(ProblemType.INTERNAL_ERROR, detail, scope["path"])(scope, receive, send)
