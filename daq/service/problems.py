"""How a request that fails is answered: with a problem document (RFC 9457).

What happens when the program itself is at fault: the client is told, the log has the rest, the service goes on.
"""

import logging
from collections.abc import Mapping
from typing import Any, Final, TypeAlias

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.routing import Match
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from daq.service.problem_types import Fault, ProblemSchema, ProblemType
from recordings.errors import DamagedError, NotFoundError, RecordingError, StorageError, UnknownFormatError

PROBLEM_TYPE: Final = "application/problem+json"
UNREADABLE: Final = 400
MOST_ECHOED: Final = 200  # letters of what was sent that an answer repeats
METHODS: Final = ("DELETE", "GET", "PATCH", "POST", "PUT")
REFERENCE: Final = "/docs#"
PASSING: Final = frozenset(
    {
        ProblemType.BUSY,
        ProblemType.STORAGE_UNAVAILABLE,
        ProblemType.MODEL_NOT_READY,
        ProblemType.TOO_MANY_JOBS,
        ProblemType.TOO_MANY_UPLOADS,
    }
)
"""Problems that may be over in a moment: `Retry-After` says when to ask again."""


JobHint: TypeAlias = dict[str, Any]


class ProblemError(Exception):
    """A request that cannot be answered.

    Parameters
    ----------
    problem_type : ProblemType
        What kind of problem it is.
    detail : str
        This case.
    job : dict or None
        The order for a job that does it; None where none does.
    """

    def __init__(self, problem_type: ProblemType, detail: str, job: JobHint | None = None) -> None:
        self.problem_type = problem_type
        self.detail = detail
        self.job = job
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
    """Return the answer that tells of a problem.

    Parameters
    ----------
    problem_type : ProblemType
        What kind it is.
    detail, instance : str
        This case, and the path that was asked for.
    faults : tuple of Fault
        Parameters that are wrong.
    status : int or None
        HTTP status where it is not the kind's own.
    job : dict or None
        The order for a job that does it.
    headers : mapping of str to str or None
        Further headers.
    """
    document = _document(problem_type, detail, instance, faults, status, job)
    extra = {"Cache-Control": "no-store", **(headers or {})}
    if problem_type is ProblemType.TOKEN_REQUIRED:
        extra["WWW-Authenticate"] = 'Bearer realm="rig"'
    if problem_type in PASSING:
        extra["Retry-After"] = "2"
    if problem_type is ProblemType.BUSY:  # a client that has to come again need not keep its place meanwhile
        extra["Connection"] = "close"
    return Response(document.model_dump_json(), status_code=document.status, headers=extra, media_type=PROBLEM_TYPE)


def recording_problem(error: RecordingError) -> ProblemType:
    """Return the kind of problem that an error of the recordings is."""
    by_error: tuple[tuple[type[RecordingError], ProblemType], ...] = (
        (NotFoundError, ProblemType.RUN_NOT_FOUND),
        (DamagedError, ProblemType.RUN_DAMAGED),
        (UnknownFormatError, ProblemType.RUN_FORMAT_UNKNOWN),
        (StorageError, ProblemType.STORAGE_UNAVAILABLE),
    )
    return next(
        (problem_type for error_type, problem_type in by_error if isinstance(error, error_type)),
        ProblemType.INTERNAL_ERROR,
    )


def openapi_responses(*problem_types: ProblemType) -> dict[int | str, dict[str, Any]]:
    """Return the problems that a route may answer with, as OpenAPI tells them, by status."""
    responses: dict[int | str, dict[str, Any]] = {}
    for problem_type in problem_types:
        known = responses.setdefault(
            problem_type.status, {"description": "", "content": {PROBLEM_TYPE: _no_examples()}}
        )
        known["description"] = "; ".join(
            filter(None, (known["description"], f"{problem_type.title} (`{problem_type.slug}`)"))
        )
        known["content"][PROBLEM_TYPE]["examples"][problem_type.slug] = {
            "summary": problem_type.title,
            "value": _document(problem_type, problem_type.explanation, "/api/v1/…").model_dump(mode="json"),
        }
    return responses


