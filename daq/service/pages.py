"""The operator's page with its static files, and the REST reference as HTML from the OpenAPI schema.

All is served from memory, and nothing is loaded from other hosts.
"""

import html
import json
from collections.abc import Awaitable, Callable, Iterator, Mapping
from importlib.resources import files
from typing import Any, Final, TypeAlias
from urllib.parse import urlsplit

from fastapi import APIRouter, Response

from daq.service.problem_types import ProblemType

MEDIA_TYPES: Final = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
}
ASSETS: Final = (
    "page.css",
    "page.js",
    "live_values.js",
    "live_curves.js",
    "trend.js",
    "run_list.js",
    "plots.js",
    "import_form.js",
    "format.js",
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
        URL of the web viewer that the page embeds; None for none.
    reference : str
        The reference page, HTML.
    """

    def __init__(self, viewer_url: str | None, reference: str) -> None:
        package = files("daq.console")
        page = package.joinpath("page.html").read_text(encoding="utf-8")
        self._frame_source = "'none'" if viewer_url is None else origin(viewer_url)
        self._page = page.replace("{{viewer}}", html.escape(viewer_url or "", quote=True))
        self._reference = reference
        self._assets = {name: package.joinpath(name).read_text(encoding="utf-8") for name in ASSETS}

    def router(self) -> APIRouter:
        """Return the routes of the static files; the OpenAPI schema leaves them out."""
        router = APIRouter(include_in_schema=False)
        pages = {
            "/": self._static_handler(self._page, "html"),
            "/docs": self._static_handler(self._reference, "html"),
            **{f"/{name}": self._static_handler(text, name.rpartition(".")[2]) for name, text in self._assets.items()},
        }
        for path, handle in pages.items():
            router.add_api_route(path, handle)
        return router

    def _static_handler(self, text: str, suffix: str) -> Callable[[], Awaitable[Response]]:
        content = text.encode()
        headers = {"Cache-Control": "no-cache"}
        if suffix == "html":
            headers["Origin-Agent-Cluster"] = "?1"  # a busy viewer in the frame must not hold up the values
            headers["Content-Security-Policy"] = (
                "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; "
                f"frame-src {self._frame_source}; form-action 'none'; base-uri 'none'; frame-ancestors 'none'"
            )

        async def handle() -> Response:
            return Response(content, headers=headers, media_type=MEDIA_TYPES[suffix])

        return handle


def origin(url: str) -> str:
    """Return scheme, host and port of a URL; ValueError if it is not http or https."""
    parts = urlsplit(url)
    if parts.scheme not in {"http", "https"} or not parts.hostname or set(url) & set(" ;,'\""):
        raise ValueError(f"viewer_url: {url!r}, expected http://host:port/...")
    return f"{parts.scheme}://{parts.netloc}"


Schema: TypeAlias = Mapping[str, Any]


def reference_page(openapi: Schema) -> str:
    """Return the reference, HTML.

    Parameters
    ----------
    openapi : mapping
        The application's OpenAPI schema.
    """
    schemas: Schema = openapi["components"]["schemas"]
    operations = [
        _operation(method, path, operation, schemas)
        for path, methods in openapi["paths"].items()
        for method, operation in methods.items()
    ]
    info = openapi["info"]
    body = [
        f"<h1>{_text(info['title'])} <small>{_text(info['version'])}</small></h1>",
        f"<p>{_text(info['description'])}</p>",
        '<p><a href="/">The page</a> · <a href="/openapi.json">OpenAPI schema</a></p>',
        *operations,
        "<h2>Problems</h2>",
        "<p>Errors are <code>application/problem+json</code> (RFC 9457); <code>type</code> names the problem type.</p>",
        _problems(),
        "<h2>Schemas</h2>",
        "<p>Every field is always present; unknown values are null.</p>",
        *(_schema_section(name, schema) for name, schema in sorted(schemas.items())),
    ]
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="color-scheme" content="dark">'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><title>REST reference</title>'
        '<link rel="icon" href="/icon.svg" type="image/svg+xml"><link rel="stylesheet" href="/reference.css"></head>'
        f"<body><main>{''.join(body)}</main></body></html>"
    )


def example(schema: Schema, schemas: Schema) -> object:
    """Return an example of a schema, composed of its fields' examples."""
    if schema.get("examples"):
        return schema["examples"][0]
    if "$ref" in schema:
        return example(schemas[_name(schema["$ref"])], schemas)
    if "anyOf" in schema:
        return example(schema["anyOf"][0], schemas)
    if "properties" in schema:
        return {name: example(field, schemas) for name, field in schema["properties"].items()}
    if schema.get("type") == "array":
        return [example(schema["items"], schemas)]
    return schema.get("enum", [None])[0]


def _operation(method: str, path: str, operation: Schema, schemas: Schema) -> str:
    parts = [
        f'<section id="{_text(operation["operationId"])}"><h2><code>{method.upper()} {_text(path)}</code></h2>',
        f"<p><strong>{_text(operation['summary'])}.</strong> {_markdown(operation['description'])}</p>",
    ]
    if operation.get("parameters"):
        rows = (
            f"<tr><td><code>{_text(parameter['name'])}</code></td><td>{parameter['in']}</td>"
            f"<td>{_type_text(parameter['schema'])}</td><td>{_markdown(parameter.get('description', ''))}</td></tr>"
            for parameter in operation["parameters"]
        )
        parts.append(_table("Parameter", "In", "Type", "Meaning", rows=rows))
    parts.append(_table("Status", "Response", "Type", rows=_response_rows(operation["responses"])))
    for status, response in operation["responses"].items():
        json_content = response.get("content", {}).get("application/json")
        if status.startswith("2") and json_content is not None:
            example_json = json.dumps(example(json_content["schema"], schemas), indent=2, ensure_ascii=False)
            parts.append(f"<details><summary>Example</summary><pre>{_text(example_json)}</pre></details>")
    return "".join((*parts, "</section>"))


def _response_rows(responses: Schema) -> Iterator[str]:
    for status, response in sorted(responses.items()):
        for media_type, content in response.get("content", {"–": {"schema": {"type": "no content"}}}).items():
            yield (
                f"<tr><td>{status}</td><td>{_markdown(response['description'])}</td>"
                f"<td>{_type_text(content['schema'])} <small>{_text(media_type)}</small></td></tr>"
            )


def _problems() -> str:
    rows = (
        f'<tr id="{problem_type.slug}"><td><code>{problem_type.slug}</code></td><td>{problem_type.status}</td>'
        f"<td>{_text(problem_type.title)}. {_markdown(problem_type.explanation)}</td></tr>"
        for problem_type in ProblemType
    )
    return _table("Name", "Status", "Meaning", rows=rows)


def _schema_section(name: str, schema: Schema) -> str:
    meaning = _markdown(schema.get("description", ""))
    if "properties" not in schema:
        return (
            f'<section id="{_text(name)}"><h3>{_text(name)}</h3><p>{meaning}</p><p>{_type_text(schema)}</p></section>'
        )
    rows = (
        f"<tr><td><code>{_text(field)}</code></td><td>{_type_text(content)}</td>"
        f"<td>{_markdown(content.get('description', ''))}</td></tr>"
        for field, content in schema["properties"].items()
    )
    table = _table("Field", "Type", "Meaning", rows=rows)
    return f'<section id="{_text(name)}"><h3>{_text(name)}</h3><p>{meaning}</p>{table}</section>'


def _type_text(schema: Schema) -> str:
    if "$ref" in schema:
        name = _text(_name(schema["$ref"]))
        return f'<a href="#{name}">{name}</a>'
    if "anyOf" in schema:
        return " or ".join(_type_text(option) for option in schema["anyOf"])
    if "enum" in schema:
        return " or ".join(f"<code>{_text(value)}</code>" for value in schema["enum"])
    if schema.get("type") == "array":
        return f"list of {_type_text(schema['items'])}"
    return _text(schema.get("format", schema.get("type", "any")))


def _table(*heads: str, rows: Iterator[str]) -> str:
    head = "".join(f'<th scope="col">{name}</th>' for name in heads)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _name(reference: str) -> str:
    return reference.rpartition("/")[2]


def _text(value: object) -> str:
    return html.escape(str(value), quote=True)


def _markdown(value: str) -> str:
    """Return Markdown's code spans and paragraphs as HTML."""
    parts = _text(value).split("`")
    marked = "".join(f"<code>{part}</code>" if k % 2 else part for k, part in enumerate(parts))
    return marked.replace("\n\n", "<br>")
