"""Problem types of the service and their responses (RFC 9457): OpenAPI description and exception handlers."""

import logging
from collections.abc import Mapping
from enum import Enum
from typing import Any, Final, TypeAlias

from fastapi import Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import Field
from starlette.exceptions import HTTPException
from starlette.routing import Match

from daq.reports.errors import (
    ArrowUnavailableError,
    DataNotFoundError,
    InsufficientDataError,
    RequestTooLargeError,
)
from daq.schemas.units import Schema
from daq.session.processes import WorkerStoppedError, WorkerTimeoutError
from recordings.errors import (
    AnnotationError,
    DamagedError,
    NotFoundError,
    RecordingError,
    RunExistsError,
    StorageError,
    UnknownFormatError,
)


class Fault(Schema):
    """An invalid parameter."""

    parameter: str = Field(description="Location (query, path or body) and name", examples=["query.limit"])
    detail: str = Field(
        description="The value and what was expected",
        examples=["'0': expected a number greater than or equal to 1"],
    )


class ProblemSchema(Schema):
    """A failed request (RFC 9457, application/problem+json)."""

    type: str = Field(
        description="URL of the problem type's explanation; programs branch on its fragment",
        examples=["/docs#run-not-found"],
    )
    title: str = Field(description="Title of the problem type", examples=["Run not found"])
    status: int = Field(description="HTTP status of the response", examples=[404])
    detail: str = Field(
        description="Cause in this request", examples=["no run '2026-11-24T09-12-07-gj90c' in this data folder"]
    )
    instance: str = Field(description="Path of the request", examples=["/api/v1/runs/2026-11-24T09-12-07-gj90c"])
    faults: tuple[Fault, ...] = Field(
        description="All invalid parameters; empty if the problem has another cause", examples=[[]]
    )
    job: dict[str, Any] | None = Field(
        description="Job request for the same result without time limit, for POST /api/v1/jobs; null if there is none",
        examples=[None],
    )