def _no_examples() -> dict[str, Any]:
    return {"schema": {"$ref": "#/components/schemas/ProblemSchema"}, "examples": {}}


def _document(
    problem_type: ProblemType,
    detail: str,
    instance: str,
    faults: tuple[Fault, ...] = (),
    status: int | None = None,
    job: JobHint | None = None,
) -> ProblemSchema:
    return ProblemSchema(
        type=REFERENCE + problem_type.slug,
        title=problem_type.title,
        status=status or problem_type.status,
        detail=detail,
        instance=_short(instance),
        faults=faults,
        job=job,
    )


def install(app: FastAPI) -> None:
    """Make ``app`` answer every error that is expected with a problem document."""
    app.exception_handler(ProblemError)(_of_problem)
    app.exception_handler(RecordingError)(_of_recording)
    app.exception_handler(RequestValidationError)(_of_validation)
    app.exception_handler(HTTPException)(_of_http)


async def _of_problem(request: Request, error: ProblemError) -> Response:
    return problem_response(error.problem_type, error.detail, request.url.path, job=error.job)


async def _of_recording(request: Request, error: RecordingError) -> Response:
    return problem_response(recording_problem(error), str(error), request.url.path)


async def _of_validation(request: Request, error: RequestValidationError) -> Response:
    faults = tuple(
        Fault(
            parameter=".".join(str(part) for part in fault["loc"]),
            detail=f"{_short(repr(fault['input']))}: {fault['msg'][:1].lower()}{fault['msg'][1:]}",
        )
        for fault in error.errors()
    )
    detail = "; ".join(f"{fault.parameter} = {fault.detail}" for fault in faults)
    return problem_response(ProblemType.INVALID_PARAMETER, detail, request.url.path, faults=faults)


async def _of_http(request: Request, error: HTTPException) -> Response:
    path = request.url.path
    if error.status_code == ProblemType.METHOD_NOT_ALLOWED.status:
        return problem_response(
            ProblemType.METHOD_NOT_ALLOWED,
            ProblemType.METHOD_NOT_ALLOWED.explanation,
            path,
            headers={"Allow": ", ".join(_methods(request))},
        )
    if error.status_code == UNREADABLE:  # content that is no JSON at all
        return problem_response(ProblemType.INVALID_PARAMETER, str(error.detail), path)
    detail = (
        f"there is nothing at {_short(path)}"
        if error.status_code == ProblemType.NOT_FOUND.status
        else str(error.detail)
    )
    return problem_response(ProblemType.NOT_FOUND, detail, path, status=error.status_code, headers=error.headers)


def _short(text: str) -> str:
    return text if len(text) <= MOST_ECHOED else f"{text[:MOST_ECHOED]}…"


def _methods(request: Request) -> list[str]:
    """Return the methods that an address knows, whichever of its routes."""
    scope = dict(request.scope)
    return sorted(
        method
        for method in METHODS
        if any(route.matches({**scope, "method": method})[0] is Match.FULL for route in request.app.routes)
    )


logger = logging.getLogger(__name__)


class UnhandledErrorMiddleware:
    """Turns an exception that nobody expected into a problem document and a log entry.

    Parameters
    ----------
    app : ASGI application
        Who may fail.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on; raise only where an answer has been begun."""
        begun = False

        async def send_on(message: Message) -> None:
            nonlocal begun
            begun = True
            await send(message)

        try:
            await self._app(scope, receive, send_on)
        except Exception as error:  # whatever it is, the service must go on for the others
            if begun or scope["type"] != "http":
                raise
            logger.exception("%s %s failed", scope["method"], scope["path"])
            detail = f"{type(error).__name__}; the service's log tells more"
            await problem_response(ProblemType.INTERNAL_ERROR, detail, scope["path"])(scope, receive, send)
