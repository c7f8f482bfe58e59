"""TOML files validated by a pydantic schema: reading, all errors as "key = value: expected …", and writing."""

import difflib
import json
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import date, datetime, time
from enum import Enum
from pathlib import Path
from types import UnionType
from typing import TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from daq.errors import ConfigError

Schema = TypeVar("Schema", bound=BaseModel)
KeyPath = tuple[int | str, ...]
"""Keys and list indices that lead to a value in nested tables, as `("channel", 2, "range_v")`."""

# What pydantic expected, by its type of error; other types carry a message of our validators.
EXPECTATIONS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "string_type": "a text in quotes",
    "finite_number": "a finite number",
    "greater_than": "more than {gt}",
    "greater_than_equal": "at least {ge}",
    "less_than": "less than {lt}",
    "less_than_equal": "at most {le}",
    "multiple_of": "a multiple of {multiple_of}",
    "enum": "{expected}",
    "literal_error": "{expected}",
    "tuple_type": "a list in brackets",
    "too_long": "{max_length} values, there are {actual_length}",
    "too_short": "{min_length} values, there are {actual_length}",
    "model_type": "a table",
    "model_attributes_type": "a table",
}


@dataclass(frozen=True, slots=True)
class ConfigIssue:
    """An error in a configuration file.

    Parameters
    ----------
    keys : tuple of str
        The keys that it depends on, as "channel[2].range_v"; the first is the one to change.
    text : str
        Message to the operator.
    """

    keys: tuple[str, ...]
    text: str


def dotted(path: KeyPath) -> str:
    """Return a key path as text, as "channel[2].range_v"."""
    parts = [f"[{part}]" if isinstance(part, int) else f".{part}" for part in path]
    return "".join(parts).lstrip(".")


def toml_literal(value: object) -> str:
    """Return a value as TOML writes it, shortened to 60 characters."""
    text = "a table" if isinstance(value, Mapping) else json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 60 else f"{text[:57]}..."


def read_text(path: Path, file_format: str = "TOML") -> str:
    """Return the text of a file of a format, as named in messages.

    Raises
    ------
    ConfigError
        The file does not exist, is a folder, cannot be read, or is not UTF-8.
    """
    try:
        return path.read_text(encoding="utf-8-sig")  # Windows editors often write a byte order mark
    except FileNotFoundError as error:
        raise ConfigError(str(path), ["no such file"]) from error
    except UnicodeDecodeError as error:
        raise ConfigError(
            str(path), [f"byte {error.start} is not UTF-8: expected a {file_format} text file"]
        ) from error
    except OSError as error:
        reason = "is a folder" if path.is_dir() else f"cannot be read ({error.strerror or error})"
        raise ConfigError(str(path), [f"{reason}: expected a {file_format} file"]) from error


