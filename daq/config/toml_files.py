"""Read TOML files, turn pydantic's errors into "key = value: expected …", and write TOML."""

import difflib
import json
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import date, datetime, time
from enum import Enum
from pathlib import Path
from types import UnionType
from typing import get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from daq.errors import ConfigError

KeyPath = tuple[int | str, ...]
"""Keys and list indices that lead to a value in nested tables, as `("channel", 2, "range_v")`."""


@dataclass(frozen=True, slots=True)
class Fault:
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
    if isinstance(value, Mapping):
        return "a table"
    text = str(value) if isinstance(value, date | time) else json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 60 else f"{text[:57]}..."


def read_text(path: Path) -> str:
    """Return a TOML file's text.

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
        raise ConfigError(str(path), [f"byte {error.start} is not UTF-8: expected a TOML text file"]) from error
    except OSError as error:
        reason = "is a folder" if path.is_dir() else f"cannot be read ({error.strerror or error})"
        raise ConfigError(str(path), [f"{reason}: expected a TOML file"]) from error


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


def validation_faults(
    error: ValidationError,
    schema: type[BaseModel],
    data: Mapping[str, object],
    renamed: Mapping[KeyPath, str] | None = None,
) -> Iterator[Fault]:
    """Yield the errors that pydantic found in data, one for each key.

    Parameters
    ----------
    error : ValidationError
        What pydantic raised.
    schema : type of BaseModel
        Schema that was validated against.
    data : mapping
        The parsed tables.
    renamed : mapping of KeyPath to str or None
        Present names of former keys.
    """
    seen: set[str] = set()
    for details in error.errors():
        key = dotted(details["loc"])
        if key in seen:
            continue
        seen.add(key)
        if details["type"] == "extra_forbidden" and (present := (renamed or {}).get(details["loc"])):
            yield Fault((key,), f"{key} = {toml_literal(_value_at(details['loc'], data))}: renamed to {present}")
        else:
            yield Fault((key,), _text(details, key, schema, data))


def plain_json(data: Mapping[str, object]) -> str:
    """Return parsed TOML as JSON, for pydantic's strict mode; dates and times become text."""
    return json.dumps(data, default=_time_text)


def _time_text(value: date | time | datetime) -> str:
    return value.isoformat()


def _text(details: ErrorDetails, key: str, schema: type[BaseModel], data: Mapping[str, object]) -> str:
    kind, path = details["type"], details["loc"]
    if kind == "missing":
        return f"{key}: missing, expected {_expected_content(path, schema)}"
    value = toml_literal(_value_at(path, data))
    if kind == "extra_forbidden":
        return f"{key} = {value}: unknown key{_suggestion(path, schema)}"
    if kind == "tuple_type" and _table_of(_annotation(path, schema)) is not None:
        return f"{key} = {value}: expected {_expected_content(path, schema)}"
    field = _field(path, schema)
    if kind == "string_pattern_mismatch" and field is not None:
        return f"{key} = {value}: expected {field.description}"
    return f"{key} = {value}: expected {_expectation(details)}"


def _expectation(details: ErrorDetails) -> str:
    """Return what pydantic expected, for the operator."""
    limits = details.get("ctx", {})
    templates = {
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
    if details["type"] in templates:
        plain = {name: f"{limit:g}" if isinstance(limit, float) else limit for name, limit in limits.items()}
        return templates[details["type"]].format(**plain)
    return details["msg"].removeprefix("Value error, ").removeprefix("expected ")


def _value_at(path: KeyPath, data: object) -> object:
    """Return the value at a path in nested tables; None if there is none."""
    for part in path:
        if isinstance(part, int):
            data = data[part] if isinstance(data, list) and part < len(data) else None
        else:
            data = data.get(part) if isinstance(data, Mapping) else None
    return data


def _section(path: KeyPath, schema: type[BaseModel]) -> type[BaseModel]:
    """Return the schema of the table that contains a path."""
    section = schema
    for part in path[:-1]:
        if isinstance(part, str) and part in section.model_fields:
            inner = _table_of(section.model_fields[part].annotation)
            section = inner or section
    return section


def _field(path: KeyPath, schema: type[BaseModel]) -> FieldInfo | None:
    """Return the schema's field at a path; None if it has no such key."""
    return _section(path, schema).model_fields.get(str(path[-1]))


def _annotation(path: KeyPath, schema: type[BaseModel]) -> object:
    """Return the type that the schema declares at a path; None if it has no such key."""
    field = _field(path, schema)
    return None if field is None else field.annotation


def _table_of(annotation: object) -> type[BaseModel] | None:
    """Return the table schema in an annotation: itself, the item of a tuple, or the first member of a union."""
    if get_origin(annotation) in {tuple, UnionType}:
        return _table_of(get_args(annotation)[0])
    return annotation if isinstance(annotation, type) and issubclass(annotation, BaseModel) else None


def _expected_content(path: KeyPath, schema: type[BaseModel]) -> str:
    """Return a description of what a missing key should hold."""
    annotation = _annotation(path, schema)
    if _table_of(annotation) is not None:
        return f"a table: [{dotted(path)}]" if isinstance(annotation, type) else f"tables: [[{dotted(path)}]]"
    if get_origin(annotation) is dict:
        return f"tables: [{dotted(path)}.NAME]"
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        return " or ".join(f"'{member.value}'" for member in annotation)
    if annotation is str:
        return "a text in quotes"
    return "a list in brackets" if get_origin(annotation) is tuple and isinstance(path[-1], str) else "a number"


def _suggestion(path: KeyPath, schema: type[BaseModel]) -> str:
    """Return a hint at the known key that is most similar to an unknown one."""
    known = list(_section(path, schema).model_fields)
    near = difflib.get_close_matches(str(path[-1]), known, n=1, cutoff=0.5)
    return f", did you mean {near[0]}?" if near else f", expected one of {', '.join(known)}"


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
