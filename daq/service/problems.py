"""Every way in which a request can fail, with the status that says so and the words that explain it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.routing import Match

from daq.service.documents.problem import Fault, ProblemDocument
from recordings.errors import DamagedError, NotFoundError, RecordingError, StorageError, UnknownFormatError

MEDIA_TYPE: Final = "application/problem+json"
UNREADABLE: Final = 400
METHODS: Final = ("DELETE", "GET", "PATCH", "POST", "PUT")
REFERENCE: Final = "/docs#"


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of problem.

    Parameters
    ----------
    name : str
        Its name, the last part of the problem's ``type``.
    status : int
        HTTP status.
    title : str
        The kind in words.
    explanation : str
        When it is met, and what to do.
    """

    name: str
    status: int
    title: str
    explanation: str


BAD_PARAMETER = Kind(
    "bad-parameter",
    422,
    "A parameter is wrong",
    "Unknown, malformed or out of range; `faults` names every one of them.",
)
RUN_NOT_FOUND = Kind(
    "run-not-found",
    404,
    "There is no such run",
    "No recording in the data folder has this id. Ids are listed by /api/v1/runs.",
)
NO_LIVE_RUN = Kind(
    "no-live-run",
    404,
    "No run is under way",
    "The service is well, but nothing is recorded or replayed now. Ask again later.",
)
NOT_FOUND = Kind("not-found", 404, "There is nothing at this address", "The addresses that exist are listed on /docs.")
METHOD = Kind(
    "method-not-allowed", 405, "This cannot be done here", "`Allow` names the methods that this address knows."
)
NO_SUCH_MOMENT = Kind(
    "no-such-moment",
    404,
    "The run holds nothing there",
    "No frame, sample or prediction lies at or near this time or speed; `detail` tells what there is.",
)
TOO_MUCH = Kind("too-much", 413, "More than one answer may hold", "Ask for a shorter stretch at a time.")
NOT_ACCEPTABLE = Kind(
    "not-acceptable", 406, "No form that is accepted can be sent", "`Accept` must allow one of the types of the answer."
)
CROSS_SITE = Kind(
    "cross-site",
    403,
    "Another site may not ask for this",
    "A page that is not the service's own asks.",
)
MEDIA = Kind("media-type", 415, "The content's type is not the one expected", "Send `Content-Type: application/json`.")
RUN_NOT_POSSIBLE = Kind(
    "run-not-possible", 409, "No run can be started now", "Another is under way, or device or disk stand against it."
)
RUN_EXISTS = Kind(
    "run-exists", 409, "There is such a run already", "Nothing is ever written over a recording: choose another id."
)
NO_RECORDING = Kind(
    "no-recording", 422, "What was sent is no whole recording", "It was looked through and not kept; see `detail`."
)
TOO_LARGE = Kind("too-large", 413, "The file is too large", "It passes the limit, or what room the disk has left.")
RANGE = Kind("range-not-satisfiable", 416, "The range lies outside the file", "`Content-Range` gives the file's size.")
MODEL_NOT_READY = Kind(
    "model-not-ready", 503, "The model has no answer yet", "Its map is being computed; ask again later."
)
RUN_UNDER_WAY = Kind(
    "run-under-way",
    409,
    "The run has not ended",
    "A summary is given when it has; /api/v1/live tells how it stands now.",
)
RUN_DAMAGED = Kind(
    "run-damaged",
    409,
    "The recording is not whole",
    "The file is cut short, empty or no recording. The run is listed, but no summary can be given of it as it stands.",
)
RUN_FORMAT = Kind(
    "run-format-unknown",
    409,
    "The recording's format is not known here",
    "Another version of the program wrote the file. The run is listed, but this version cannot read it.",
)
TOKEN = Kind(
    "token-needed",
    401,
    "A token is needed",
    "The service can be reached from other machines, so every request to /api carries `Authorization: Bearer <token>`.",
)
HOST = Kind(
    "host-not-allowed",
    421,
    "This name does not belong to the service",
    "A service of this machine alone answers to localhost, 127.0.0.1 and [::1]; another name may be a trick.",
)
BUSY = Kind("busy", 503, "Too many requests are waiting", "Ask again after the seconds that `Retry-After` gives.")
STORAGE = Kind(
    "storage-unavailable",
    503,
    "The data folder cannot be read",
    "It is missing, unreadable or was taken away; see `detail`.",
)
INTERNAL = Kind("internal", 500, "The service failed", "A fault of the program; its log tells more.")

