"""TOML text from plain data: what a run's header carries as the configuration that was in force."""

import json
from collections.abc import Mapping


def to_toml(data: Mapping[str, object]) -> str:
    """Return nested mappings, sequences and scalars as TOML.

    Parameters
    ----------
    data : mapping
        Keys are bare; a sequence of mappings becomes an array of tables, any other sequence an inline
        array, with inline tables where it holds mappings too.
    """
    return "\n".join(_table(data, "")).strip() + "\n"


def _table(data: Mapping[str, object], name: str) -> list[str]:
    lines: list[str] = []
    nested: list[str] = []
    for key, value in data.items():
        inner = f"{name}.{key}" if name else key
        if isinstance(value, Mapping):
            nested += ["", f"[{inner}]", *_table(value, inner)]
        elif tables := _tables(value):
            for table in tables:
                nested += ["", f"[[{inner}]]", *_table(table, inner)]
        else:
            lines.append(f"{key} = {_value(value)}")
    return lines + nested


def _tables(value: object) -> list[Mapping[str, object]]:
    """Return the tables of a sequence; none where it holds anything else."""
    items = value if isinstance(value, list | tuple) else ()
    tables = [item for item in items if isinstance(item, Mapping)]
    return tables if len(tables) == len(items) else []


def _value(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(item) for item in value)}]"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key} = {_value(item)}' for key, item in value.items())}}}"
    if isinstance(value, int):
        return str(int(value))
    if isinstance(value, float):
        return repr(float(value))
    return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "\\u007f")
