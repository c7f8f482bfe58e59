"""Every kind of problem that a request can meet.

What goes wrong, told as RFC 9457 tells it.
"""

from enum import Enum
from typing import Any

from pydantic import Field

from daq.schemas.units import Schema


class Fault(Schema):
    """One parameter that is wrong."""

    parameter: str = Field(description="Where it stands: query or path, and its name", examples=["query.limit"])
    detail: str = Field(
        description="What was given and what was expected",
        examples=["'0': expected a number greater than or equal to 1"],
    )


class ProblemSchema(Schema):
    """A request that could not be answered (RFC 9457, application/problem+json)."""

    type: str = Field(
        description="Address of the problem's explanation; names the kind of problem for programs",
        examples=["/docs#run-not-found"],
    )
    title: str = Field(description="The kind of problem in words", examples=["There is no such run"])
    status: int = Field(description="HTTP status of the answer", examples=[404])
    detail: str = Field(description="This case", examples=["no run '2026-11-24T09-12-07-gj90c' in this data folder"])
    instance: str = Field(description="What was asked for", examples=["/api/v1/runs/2026-11-24T09-12-07-gj90c"])
    faults: tuple[Fault, ...] = Field(
        description="Every parameter that is wrong; empty where it is not about parameters", examples=[[]]
    )
    job: dict[str, Any] | None = Field(
        description="What to POST to /api/v1/jobs for the same without a time limit; null where no job does it",
        examples=[None],
    )