KINDS: Final = (
    BAD_PARAMETER, RUN_NOT_FOUND, NO_LIVE_RUN, NOT_FOUND, METHOD, RUN_UNDER_WAY, RUN_DAMAGED, RUN_FORMAT, TOKEN, HOST,
    BUSY, STORAGE, INTERNAL, NO_SUCH_MOMENT, TOO_MUCH, NOT_ACCEPTABLE, RANGE, MODEL_NOT_READY, CROSS_SITE, MEDIA,
    RUN_NOT_POSSIBLE, RUN_EXISTS, NO_RECORDING, TOO_LARGE,
)  # fmt: skip


class ProblemError(Exception):
    """A request that cannot be answered.

    Parameters
    ----------
    kind : Kind
        What kind of problem it is.
    detail : str
        This case.
    """

    def __init__(self, kind: Kind, detail: str) -> None:
        self.kind = kind
        self.detail = detail
        super().__init__(detail)


def problem_response(
    kind: Kind,
    detail: str,
    instance: str,
    *,
    faults: tuple[Fault, ...] = (),
    status: int | None = None,
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
    headers : mapping of str to str or None
        Further headers.
    """
    document = ProblemDocument(
        type=REFERENCE + kind.name,
        title=kind.title,
        status=status or kind.status,
        detail=detail,
        instance=instance,
        faults=faults,
    )
    extra = {"Cache-Control": "no-store", **(headers or {})}
    if kind is TOKEN:
        extra["WWW-Authenticate"] = 'Bearer realm="rig"'
    if kind in (BUSY, STORAGE, MODEL_NOT_READY):
        extra["Retry-After"] = "2"
    return Response(document.model_dump_json(), status_code=document.status, headers=extra, media_type=MEDIA_TYPE)


def recording_problem(error: RecordingError) -> Kind:
    """Return the kind of problem that an error of the recordings is."""
    by_error: tuple[tuple[type[RecordingError], Kind], ...] = (
        (NotFoundError, RUN_NOT_FOUND),
        (DamagedError, RUN_DAMAGED),
        (UnknownFormatError, RUN_FORMAT),
        (StorageError, STORAGE),
    )
    return next((kind for error_type, kind in by_error if isinstance(error, error_type)), INTERNAL)


def openapi_responses(*kinds: Kind) -> dict[int | str, dict[str, Any]]:
    """Return the problems that a route may answer with, as OpenAPI tells them, by status."""
    responses: dict[int | str, dict[str, Any]] = {}
    for kind in kinds:
        known = responses.setdefault(
            kind.status,
            {
                "description": "",
                "content": {
                    MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/ProblemDocument"}, "examples": {}},
                },
            },
        )
        known["description"] = "; ".join(filter(None, (known["description"], f"{kind.title} (`{kind.name}`)")))
        known["content"][MEDIA_TYPE]["examples"][kind.name] = {
            "summary": kind.title,
            "value": {
                "type": REFERENCE + kind.name,
                "title": kind.title,
                "status": kind.status,
                "detail": kind.explanation,
                "instance": "/api/v1/…",
                "faults": [],
            },
        }
    return responses


def install(app: FastAPI) -> None:
    """Make ``app`` answer every error that is expected with a problem document."""
    app.exception_handler(ProblemError)(_of_problem)
    app.exception_handler(RecordingError)(_of_recording)
    app.exception_handler(RequestValidationError)(_of_validation)
    app.exception_handler(HTTPException)(_of_http)


async def _of_problem(request: Request, error: ProblemError) -> Response:
    return problem_response(error.kind, error.detail, request.url.path)


async def _of_recording(request: Request, error: RecordingError) -> Response:
    return problem_response(recording_problem(error), str(error), request.url.path)


async def _of_validation(request: Request, error: RequestValidationError) -> Response:
    faults = tuple(
        Fault(
            parameter=".".join(str(part) for part in fault["loc"]),
            detail=f"{fault['input']!r}: {fault['msg'][:1].lower()}{fault['msg'][1:]}",
        )
        for fault in error.errors()
    )
    detail = "; ".join(f"{fault.parameter} = {fault.detail}" for fault in faults)
    return problem_response(BAD_PARAMETER, detail, request.url.path, faults=faults)


async def _of_http(request: Request, error: HTTPException) -> Response:
    path = request.url.path
    if error.status_code == METHOD.status:
        return problem_response(METHOD, METHOD.explanation, path, headers={"Allow": ", ".join(_methods(request))})
    if error.status_code == UNREADABLE:  # content that is no JSON at all
        return problem_response(BAD_PARAMETER, str(error.detail), path)
    detail = f"there is nothing at {path}" if error.status_code == NOT_FOUND.status else str(error.detail)
    return problem_response(NOT_FOUND, detail, path, status=error.status_code, headers=error.headers)


def _methods(request: Request) -> list[str]:
    """Return the methods that an address knows, whichever of its routes."""
    scope = dict(request.scope)
    return sorted(
        method
        for method in METHODS
        if any(route.matches({**scope, "method": method})[0] is Match.FULL for route in request.app.routes)
    )
