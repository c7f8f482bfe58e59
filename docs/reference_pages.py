"""Sphinx extension: the command reference from the parsers, the REST reference from the OpenAPI schema."""

import argparse
import os
from collections.abc import Iterator
from pathlib import Path
from types import BuiltinFunctionType, GenericAlias
from typing import Any
from unittest.mock import MagicMock

from sphinx.application import Sphinx

from daq.cli.commands import COMMANDS, rig_parser
from daq.service.app import OPENAPI_TAGS, create_app

Schema = dict[str, Any]


def command_reference() -> Iterator[str]:
    """Yield the lines of a page with the help of each command and sub-command."""
    yield "# Command reference\n\nThe text of `rig --help` and `rig COMMAND --help`.\n"
    parser = rig_parser()
    parsers: Schema = {"": parser} | _subparsers(parser)
    for name in ["", *COMMANDS]:
        yield f"## {f'rig {name}'.strip()}\n\n```text\n{parsers[name].format_help().rstrip()}\n```\n"
        for inner, nested in _subparsers(parsers[name]).items() if name else ():
            yield f"### rig {name} {inner}\n\n```text\n{nested.format_help().rstrip()}\n```\n"


def _subparsers(parser: Any) -> Schema:
    """Return the parsers of the sub-commands by name."""
    actions = [each for each in parser._actions if isinstance(each, argparse._SubParsersAction)]
    return dict(actions[0].choices) if actions else {}


def rest_reference(schema: Schema) -> Iterator[str]:
    """Yield the lines of a page with the endpoints by tag and the fields of all schemas."""
    yield f"# REST reference\n\n{schema['info']['description']}\n"
    for tag in OPENAPI_TAGS:
        yield f"## {tag['name'].capitalize()}\n\n{tag['description']}.\n"
        for path, methods in schema["paths"].items():
            for method, operation in methods.items():
                if tag["name"] in operation.get("tags", ()):
                    yield from _operation(f"{method.upper()} {path}", operation)
    yield "## Schemas\n"
    for name, content in sorted(schema["components"]["schemas"].items()):
        yield f"({name.lower()})=\n\n### {name}\n\n{content.get('description', '')}\n"
        required = content.get("required", ())
        yield from _table(
            ("field", "type", "description"),
            [
                (f"`{field}`{'' if field in required else ' (optional)'}", _type(each), each.get("description", ""))
                for field, each in content.get("properties", {}).items()
            ],
        )


def _operation(title: str, operation: Schema) -> Iterator[str]:
    yield f"### {title}\n\n**{operation['summary']}.** {operation.get('description', '')}\n"
    yield from _table(
        ("parameter", "in", "type", "description"),
        [
            (f"`{each['name']}`", each["in"], _type(each["schema"]), each.get("description", ""))
            for each in operation.get("parameters", ())
        ],
    )
    body = operation.get("requestBody", {}).get("content", {})
    responses = [("request", kind, _type(each.get("schema", {})), "") for kind, each in body.items()]
    for status, response in operation["responses"].items():
        contents = response.get("content", {}).items() or [("", {})]
        for kind, each in contents:
            responses.append((status, kind, _type(each.get("schema", {})), response["description"]))
    yield from _table(("status", "content", "schema", "meaning"), responses)


def _type(schema: Schema) -> str:
    """Return the type that a schema describes, with a link to a named one."""
    if name := schema.get("$ref", "").rpartition("/")[2]:
        return f"[{name}](#{name.lower()})"
    if several := schema.get("anyOf") or schema.get("oneOf"):
        return " or ".join(dict.fromkeys(_type(each) for each in several if each.get("type") != "null"))
    if values := schema.get("enum") or [each for each in (schema.get("const"),) if each is not None]:
        return " or ".join(f"`{value}`" for value in values)
    if schema.get("type") == "array":
        return f"list of {_type(schema.get('items', {}))}"
    return str(schema.get("format") or schema.get("type", ""))


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> Iterator[str]:
    """Yield a Markdown table; nothing without rows."""
    if rows:
        for row in (head, tuple("---" for _ in head), *rows):
            yield f"| {' | '.join(' '.join(cell.replace('|', '&#124;').split()) for cell in row)} |"
        yield ""


def write_pages(app: Sphinx) -> None:
    """Write both pages below the site's sources."""
    folder = Path(app.srcdir) / "generated"
    folder.mkdir(exist_ok=True)
    os.environ["COLUMNS"] = "92"  # the width of argparse's help
    schema = create_app(MagicMock()).openapi()  # no request is served, so that the state does not matter
    for name, lines in (("commands", command_reference()), ("rest", rest_reference(schema))):
        (folder / f"{name}.md").write_text("\n".join(lines), encoding="utf-8")


def skip_alias(_app: Sphinx, _what: str, _name: str, value: object, *_options: object) -> bool | None:
    """Leave out aliases of generic types and built-in functions, whose signatures autodoc cannot format."""
    return True if isinstance(value, GenericAlias | BuiltinFunctionType) else None


def setup(app: Sphinx) -> None:
    """Connect the generation of the pages."""
    app.connect("autodoc-skip-member", skip_alias)
    app.connect("builder-inited", write_pages, priority=400)  # before autosummary lists the sources
