"""Content negotiation (RFC 9110, 12.5), ETags, and file responses with byte ranges (RFC 9110, 14)."""

import hashlib
import os
import re
from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

from anyio import to_thread
from fastapi import Request, Response
from fastapi.responses import StreamingResponse

from daq.schemas.units import Schema
from daq.service.problem_types import ProblemType
from daq.service.problems import problem_response
from recordings.catalogue.catalogue import RunEntry
from recordings.errors import DamagedError


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
    if not header:
        return next(iter(offered.values()))
    weights = _quality_values(header)
    ranked = []
    for position, (media_type, name) in enumerate(offered.items()):
        family = media_type.partition("/")[0] + "/*"
        weight = next((weights[key] for key in (media_type, family, "*/*") if key in weights), 0.0)
        ranked.append((-weight, position, name))
    weight, _, name = min(ranked)
    return name if weight < 0.0 else None


def _quality_values(header: str) -> dict[str, float]:
    weights = {}
    for part in header.split(","):
        name, *parameters = (piece.strip().lower() for piece in part.split(";"))
        weight = 1.0
        for parameter in parameters:
            key, _, value = parameter.partition("=")
            if key.strip() == "q":
                try:
                    weight = min(max(float(value), 0.0), 1.0)
                except ValueError:
                    weight = 0.0
        weights[name] = weight
    return weights


NOT_MODIFIED: dict[int | str, dict[str, Any]] = {
    304: {"description": "Not changed since the response whose `ETag` was sent as `If-None-Match`"}
}


def weak_etag(run: RunEntry, *parts: str) -> str:
    """Return a weak ETag that changes with a run's file and with ``parts``."""
    text = "\n".join((run.id, str(run.size), str(run.changed_ns), *parts))
    return f'W/"{hashlib.sha256(text.encode()).hexdigest()[:32]}"'


def matches_etag(sent: str | None, etag: str) -> bool:
    """Return whether an If-None-Match header names an ETag; weak and strong are equal."""
    if sent is None:
        return False
    names = {name.strip().removeprefix("W/") for name in sent.split(",")}
    return "*" in names or etag.removeprefix("W/") in names


def allows_change(sent: str | None, etag: str) -> bool:
    """Return whether an If-Match header allows a change of a resource with this ETag; a missing header does."""
    return sent is None or not {"*", etag}.isdisjoint(name.strip() for name in sent.split(","))


def strong_etag(schema: Schema) -> str:
    """Return a strong ETag, a hash of the schema's JSON."""
    return f'"{hashlib.sha256(schema.model_dump_json().encode()).hexdigest()[:32]}"'


CHUNK_SIZE = 256 * 1024  # bytes
RANGE_HEADER = re.compile(r"bytes=(\d{0,18})-(\d{0,18})")


class UnsatisfiableRangeError(ValueError):
    """The byte range lies outside the file."""


def byte_range(header: str | None, size: int) -> tuple[int, int] | None:
    """Return start and end of the byte range of a Range header; None for the whole file.

    A header that is malformed, has another unit or names several ranges is ignored, as the RFC allows.

    Parameters
    ----------
    header : str or None
        The header.
    size : int
        Size of the file, bytes.

    Raises
    ------
    UnsatisfiableRangeError
        The range lies outside the file.
    """
    match = RANGE_HEADER.fullmatch((header or "").replace(" ", ""))
    if match is None or match.group(0) == "bytes=-":
        return None
    first, last = match.groups()
    if not first:
        start, end = max(size - int(last), 0), size
    else:
        start, end = int(first), min(int(last) + 1, size) if last else size
        if last and int(last) < int(first):
            return None
    if start >= end:
        raise UnsatisfiableRangeError(f"{header}: the file has {size} bytes")
    return start, end


async def file_chunks(file: BinaryIO, start: int, end: int) -> AsyncIterator[bytes]:
    """Yield a byte range of an open file, read in threads, and close the file; ends early if the file does."""
    with file:
        await to_thread.run_sync(file.seek, start)
        while start < end:
            chunk = await to_thread.run_sync(file.read, min(CHUNK_SIZE, end - start))
            if not chunk:
                return
            start += len(chunk)
            yield chunk


OCTET_STREAM = "application/octet-stream"


async def file_response(
    request: Request, path: Path, media_type: str = OCTET_STREAM, *, etag: str | None = None, magic: bytes = b""
) -> Response:
    """Return a file response that follows the headers If-None-Match, Range and If-Range.

    The response stays consistent if another file replaces this one meanwhile.

    Parameters
    ----------
    request : Request
        The request.
    path : Path
        The file.
    media_type : str
        Media type of its content.
    etag : str or None
        Strong ETag; None derives one from size and modification time.
    magic : bytes
        Required first bytes.

    Raises
    ------
    OSError
        The file cannot be opened.
    DamagedError
        The file does not start with ``magic``.
    """
    file = await to_thread.run_sync(_open_checked, path, magic)
    try:
        response = _conditional_response(request, file, path.name, media_type, etag)
    except BaseException:
        file.close()
        raise
    if not isinstance(response, StreamingResponse):
        file.close()
    return response


def _open_checked(path: Path, magic: bytes) -> BinaryIO:
    file = path.open("rb")
    if file.read(len(magic)) != magic:
        file.close()
        raise DamagedError(f"{path.name}: not a recording: it does not start with {magic!r}")
    return file


def _conditional_response(request: Request, file: BinaryIO, name: str, media_type: str, etag: str | None) -> Response:
    status = os.fstat(file.fileno())
    size, etag = status.st_size, etag or f'"{status.st_size:x}-{status.st_mtime_ns:x}"'
    headers = {
        "ETag": etag,
        "Cache-Control": "private, no-cache",
        "Accept-Ranges": "bytes",
        "Content-Disposition": f'attachment; filename="{name}"',
    }
    if matches_etag(request.headers.get("if-none-match"), etag):
        return Response(status_code=304, headers=headers)
    range_header = request.headers.get("range") if request.headers.get("if-range", etag) == etag else None
    try:
        selected = byte_range(range_header, size)
    except UnsatisfiableRangeError as error:
        where = {"Content-Range": f"bytes */{size}"}
        return problem_response(ProblemType.RANGE_NOT_SATISFIABLE, str(error), request.url.path, headers=where)
    start, end = selected or (0, size)
    headers["Content-Length"] = str(end - start)
    if selected is not None:
        headers["Content-Range"] = f"bytes {start}-{end - 1}/{size}"
    code = 200 if selected is None else 206
    if request.scope.get("rig.head"):  # HEAD: the content need not be read
        return Response(status_code=code, headers=headers, media_type=media_type)
    return StreamingResponse(file_chunks(file, start, end), code, headers=headers, media_type=media_type)
