"""The page and its files, read once and served from memory; nothing of them comes from elsewhere."""

import html
from collections.abc import Awaitable, Callable
from importlib.resources import files
from typing import Final
from urllib.parse import urlsplit

from fastapi import APIRouter, Response

MEDIA_TYPES: Final = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
}
ASSETS: Final = (
    "page.css",
    "page.js",
    "live.js",
    "live_socket.js",
    "jobs.js",
    "drawings.js",
    "runs.js",
    "imports.js",
    "picture.js",
    "trend.js",
    "figures.js",
    "service_client.js",
    "reference.css",
    "icon.svg",
)
PUBLIC_PATHS: Final = frozenset({"/", "/docs", "/openapi.json", *(f"/{name}" for name in ASSETS)})


class Pages:
    """The page at /, the reference at /docs and their files.

    Parameters
    ----------
    viewer_url : str or None
        Address of the web viewer that the page embeds; None shows none.
    reference : str
        The reference page, HTML.
    """

    def __init__(self, viewer_url: str | None, reference: str) -> None:
        package = files("daq.console")
        page = package.joinpath("page.html").read_text(encoding="utf-8")
        self._frame = "'none'" if viewer_url is None else origin(viewer_url)
        self._page = page.replace("{{viewer}}", html.escape(viewer_url or "", quote=True))
        self._reference = reference
        self._assets = {name: package.joinpath(name).read_text(encoding="utf-8") for name in ASSETS}

    def router(self) -> APIRouter:
        """Return the routes for an application; they are no part of its schema."""
        router = APIRouter(include_in_schema=False)
        pages = {
            "/": self._answer(self._page, "html"),
            "/docs": self._answer(self._reference, "html"),
            **{f"/{name}": self._answer(text, name.rpartition(".")[2]) for name, text in self._assets.items()},
        }
        for path, answer in pages.items():
            router.add_api_route(path, answer)
        return router

    def _answer(self, text: str, kind: str) -> Callable[[], Awaitable[Response]]:
        content = text.encode()
        headers = {"Cache-Control": "no-cache"}
        if kind == "html":
            headers["Origin-Agent-Cluster"] = "?1"  # a busy viewer in the frame must not hold up the values
            headers["Content-Security-Policy"] = (
                "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; "
                f"frame-src {self._frame}; form-action 'none'; base-uri 'none'; frame-ancestors 'none'"
            )

        async def answer() -> Response:
            return Response(content, headers=headers, media_type=MEDIA_TYPES[kind])

        return answer


def origin(url: str) -> str:
    """Return scheme, host and port of an address; ValueError where it is none of the web."""
    parts = urlsplit(url)
    if parts.scheme not in {"http", "https"} or not parts.hostname or set(url) & set(" ;,'\""):
        raise ValueError(f"viewer_url: {url!r}, expected http://host:port/...")
    return f"{parts.scheme}://{parts.netloc}"