class ProblemType(Enum):
    """A problem type (RFC 9457): HTTP status, title, and an explanation of cause and remedy."""

    INVALID_PARAMETER = (
        422,
        "A parameter is invalid",
        "Unknown, malformed or out of range; `faults` names all invalid parameters.",
    )
    RUN_NOT_FOUND = (404, "Run not found", "No recording in the data folder has this id. /api/v1/runs lists the ids.")
    NO_LIVE_RUN = (
        404,
        "No run is in progress",
        "The service works, but nothing is being recorded or replayed now. Try again later.",
    )
    NOT_FOUND = (404, "Not found", "No route has this path. /docs lists all routes.")
    METHOD_NOT_ALLOWED = (405, "Method not allowed", "`Allow` names the methods of this path.")
    NO_DATA = (
        404,
        "The run has no data at this time or speed",
        "No order frame, sample or prediction lies at or near this time or speed; `detail` names what is available.",
    )
    INSUFFICIENT_DATA = (
        409,
        "The samples are insufficient for this analysis",
        "Too few revolutions, no usable shaft angle from the tacho, an order above the bandwidth; see `detail`.",
    )
    RESPONSE_TOO_LARGE = (413, "The response would be too large", "Request a shorter time range.")
    NOT_ACCEPTABLE = (
        406,
        "No acceptable format is available",
        "`Accept` must allow one of the media types of the response.",
    )
    CROSS_SITE_REQUEST = (
        403,
        "Requests from other sites are not allowed",
        "The request comes from a web page of another site, which the service's `--cors` option does not allow.",
    )
    UNSUPPORTED_MEDIA_TYPE = (415, "The content type is not supported", "Send the content type that `detail` names.")
    RUN_CANNOT_START = (
        409,
        "The run cannot be started",
        "Another run is in progress, or the device or the disk is not ready; see `detail`.",
    )
    RUN_EXISTS = (409, "The run exists already", "Recordings are never overwritten: choose another id.")
    PRECONDITION_FAILED = (
        412,
        "The resource has changed",
        "It has changed since the response whose `ETag` was sent as `If-Match`; request it again.",
    )
    NOT_IN_TRASH = (
        404,
        "The trash has no such run",
        "It was never deleted, or has been restored. /api/v1/trash lists the runs in the trash.",
    )
    INVALID_RECORDING = (
        422,
        "The content is not a complete recording",
        "The content was checked and discarded; see `detail`.",
    )
    UNREADABLE_UPLOAD = (
        409,
        "The uploaded file cannot be read",
        "It is not in the format of its suffix, is truncated, or has no numeric columns; see `detail`.",
    )
    UPLOAD_NOT_FOUND = (404, "Upload not found", "It never existed, was deleted, or has expired.")
    TOO_MANY_UPLOADS = (
        429,
        "Too many uploads are stored",
        "Delete an upload that is not needed; `Retry-After` gives the earliest time for another attempt.",
    )
    REQUEST_TIMEOUT = (
        408,
        "The content arrives too slowly",
        "No content arrived within the time limit; the part received is discarded.",
    )
    CONTENT_TOO_LARGE = (
        413,
        "The content is too large",
        "It exceeds the limit or the free disk space, or the request does not state its size.",
    )
    RANGE_NOT_SATISFIABLE = (416, "The range lies outside the file", "`Content-Range` gives the file's size.")
    MODEL_NOT_READY = (503, "The model is not ready", "Its map is being computed; try again later.")
    RUN_UNDER_WAY = (
        409,
        "The run is still in progress",
        "The summary is available after its end; /api/v1/live gives its current state.",
    )
    RUN_DAMAGED = (
        409,
        "The recording is damaged",
        "The file is truncated, empty or not a recording. The run is listed, but has no summary.",
    )
    RUN_FORMAT_UNKNOWN = (
        409,
        "The recording has an unknown format version",
        "Another version of the program wrote the file. The run is listed, but this version cannot read it.",
    )
    TOKEN_REQUIRED = (
        401,
        "A token is required",
        "Other machines can reach the service: every request to /api needs `Authorization: Bearer <token>`.",
    )
    HOST_NOT_ALLOWED = (
        421,
        "The host name is not allowed",
        "A service bound to loopback accepts only localhost, 127.0.0.1 and [::1], against DNS rebinding.",
    )
    BUSY = (503, "Too many requests are waiting", "Try again after the seconds that `Retry-After` gives.")
    STORAGE_UNAVAILABLE = (
        503,
        "The data folder cannot be read or written",
        "It is missing, unreadable, read-only, full or was removed; see `detail`.",
    )
    TIME_LIMIT_EXCEEDED = (
        503,
        "The request exceeds its time limit",
        "A job has no such limit: POST the content of `job` to /api/v1/jobs.",
    )
    TOO_MANY_JOBS = (
        429,
        "Too many jobs are waiting",
        "Wait for one to end, or delete one; `Retry-After` gives the earliest time for another attempt.",
    )
    JOB_NOT_FOUND = (404, "Job not found", "It never existed, was deleted, or has expired.")
    NO_RESULT = (409, "The job has no result", "It has not ended yet, or it failed; see `detail`.")
    INTERNAL_ERROR = (500, "Internal error", "A defect of the program; its log has the details.")

    def __init__(self, status: int, title: str, explanation: str) -> None:
        self.status = status
        self.title = title
        self.explanation = explanation

    @property
    def slug(self) -> str:
        """The fragment of the problem's ``type``, for example ``run-not-found``."""
        return self.name.lower().replace("_", "-")


RUN_READ_PROBLEMS = (
    ProblemType.RUN_NOT_FOUND,
    ProblemType.INVALID_PARAMETER,
    ProblemType.RUN_UNDER_WAY,
    ProblemType.RUN_DAMAGED,
    ProblemType.RUN_FORMAT_UNKNOWN,
    ProblemType.TIME_LIMIT_EXCEEDED,
    ProblemType.STORAGE_UNAVAILABLE,
    ProblemType.BUSY,
)
"""Problems of every request that reads a recorded run."""


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
    RunExistsError: ProblemType.RUN_EXISTS,
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
    if error.status_code == HTTP_NOT_MODIFIED:  # `http_semantics.require_modified`
        return Response(status_code=HTTP_NOT_MODIFIED, headers=error.headers)
    if error.status_code == ProblemType.METHOD_NOT_ALLOWED.status:
        not_allowed, headers = ProblemType.METHOD_NOT_ALLOWED, {"Allow": ", ".join(_allowed_methods(request))}
        return problem_response(not_allowed, not_allowed.explanation, path, headers=headers)
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
