"""HTTP semantics of the routes that FastAPI leaves to them (RFC 9110).

Content negotiation (12.5), ETags with conditional requests (13), byte ranges of files (14), HEAD (9.3.2), and limits on
the JSON that a client sends.
"""

import hashlib
import os
import re
from collections.abc import Callable, Coroutine, Mapping
from pathlib import Path
from typing import Annotated, Any, Final

from anyio import fail_after
from fastapi import Header, HTTPException, Request, Response
from fastapi.responses import FileResponse
from fastapi.routing import APIRoute

from daq.schemas.units import Schema
from daq.service.problems import ProblemError, ProblemType
from recordings.catalogue.catalogue import RunEntry
from recordings.errors import DamagedError

OCTET_STREAM: Final = "application/octet-stream"
BINARY: Final[dict[str, Any]] = {"schema": {"type": "string", "format": "binary"}}
NOT_MODIFIED: Final[dict[int | str, dict[str, Any]]] = {
    304: {"description": "Not changed since the response whose `ETag` was sent as `If-None-Match`"}
}
SINGLE_RANGE: Final = re.compile(r"bytes=(\d{1,18})-(\d{0,18})|bytes=-(\d{1,18})")


def accepts_gzip(header: str | None) -> bool:
    """Return whether an Accept-Encoding header allows gzip, by name or by ``*``."""
    weights = _quality_values(header or "")
    return weights.get("gzip", weights.get("*", 0.0)) > 0.0


def preferred_media_type(header: str | None, offered: Mapping[str, str]) -> str | None:
    """Return the name of the offered media type that an Accept header prefers; None if it accepts none.

    Parameters
    ----------
    header : str or None
        The header; None accepts everything.
    offered : mapping of str to str
        Media types and their names; among equal weights the first wins.
    """
    weights = _quality_values(header or "*/*")

    def weight(media_type: str) -> float:
        candidates = (media_type, f"{media_type.partition('/')[0]}/*", "*/*")
        return next((weights[key] for key in candidates if key in weights), 0.0)

    best = max(offered, key=weight)
    return offered[best] if weight(best) > 0.0 else None


def _quality_values(header: str) -> dict[str, float]:
    """Return the names of an Accept header with their weights; an invalid weight is 0."""
    weights = {}
    for part in header.lower().split(","):
        name, *parameters = part.replace(" ", "").split(";")
        sent = next((text[2:] for text in parameters if text.startswith("q=")), "1")
        weights[name] = min(float(sent), 1.0) if re.fullmatch(r"\d(\.\d*)?", sent) else 0.0
    return weights


def weak_etag(run: RunEntry, *parts: str) -> str:
    """Return a weak ETag that changes with a run's file and with ``parts``."""
    text = "\n".join((run.id, str(run.size), str(run.modified_ns), *parts))
    return f"W/{_quoted_hash(text)}"


def strong_etag(schema: Schema) -> str:
    """Return a strong ETag, a hash of the schema's JSON."""
    return _quoted_hash(schema.model_dump_json())


def _quoted_hash(text: str) -> str:
    return f'"{hashlib.sha256(text.encode()).hexdigest()[:32]}"'


def require_modified(request: Request, headers: Mapping[str, str]) -> None:
    """Raise HTTPException (304) with these headers if If-None-Match names their ETag; weak and strong are equal."""
    sent = {name.strip().removeprefix("W/") for name in request.headers.get("if-none-match", "").split(",")}
    if not sent.isdisjoint({"*", headers["ETag"].removeprefix("W/")}):
        raise HTTPException(304, headers=dict(headers))


def allows_change(sent: str | None, etag: str) -> bool:
    """Return whether an If-Match header allows a change of a resource with this ETag; a missing header does."""
    return sent is None or not {"*", etag}.isdisjoint(name.strip() for name in sent.split(","))


def file_response(
    request: Request, path: Path, media_type: str = OCTET_STREAM, *, etag: str = "", magic: bytes = b""
) -> FileResponse:
    """Return a file response that follows the headers If-None-Match, Range and If-Range.

    A Range header that is malformed, has another unit or names several ranges is ignored, as the RFC allows.

    Parameters
    ----------
    request : Request
        The request.
    path : Path
        The file.
    media_type : str
        Media type of its content.
    etag : str
        Strong ETag; empty derives one from size and modification time.
    magic : bytes
        Required first bytes.

    Raises
    ------
    OSError
        The file cannot be opened.
    DamagedError
        The file does not start with ``magic``.
    ProblemError
        The byte range lies outside the file.
    """
    with path.open("rb") as file:
        status = os.fstat(file.fileno())
        if file.read(len(magic)) != magic:
            raise DamagedError(f"{path.name}: not a recording: it does not start with {magic!r}")
    etag = etag or f'"{status.st_size:x}-{status.st_mtime_ns:x}"'
    headers = {"ETag": etag}
    require_modified(request, headers)
    if request.scope.get("rig.head"):  # `HeadAsGetMiddleware`
        request.scope["method"] = "HEAD"  # the content need not be read
    if not _has_range(request, status.st_size, etag):
        request.scope["headers"] = [header for header in request.scope["headers"] if header[0] != b"range"]
    return FileResponse(path, headers=headers, media_type=media_type, filename=path.name, stat_result=status)


def _has_range(request: Request, size: int, etag: str) -> bool:
    """Return whether a request is for one byte range of a file; ProblemError if that lies outside the file."""
    header = request.headers.get("range", "").replace(" ", "")
    match = SINGLE_RANGE.fullmatch(header)
    if match is None or request.headers.get("if-range", etag) != etag:
        return False
    first, last, suffix = match.groups()
    if first and last and int(last) < int(first):
        return False
    if (int(suffix) == 0 or size == 0) if suffix else int(first) >= size:
        headers = {"Content-Range": f"bytes */{size}"}
        raise ProblemError(ProblemType.RANGE_NOT_SATISFIABLE, f"{header}: the file has {size} bytes", headers=headers)
    return True


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
