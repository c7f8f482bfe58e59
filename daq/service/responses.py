"""A file, or a stretch of it, as an answer: of one and the same file, whatever takes its place meanwhile.

What a client accepts: codings and media types, with their weights (RFC 9110, 12.5).
Entity tags: a client that holds an answer already is told so instead of being sent it again.
One stretch of a file, as the header Range asks for it (RFC 9110, 14).
"""

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


def accepts_gzip(header: str | None) -> bool:
    """Return whether a header Accept-Encoding allows gzip by name or by a star."""
    weights = _weights(header or "")
    return weights.get("gzip", weights.get("*", 0.0)) > 0.0


def best_type(header: str | None, offered: Mapping[str, str]) -> str | None:
    """Return the name of the media type that a header Accept prefers; the first where all are alike; None: no one.

    Parameters
    ----------
    header : str or None
        The header; None accepts everything.
    offered : mapping of str to str
        Media types to their names, the one to be preferred first.
    """
    if not header:
        return next(iter(offered.values()))
    weights = _weights(header)
    found = []
    for place, (media_type, name) in enumerate(offered.items()):
        family = media_type.partition("/")[0] + "/*"
        weight = next((weights[key] for key in (media_type, family, "*/*") if key in weights), 0.0)
        found.append((-weight, place, name))
    weight, _, name = min(found)
    return name if weight < 0.0 else None


def _weights(header: str) -> dict[str, float]:
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
    304: {"description": "Not changed since the answer whose `ETag` was sent as `If-None-Match`"}
}


def entity_tag(run: RunEntry, *parts: str) -> str:
    """Return a weak tag that changes with a run's file and with ``parts``."""
    text = "\n".join((run.id, str(run.size), str(run.changed_ns), *parts))
    return f'W/"{hashlib.sha256(text.encode()).hexdigest()[:32]}"'


def is_known(sent: str | None, tag: str) -> bool:
    """Return whether the header If-None-Match names a tag; weak and strong count alike."""
    if sent is None:
        return False
    names = {name.strip().removeprefix("W/") for name in sent.split(",")}
    return "*" in names or tag.removeprefix("W/") in names


def is_meant(sent: str | None, tag: str) -> bool:
    """Return whether the header If-Match allows a change of what has a tag; it does where it is not sent."""
    return sent is None or not {"*", tag}.isdisjoint(name.strip() for name in sent.split(","))


def document_tag(document: Schema) -> str:
    """Return the strong tag of a document, which changes with whatever it says."""
    return f'"{hashlib.sha256(document.model_dump_json().encode()).hexdigest()[:32]}"'


PORTION = 256 * 1024  # bytes read and sent at a time
FORM = re.compile(r"bytes=(\d{0,18})-(\d{0,18})")


class NoSuchRangeError(ValueError):
    """The range lies outside the file."""


def byte_range(header: str | None, size: int) -> tuple[int, int] | None:
    """Return begin and end of the stretch that a Range header asks for; None for the whole file.

    A header that is malformed, of another unit or asks for several stretches is passed over, as the RFC allows.

    Parameters
    ----------
    header : str or None
        The header.
    size : int
        Of the file, bytes.

    Raises
    ------
    NoSuchRangeError
        There is no such stretch.
    """
    match = FORM.fullmatch((header or "").replace(" ", ""))
    if match is None or match.group(0) == "bytes=-":
        return None
    first, last = match.groups()
    if not first:
        begin, end = max(size - int(last), 0), size
    else:
        begin, end = int(first), min(int(last) + 1, size) if last else size
        if last and int(last) < int(first):
            return None
    if begin >= end:
        raise NoSuchRangeError(f"{header}: the file has {size} bytes")
    return begin, end


async def portions(file: BinaryIO, begin: int, end: int) -> AsyncIterator[bytes]:
    """Yield a stretch of an open file, read in threads, and close it; it ends early where the file does."""
    with file:
        await to_thread.run_sync(file.seek, begin)
        while begin < end:
            portion = await to_thread.run_sync(file.read, min(PORTION, end - begin))
            if not portion:
                return
            begin += len(portion)
            yield portion


OCTETS = "application/octet-stream"


async def file_answer(
    request: Request, path: Path, media_type: str = OCTETS, *, tag: str | None = None, begins: bytes = b""
) -> Response:
    """Return a file as the headers If-None-Match, Range and If-Range ask for it.

    Parameters
    ----------
    request : Request
        With the headers.
    path : Path
        The file.
    media_type : str
        Of its content.
    tag : str or None
        Its entity tag, a strong one; None makes it of its size and its last change.
    begins : bytes
        What it must begin with.

    Raises
    ------
    OSError
        It cannot be opened.
    ValueError
        It does not begin so.
    """
    file = await to_thread.run_sync(_opened, path, begins)
    try:
        answer = _answer(request, file, path.name, media_type, tag)
    except BaseException:
        file.close()
        raise
    if not isinstance(answer, StreamingResponse):
        file.close()
    return answer


def _opened(path: Path, begins: bytes) -> BinaryIO:
    file = path.open("rb")
    if file.read(len(begins)) != begins:
        file.close()
        raise ValueError(f"{path.name}: no recording")
    return file


def _answer(request: Request, file: BinaryIO, name: str, media_type: str, tag: str | None) -> Response:
    status = os.fstat(file.fileno())
    size, tag = status.st_size, tag or f'"{status.st_size:x}-{status.st_mtime_ns:x}"'
    headers = {
        "ETag": tag,
        "Cache-Control": "private, no-cache",
        "Accept-Ranges": "bytes",
        "Content-Disposition": f'attachment; filename="{name}"',
    }
    if is_known(request.headers.get("if-none-match"), tag):
        return Response(status_code=304, headers=headers)
    wanted = request.headers.get("range") if request.headers.get("if-range", tag) == tag else None
    try:
        stretch = byte_range(wanted, size)
    except NoSuchRangeError as error:
        where = {"Content-Range": f"bytes */{size}"}
        return problem_response(ProblemType.RANGE_NOT_SATISFIABLE, str(error), request.url.path, headers=where)
    begin, end = stretch or (0, size)
    headers["Content-Length"] = str(end - begin)
    if stretch is not None:
        headers["Content-Range"] = f"bytes {begin}-{end - 1}/{size}"
    code = 200 if stretch is None else 206
    if request.scope.get("rig.head"):  # nobody sees the content: it need not be read
        return Response(status_code=code, headers=headers, media_type=media_type)
    return StreamingResponse(portions(file, begin, end), code, headers=headers, media_type=media_type)