class ProblemType(Enum):
    """A kind of problem: its HTTP status, its title, and when it is met and what to do."""

    INVALID_PARAMETER = (
        422,
        "A parameter is wrong",
        "Unknown, malformed or out of range; `faults` names every one of them.",
    )
    RUN_NOT_FOUND = (
        404,
        "There is no such run",
        "No recording in the data folder has this id. Ids are listed by /api/v1/runs.",
    )
    NO_LIVE_RUN = (
        404,
        "No run is under way",
        "The service is well, but nothing is recorded or replayed now. Ask again later.",
    )
    NOT_FOUND = (
        404,
        "There is nothing at this address",
        "The addresses that exist are listed on /docs.",
    )
    METHOD_NOT_ALLOWED = (
        405,
        "This cannot be done here",
        "`Allow` names the methods that this address knows.",
    )
    NO_DATA = (
        404,
        "The run holds nothing there",
        "No frame, sample or prediction lies at or near this time or speed; `detail` tells what there is.",
    )
    INSUFFICIENT_DATA = (
        409,
        "The samples do not tell this",
        "Too few revolutions, a tacho that does not tell the angle, an order out of reach; `detail` says which.",
    )
    RESPONSE_TOO_LARGE = (
        413,
        "More than one answer may hold",
        "Ask for a shorter stretch at a time.",
    )
    NOT_ACCEPTABLE = (
        406,
        "No form that is accepted can be sent",
        "`Accept` must allow one of the types of the answer.",
    )
    CROSS_SITE_REQUEST = (
        403,
        "Another site may not ask for this",
        "A page that is not the service's own asks.",
    )
    UNSUPPORTED_MEDIA_TYPE = (
        415,
        "The content's type is not the one expected",
        "Send `Content-Type: application/json`.",
    )
    RUN_CANNOT_START = (
        409,
        "No run can be started now",
        "Another is under way, or device or disk stand against it.",
    )
    RUN_EXISTS = (
        409,
        "There is such a run already",
        "Nothing is ever written over a recording: choose another id.",
    )
    PRECONDITION_FAILED = (
        412,
        "It is not what it was",
        "Somebody has changed it since the answer whose `ETag` was sent as `If-Match`; ask for it again.",
    )
    NOT_IN_TRASH = (
        404,
        "There is no such run in the trash",
        "It was never put away, or was taken back. What lies there is listed by /api/v1/trash.",
    )
    INVALID_RECORDING = (
        422,
        "What was sent is no whole recording",
        "It was looked through and not kept; see `detail`.",
    )
    UNREADABLE_UPLOAD = (
        409,
        "What was sent cannot be read",
        "It is no file of the format that its name tells, is cut short, or holds no columns of numbers; see `detail`.",
    )
    UPLOAD_NOT_FOUND = (
        404,
        "There is no such upload",
        "It was never sent, was deleted, or was sent so long ago that it is forgotten.",
    )
    TOO_MANY_UPLOADS = (
        429,
        "Too many uploads are kept",
        "Delete one that nobody needs; `Retry-After` says when to ask again at the earliest.",
    )
    REQUEST_TIMEOUT = (
        408,
        "What is sent comes too slowly",
        "Nothing came for so long that the rest is not waited for; nothing of it is kept.",
    )
    CONTENT_TOO_LARGE = (
        413,
        "What was sent is too large",
        "It passes the limit, or what room the disk has left, or does not tell its size.",
    )
    RANGE_NOT_SATISFIABLE = (
        416,
        "The range lies outside the file",
        "`Content-Range` gives the file's size.",
    )
    MODEL_NOT_READY = (
        503,
        "The model has no answer yet",
        "Its map is being computed; ask again later.",
    )
    RUN_UNDER_WAY = (
        409,
        "The run has not ended",
        "A summary is given when it has; /api/v1/live tells how it stands now.",
    )
    RUN_DAMAGED = (
        409,
        "The recording is not whole",
        "The file is cut short, empty or no recording. The run is listed, but no summary can be given as it stands.",
    )
    RUN_FORMAT_UNKNOWN = (
        409,
        "The recording's format is not known here",
        "Another version of the program wrote the file. The run is listed, but this version cannot read it.",
    )
    TOKEN_REQUIRED = (
        401,
        "A token is needed",
        "Other machines can reach the service, so every request to /api carries `Authorization: Bearer <token>`.",
    )
    HOST_NOT_ALLOWED = (
        421,
        "This name does not belong to the service",
        "A service of this machine alone answers to localhost, 127.0.0.1 and [::1]; another name may be a trick.",
    )
    BUSY = (
        503,
        "Too many requests are waiting",
        "Ask again after the seconds that `Retry-After` gives.",
    )
    STORAGE_UNAVAILABLE = (
        503,
        "The data folder cannot be read or written",
        "It is missing, unreadable, read-only, full or was taken away; see `detail`.",
    )
    TIME_LIMIT_EXCEEDED = (
        503,
        "This takes longer than an answer may",
        "A job does it without that limit: send what `job` says to /api/v1/jobs with POST.",
    )
    TOO_MANY_JOBS = (
        429,
        "Too many jobs are waiting",
        "Wait for one to end, or delete one that nobody needs; `Retry-After` says when to ask again at the earliest.",
    )
    JOB_NOT_FOUND = (
        404,
        "There is no such job",
        "It was never begun, was deleted, or ended so long ago that it is forgotten.",
    )
    NO_RESULT = (
        409,
        "The job has no result",
        "It has not ended yet, or it failed; see `detail`.",
    )
    INTERNAL_ERROR = (
        500,
        "The service failed",
        "A fault of the program; its log tells more.",
    )

    def __init__(self, status: int, title: str, explanation: str) -> None:
        self.status = status
        self.title = title
        self.explanation = explanation

    @property
    def slug(self) -> str:
        """The last part of the problem's ``type``."""
        return self.name.lower().replace("_", "-")


READING = (
    ProblemType.RUN_NOT_FOUND,
    ProblemType.INVALID_PARAMETER,
    ProblemType.RUN_UNDER_WAY,
    ProblemType.RUN_DAMAGED,
    ProblemType.RUN_FORMAT_UNKNOWN,
    ProblemType.TIME_LIMIT_EXCEEDED,
    ProblemType.STORAGE_UNAVAILABLE,
    ProblemType.BUSY,
)
"""How every question about a recorded run can fail."""
