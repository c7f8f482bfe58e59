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

from daq.service.problem_types import Fault, Kind, ProblemSchema
from recordings.errors import DamagedError, NotFoundError, RecordingError, StorageError, UnknownFormatError

PROBLEM_TYPE: Final = "application/problem+json"
UNREADABLE: Final = 400
MOST_ECHOED: Final = 200  # letters of what was sent that an answer repeats
METHODS: Final = ("DELETE", "GET", "PATCH", "POST", "PUT")
REFERENCE: Final = "/docs#"
PASSING: Final = frozenset(
    {Kind.BUSY, Kind.STORAGE_UNAVAILABLE, Kind.MODEL_NOT_READY, Kind.TOO_MANY_JOBS, Kind.TOO_MANY_UPLOADS}
)
"""Problems that may be over in a moment: `Retry-After` says when to ask again."""


JobHint: TypeAlias = dict[str, Any]


class ProblemError(Exception):
    """A request that cannot be answered.

    Parameters
    ----------
    kind : Kind
        What kind of problem it is.
    detail : str
        This case.
    job : dict or None
        The order for a job that does it; None where none does.
    """

    def __init__(self, kind: Kind, detail: str, job: JobHint | None = None) -> None:
        self.kind = kind
        self.detail = detail
        self.job = job
        super().__init__(detail)


def problem_response(
    kind: Kind,
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
    kind : Kind
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
    document = _document(kind, detail, instance, faults, status, job)
    extra = {"Cache-Control": "no-store", **(headers or {})}
    if kind is Kind.TOKEN_NEEDED:
        extra["WWW-Authenticate"] = 'Bearer realm="rig"'
    if kind in PASSING:
        extra["Retry-After"] = "2"
    if kind is Kind.BUSY:  # a client that has to come again need not keep its place meanwhile
        extra["Connection"] = "close"
    return Response(document.model_dump_json(), status_code=document.status, headers=extra, media_type=PROBLEM_TYPE)


def recording_problem(error: RecordingError) -> Kind:
    """Return the kind of problem that an error of the recordings is."""
    by_error: tuple[tuple[type[RecordingError], Kind], ...] = (
        (NotFoundError, Kind.RUN_NOT_FOUND),
        (DamagedError, Kind.RUN_DAMAGED),
        (UnknownFormatError, Kind.RUN_FORMAT_UNKNOWN),
        (StorageError, Kind.STORAGE_UNAVAILABLE),
    )
    return next((kind for error_type, kind in by_error if isinstance(error, error_type)), Kind.INTERNAL)


def openapi_responses(*kinds: Kind) -> dict[int | str, dict[str, Any]]:
    """Return the problems that a route may answer with, as OpenAPI tells them, by status."""
    responses: dict[int | str, dict[str, Any]] = {}
    for kind in kinds:
        known = responses.setdefault(kind.status, {"description": "", "content": {PROBLEM_TYPE: _no_examples()}})
        known["description"] = "; ".join(filter(None, (known["description"], f"{kind.title} (`{kind.slug}`)")))
        known["content"][PROBLEM_TYPE]["examples"][kind.slug] = {
            "summary": kind.title,
            "value": _document(kind, kind.explanation, "/api/v1/…").model_dump(mode="json"),
        }
    return responses


def _no_examples() -> dict[str, Any]:
    return {"schema": {"$ref": "#/components/schemas/ProblemSchema"}, "examples": {}}


def _document(
    kind: Kind,
    detail: str,
    instance: str,
    faults: tuple[Fault, ...] = (),
    status: int | None = None,
    job: JobHint | None = None,
) -> ProblemSchema:
    return ProblemSchema(
        type=REFERENCE + kind.slug,
        title=kind.title,
        status=status or kind.status,
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
    return problem_response(error.kind, error.detail, request.url.path, job=error.job)


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
    return problem_response(Kind.BAD_PARAMETER, detail, request.url.path, faults=faults)


async def _of_http(request: Request, error: HTTPException) -> Response:
    path = request.url.path
    if error.status_code == Kind.METHOD_NOT_ALLOWED.status:
        return problem_response(
            Kind.METHOD_NOT_ALLOWED,
            Kind.METHOD_NOT_ALLOWED.explanation,
            path,
            headers={"Allow": ", ".join(_methods(request))},
        )
    if error.status_code == UNREADABLE:  # content that is no JSON at all
        return problem_response(Kind.BAD_PARAMETER, str(error.detail), path)
    detail = f"there is nothing at {_short(path)}" if error.status_code == Kind.NOT_FOUND.status else str(error.detail)
    return problem_response(Kind.NOT_FOUND, detail, path, status=error.status_code, headers=error.headers)


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


class LastResort:
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
            await problem_response(Kind.INTERNAL, detail, scope["path"])(scope, receive, send)
