"""A file, or a stretch of it, as an answer: of one and the same file, whatever takes its place meanwhile."""

import os
from pathlib import Path
from typing import BinaryIO

from anyio import to_thread
from fastapi import Request, Response
from fastapi.responses import StreamingResponse

from daq.service.problem_types import Kind
from daq.service.problems import problem_response
from daq.service.ranges import NoSuchRangeError, byte_range, portions
from daq.service.tags import is_known

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
        return problem_response(Kind.RANGE_NOT_SATISFIABLE, str(error), request.url.path, headers=where)
    begin, end = stretch or (0, size)
    headers["Content-Length"] = str(end - begin)
    if stretch is not None:
        headers["Content-Range"] = f"bytes {begin}-{end - 1}/{size}"
    code = 200 if stretch is None else 206
    if request.scope.get("rig.head"):  # nobody sees the content: it need not be read
        return Response(status_code=code, headers=headers, media_type=media_type)
    return StreamingResponse(portions(file, begin, end), code, headers=headers, media_type=media_type)
