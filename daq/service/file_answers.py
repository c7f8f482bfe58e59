"""A file, or a stretch of it, as an answer."""

from pathlib import Path

from fastapi import Request, Response
from fastapi.responses import StreamingResponse

from daq.service.kinds import Kind
from daq.service.problems import problem_response
from daq.service.ranges import NoSuchRangeError, byte_range, portions
from daq.service.tags import is_known

OCTETS = "application/octet-stream"


def file_answer(request: Request, path: Path, size: int, tag: str, media_type: str = OCTETS) -> Response:
    """Return a file as the headers If-None-Match, Range and If-Range ask for it.

    Parameters
    ----------
    request : Request
        With the headers.
    path : Path
        The file.
    size : int
        Its size, bytes.
    tag : str
        Its entity tag, a strong one.
    media_type : str
        Of its content.
    """
    headers = {
        "ETag": tag,
        "Cache-Control": "private, no-cache",
        "Accept-Ranges": "bytes",
        "Content-Disposition": f'attachment; filename="{path.name}"',
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
    return StreamingResponse(
        portions(path, begin, end), 200 if stretch is None else 206, headers=headers, media_type=media_type
    )
