"""The operator's page at / and the REST reference at /docs, from templates; nothing is loaded from other hosts.

The reference is our own since FastAPI's load their scripts from another host, which a bench without network lacks and
the content security policy forbids.
"""

from collections.abc import Mapping
from importlib.resources import files
from typing import Any, Final, TypeAlias
from urllib.parse import urlsplit

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from fastapi.templating import Jinja2Templates
from markupsafe import Markup, escape

from daq.service.problems import ProblemType

CONSOLE: Final = str(files("daq.console"))
CONTENT_POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; "
    "frame-src {frame_source}; form-action 'none'; base-uri 'none'; frame-ancestors 'none'"
)

NO_SOURCE: Final = "'none'"

Schema: TypeAlias = Mapping[str, Any]

router = APIRouter(include_in_schema=False)
templates = Jinja2Templates(directory=CONSOLE)


@router.get("/")
def page(request: Request) -> HTMLResponse:
    """Return the operator's page with its viewer."""
    return _html(request, "page.html", {"viewer": request.app.state.viewer_url}, request.app.state.viewer_origin)


@router.get("/docs")
def reference(request: Request) -> HTMLResponse:
    """Return the reference, rendered from the OpenAPI schema on the first request."""
    state = request.app.state
    if state.reference is None:
        schema = request.app.openapi()
        state.reference = _html(request, "reference.html", {**schema, "problem_types": ProblemType, "example": example})
    response: HTMLResponse = state.reference
    return response


def _html(request: Request, template: str, context: dict[str, Any], frame_source: str = NO_SOURCE) -> HTMLResponse:
    headers = {
        "Cache-Control": "no-cache",
        "Origin-Agent-Cluster": "?1",  # a busy viewer in the frame must not hold up the values
        "Content-Security-Policy": CONTENT_POLICY.format(frame_source=frame_source),
    }
    return templates.TemplateResponse(request, template, context, headers=headers)


def origin(url: str) -> str:
    """Return scheme, host and port of a URL; ValueError if it is not http or https."""
    parts = urlsplit(url)
    if parts.scheme not in {"http", "https"} or not parts.hostname or set(url) & set(" ;,'\""):
        raise ValueError(f"viewer_url: {url!r}, expected http://host:port/...")
    return f"{parts.scheme}://{parts.netloc}"


def example(schema: Schema, schemas: Schema) -> object:
    """Return an example of a schema, composed of its fields' examples."""
    if schema.get("examples"):
        return schema["examples"][0]
    if "$ref" in schema:
        return example(schemas[schema["$ref"].rpartition("/")[2]], schemas)
    if "anyOf" in schema:
        return example(schema["anyOf"][0], schemas)
    if "properties" in schema:
        return {name: example(field, schemas) for name, field in schema["properties"].items()}
    if schema.get("type") == "array":
        return [example(schema["items"], schemas)]
    return schema.get("enum", [None])[0]


def markdown(value: str) -> Markup:
    """Return Markdown's code spans and paragraphs as HTML."""
    parts = str(escape(value)).split("`")
    marked = "".join(f"<code>{part}</code>" if k % 2 else part for k, part in enumerate(parts))
    return Markup(marked.replace("\n\n", "<br>"))  # noqa: S704 - escaped above


templates.env.filters["markdown"] = markdown
templates.env.policies["json.dumps_kwargs"] = {"ensure_ascii": False}
