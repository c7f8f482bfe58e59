"""CSV: a line of names, then rows of numbers; lines that begin with # in front of them tell more."""

import csv
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

import numpy as np

from recordings.errors import ForeignFormatError
from recordings.formats.table import Column, Table, rate_of

TIME = "time_s"
NAME_WITH_UNIT = re.compile(r"(?P<name>.+?)\s*[\[(](?P<unit>[^\])]*)[\])]\s*$")


def read(path: Path) -> Table:
    """Read a file separated by comma, or by semicolon or tab: then decimals may have a comma."""
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        properties, heading = _properties(file)
        separator = max("\t;,", key=heading.count)
        names = [name.strip() for name in next(csv.reader([heading], delimiter=separator))]
        comma = separator != ","
        values = np.array([_row(row, len(names), comma=comma) for row in csv.reader(file, delimiter=separator) if row])
    if values.size == 0:
        raise ForeignFormatError("holds no rows of numbers")
    columns = []
    for name, column in zip(names, values.T, strict=True):
        found = NAME_WITH_UNIT.match(name)
        plain, unit = (found["name"], found["unit"]) if found else (name, "")
        columns.append(Column(plain, unit, np.ascontiguousarray(column)))
    rate = float(properties["rate_hz"]) if "rate_hz" in properties else None
    for column in columns:
        if rate is None and column.name == TIME:
            rate = rate_of(column.values.astype(np.float64), TIME)
    started_ns = int(properties["started_ns"]) if "started_ns" in properties else None
    return Table(tuple(columns), rate, started_ns, properties)


def write(path: Path, table: Table) -> None:
    """Write a file: numbers come back bit for bit."""
    properties = dict(table.properties)
    if table.rate is not None:
        properties["rate_hz"] = repr(table.rate)
    if table.started_ns is not None:
        properties["started_ns"] = str(table.started_ns)
    with path.open("x", encoding="utf-8", newline="\n") as file:
        for name, value in properties.items():
            file.write(f"# {name}: {' '.join(value.split())}\n")
        file.write(",".join(_quoted(c.name, c.unit) for c in table.columns) + "\n")
        np.savetxt(file, np.column_stack([column.values for column in table.columns]), fmt="%.17g", delimiter=",")


def _quoted(name: str, unit: str) -> str:
    text = f"{name} [{unit}]" if unit else name
    return f'"{text}"' if "," in text else text


def _properties(file: TextIO) -> tuple[dict[str, str], str]:
    """Return what the lines in front tell, and the line of names."""
    properties = {}
    for line in file:
        if line.startswith("#"):
            name, _, value = line[1:].partition(":")
            properties[name.strip()] = value.strip()
        elif line.strip():
            return properties, line.rstrip("\r\n")
    raise ForeignFormatError("holds no line of names")


def _row(row: list[str], n_columns: int, *, comma: bool) -> list[float]:
    if len(row) != n_columns:
        raise ForeignFormatError(f"a row of {len(row)} values, expected {n_columns}: {row[:4]}")
    return list(_numbers(row, comma=comma))


def _numbers(row: list[str], *, comma: bool) -> Iterator[float]:
    for text in row:
        try:
            yield float(text.replace(",", ".") if comma else text)
        except ValueError:
            raise ForeignFormatError(f"{text!r}, expected a number") from None
