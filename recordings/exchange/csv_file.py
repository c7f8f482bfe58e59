"""CSV: property lines that begin with #, a line of column names, then rows of numbers."""

import csv
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from recordings.errors import ForeignFormatError
from recordings.exchange.table import Column, Table, rate_of, require_ended
from recordings.progress import Progress

TIME = "time_s"
ROWS_PER_WRITE = 50_000
ROWS_PER_READ = 20_000  # held as Python floats, which take four times the memory of an array
NAME_WITH_UNIT = re.compile(r"(?P<name>.+?)\s*[\[(](?P<unit>[^\])]*)[\])]\s*$")


def read(path: Path) -> Table:
    """Return the table of a file separated by commas, semicolons or tabs (the last two allow decimal commas)."""
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        properties, heading, n_before = _properties(file)
        separator = max("\t;,", key=heading.count)
        names = [name.strip() for name in next(csv.reader([heading], delimiter=separator))]
        rows = csv.reader(file, delimiter=separator)
        numbered = ((n_before + rows.line_num, row) for row in rows if row)
        batches = list(_batches(numbered, len(names), comma=separator != ","))
        require_ended(path, n_before + rows.line_num)
    if not batches:
        raise ForeignFormatError("has no rows of numbers")
    values = np.concatenate(batches)
    columns = []
    for name, column in zip(names, values.T, strict=True):
        found = NAME_WITH_UNIT.match(name)
        bare_name, unit = (found["name"], found["unit"]) if found else (name, "")
        columns.append(Column(bare_name, unit, np.ascontiguousarray(column)))
    rate = float(properties["rate_hz"]) if "rate_hz" in properties else None
    for column in columns:
        if rate is None and column.name == TIME:
            rate = rate_of(column.values.astype(np.float64), TIME)
    started_ns = int(properties["started_ns"]) if "started_ns" in properties else None
    return Table(tuple(columns), rate, started_ns, properties)


def write(path: Path, table: Table, on_progress: Progress) -> None:
    """Write a file; numbers have 17 digits, so that reading restores them bit for bit."""
    properties = dict(table.properties)
    if table.rate is not None:
        properties["rate_hz"] = repr(table.rate)
    if table.started_ns is not None:
        properties["started_ns"] = str(table.started_ns)
    with path.open("x", encoding="utf-8", newline="\n") as file:
        for name, value in properties.items():
            file.write(f"# {name}: {' '.join(value.split())}\n")
        file.write(",".join(_quoted(c.name, c.unit) for c in table.columns) + "\n")
        for first in range(0, table.n_rows, ROWS_PER_WRITE):
            rows = [column.values[first : first + ROWS_PER_WRITE] for column in table.columns]
            if any(row.dtype.kind == "U" for row in rows):
                csv.writer(file, lineterminator="\n").writerows(zip(*map(_texts, rows), strict=True))
            else:
                np.savetxt(file, np.column_stack(rows), fmt="%.17g", delimiter=",")
            on_progress(min(1.0, (first + ROWS_PER_WRITE) / table.n_rows))


def _texts(row: NDArray[np.generic]) -> list[str]:
    return [value if isinstance(value, str) else f"{value:.17g}" for value in row.tolist()]


def _quoted(name: str, unit: str) -> str:
    text = f"{name} [{unit}]" if unit else name
    return f'"{text}"' if "," in text else text


def _properties(file: TextIO) -> tuple[dict[str, str], str, int]:
    """Return the properties in the first lines, the line of column names, and its number."""
    properties = {}
    for number, line in enumerate(file, 1):
        if line.startswith("#"):
            name, _, value = line[1:].partition(":")
            properties[name.strip()] = value.strip()
        elif line.strip():
            return properties, line.rstrip("\r\n"), number
    raise ForeignFormatError("has no line of column names")


def _batches(
    numbered: Iterator[tuple[int, list[str]]], n_columns: int, *, comma: bool
) -> Iterator[NDArray[np.float64]]:
    """Yield the numbers of the rows, `ROWS_PER_READ` rows at a time."""
    batch: list[list[float]] = []
    for line, row in numbered:
        if len(row) != n_columns:
            raise ForeignFormatError(f"line {line}: a row of {len(row)} values, expected {n_columns}: {row[:4]}")
        batch.append([_number(text, line, comma=comma) for text in row])
        if len(batch) == ROWS_PER_READ:
            yield np.array(batch)
            batch = []
    if batch:
        yield np.array(batch)


def _number(text: str, line: int, *, comma: bool) -> float:
    try:
        return float(text.replace(",", ".") if comma else text)
    except ValueError:
        raise ForeignFormatError(f"line {line}: {text!r}, expected a number") from None