def read_tables(text: str, file: str) -> dict[str, object]:
    """Return the parsed content of a TOML text.

    Raises
    ------
    ConfigError
        The text is not TOML; names the line.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(file, [f"not TOML: {error}"]) from error
    except RecursionError as error:
        raise ConfigError(file, ["not a rig's TOML: tables or lists are nested too deeply"]) from error


def validate(schema: type[Schema], data: Mapping[str, object]) -> Schema:
    """Return parsed tables as their schema; pydantic's ValidationError if they violate it.

    The tables pass as JSON, for which pydantic's strict mode accepts lists as tuples and texts as enumerations.
    """
    return schema.model_validate_json(json.dumps(data, default=_iso_text), strict=True)


def validated(schema: type[Schema], data: Mapping[str, object], file: str, table: str = "") -> Schema:
    """Return parsed tables as their schema; ConfigError with all errors, whose keys begin with that of a table."""
    try:
        return validate(schema, data)
    except ValidationError as error:
        prefix = f"{table}." if table else ""
        raise ConfigError(file, [f"{prefix}{issue.text}" for issue in validation_issues(error, schema)]) from error


def _iso_text(value: date | time | datetime) -> str:
    return value.isoformat()


def validation_issues(
    error: ValidationError, schema: type[BaseModel], renamed: Mapping[KeyPath, str] | None = None
) -> Iterator[ConfigIssue]:
    """Yield the errors that pydantic found, one for each key.

    Parameters
    ----------
    error : ValidationError
        What pydantic raised.
    schema : type of BaseModel
        Schema that was validated against.
    renamed : mapping of KeyPath to str or None
        Present names of former keys.
    """
    first: dict[KeyPath, ErrorDetails] = {}
    for details in error.errors():
        first.setdefault(details["loc"], details)
    for path, details in first.items():
        key = dotted(path)
        shown = f"{key} = {toml_literal(details['input'])}"
        section = _section(path, schema)
        field = section.model_fields.get(str(path[-1]))
        annotation = None if field is None else field.annotation
        if details["type"] == "missing":
            text = f"{key}: missing, expected {_content(path, annotation)}"
        elif details["type"] == "extra_forbidden":
            present = (renamed or {}).get(path)
            text = f"{shown}: renamed to {present}" if present else f"{shown}: unknown key{_suggestion(path, section)}"
        elif details["type"] == "tuple_type" and _table_of(annotation) is not None:
            text = f"{shown}: expected {_content(path, annotation)}"
        elif details["type"] == "string_pattern_mismatch" and field is not None:
            text = f"{shown}: expected {field.description}"
        else:
            text = f"{shown}: expected {_expectation(details)}"
        yield ConfigIssue((key,), text)


def _expectation(details: ErrorDetails) -> str:
    """Return what pydantic or one of our validators expected, for the operator."""
    if details["type"] not in EXPECTATIONS:
        return details["msg"].removeprefix("Value error, ").removeprefix("expected ")
    limits = details.get("ctx", {})
    shown = {name: f"{limit:g}" if isinstance(limit, float) else limit for name, limit in limits.items()}
    return EXPECTATIONS[details["type"]].format(**shown)


def _section(path: KeyPath, schema: type[BaseModel]) -> type[BaseModel]:
    """Return the schema of the table that contains a path."""
    for part in path[:-1]:
        if part in schema.model_fields:
            schema = _table_of(schema.model_fields[str(part)].annotation) or schema
    return schema


def _table_of(annotation: object) -> type[BaseModel] | None:
    """Return the table schema in an annotation: itself, the item of a tuple, or the first member of a union."""
    if get_origin(annotation) in {tuple, UnionType}:
        return _table_of(get_args(annotation)[0])
    return annotation if isinstance(annotation, type) and issubclass(annotation, BaseModel) else None


def _content(path: KeyPath, annotation: object) -> str:
    """Return a description of what a missing key should hold."""
    if _table_of(annotation) is not None:
        return f"a table: [{dotted(path)}]" if isinstance(annotation, type) else f"tables: [[{dotted(path)}]]"
    if get_origin(annotation) is dict:
        return f"tables: [{dotted(path)}.NAME]"
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        return " or ".join(f"'{member.value}'" for member in annotation)
    if annotation is str:
        return "a text in quotes"
    return "a list in brackets" if get_origin(annotation) is tuple and isinstance(path[-1], str) else "a number"


def _suggestion(path: KeyPath, section: type[BaseModel]) -> str:
    """Return a hint at the known key that is most similar to an unknown one."""
    near = difflib.get_close_matches(str(path[-1]), section.model_fields, n=1, cutoff=0.5)
    return f", did you mean {near[0]}?" if near else f", expected one of {', '.join(section.model_fields)}"


def to_toml(data: Mapping[str, object]) -> str:
    """Return nested mappings, sequences and scalars as TOML.

    Parameters
    ----------
    data : mapping
        With bare keys. A sequence of mappings becomes an array of tables, any other sequence an inline array, with
        its mappings as inline tables.
    """
    import tomlkit  # noqa: PLC0415 - takes 50 ms to import, which commands that write no TOML need not wait for

    return tomlkit.dumps(data)
