"""Text formats: CSV, read and written, and LabVIEW's LVM, read only."""

import csv
import os
import re
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from recordings.errors import ForeignFormatError
from recordings.exchange.table import Column, Table
from recordings.file_operations import Progress

TIME = "time_s"
ROWS_PER_WRITE = 50_000
ROWS_PER_READ = 20_000  # held as Python floats, which take four times the memory of an array
NAME_WITH_UNIT = re.compile(r"(?P<name>.+?)\s*[\[(](?P<unit>[^\])]*)[\])]\s*$")
LVM_FIRST_LINE = "LabVIEW Measurement"
LVM_HEADER_END = "***End_of_Header***"
MAX_LVM_CHANNELS = 10_000
LVM_SEPARATORS = {"Tab": "\t", "Comma": ",", "Semicolon": ";"}


def read_csv(path: Path) -> Table:
    """Return the table of a file separated by commas, semicolons or tabs (the last two allow decimal commas).

    Property lines begin with #; then come a line of column names, and rows of numbers.
    """
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        properties, heading, n_before = _csv_properties(file)
        separator = max("\t;,", key=heading.count)
        names = [name.strip() for name in next(csv.reader([heading], delimiter=separator))]
        rows = csv.reader(file, delimiter=separator)
        numbered = ((n_before + rows.line_num, row) for row in rows if row)
        try:
            batches = list(_csv_batches(numbered, len(names), has_decimal_comma=separator != ","))
        except csv.Error as error:  # a field above the csv module's limit
            raise ForeignFormatError(f"line {n_before + rows.line_num}: {error}") from error
        _require_line_end(path, n_before + rows.line_num)
    if not batches:
        raise ForeignFormatError("has no rows of numbers")
    columns = []
    for name, column in zip(names, np.concatenate(batches).T, strict=True):
        match = NAME_WITH_UNIT.match(name)
        bare_name, unit = (match["name"], match["unit"]) if match else (name, "")
        columns.append(Column(bare_name, unit, np.ascontiguousarray(column)))
    times = next((column.values for column in columns if column.name == TIME), None)
    rate = None if times is None or "rate_hz" in properties else _rate_of(times.astype(np.float64))
    return Table.from_properties(columns, properties, rate)


def write_csv(path: Path, table: Table, on_progress: Progress) -> None:
    """Write a file; numbers have 17 digits, so that reading restores them bit for bit."""
    with path.open("x", encoding="utf-8", newline="\n") as file:
        for name, value in table.all_properties().items():
            file.write(f"# {name}: {' '.join(value.split())}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(f"{column.name} [{column.unit}]" if column.unit else column.name for column in table.columns)
        for first in range(0, table.n_rows, ROWS_PER_WRITE):
            rows = [column.values[first : first + ROWS_PER_WRITE] for column in table.columns]
            if any(row.dtype.kind == "U" for row in rows):
                writer.writerows(zip(*map(_texts, rows), strict=True))
            else:  # four times as fast
                np.savetxt(file, np.column_stack(rows), fmt="%.17g", delimiter=",")
            on_progress(min(1.0, (first + ROWS_PER_WRITE) / table.n_rows))


def _texts(row: NDArray[np.generic]) -> list[str]:
    return [value if isinstance(value, str) else f"{value:.17g}" for value in row.tolist()]


def _csv_properties(file: TextIO) -> tuple[dict[str, str], str, int]:
    """Return the properties in the first lines, the line of column names, and its number."""
    properties = {}
    for number, line in enumerate(file, 1):
        if line.startswith("#"):
            name, _, value = line[1:].partition(":")
            properties[name.strip()] = value.strip()
        elif line.strip():
            return properties, line.rstrip("\r\n"), number
    raise ForeignFormatError("has no line of column names")


def _csv_batches(
    numbered: Iterator[tuple[int, list[str]]], n_columns: int, *, has_decimal_comma: bool
) -> Iterator[NDArray[np.float64]]:
    """Yield the numbers of the rows, `ROWS_PER_READ` rows at a time."""
    batch: list[list[float]] = []
    for line, row in numbered:
        if len(row) != n_columns:
            raise ForeignFormatError(f"line {line}: a row of {len(row)} values, expected {n_columns}: {row[:4]}")
        batch.append([_number(text, has_decimal_comma, f"line {line}: ") for text in row])
        if len(batch) == ROWS_PER_READ:
            yield np.array(batch)
            batch = []
    if batch:
        yield np.array(batch)


def _number(text: str, has_decimal_comma: bool, where: str = "") -> float:  # noqa: FBT001 - positional for speed
    try:
        return float(text.replace(",", ".") if has_decimal_comma else text)
    except ValueError:
        raise ForeignFormatError(f"{where}{text!r}, expected a number") from None


def _rate_of(times: NDArray[np.float64]) -> float:
    """Return the rate, Hz, of evenly spaced times, s.

    Raises
    ------
    ForeignFormatError
        If a time deviates from even spacing by more than a tenth of a step.
    """
    if len(times) < 2 or not np.isfinite(times).all() or not times[-1] > times[0]:
        raise ForeignFormatError(f"times in {TIME!r}: expected at least two, rising")
    step = float(times[-1] - times[0]) / (len(times) - 1)
    if np.abs(times - (times[0] + step * np.arange(len(times)))).max() > 0.1 * step:
        raise ForeignFormatError(f"times in {TIME!r}: not evenly spaced; samples must have been taken at one rate")
    return _rounded(1 / step, 1e-6)


def _rounded(rate: float, tolerance: float) -> float:
    """Return a rate, Hz, or the integer that it differs from by less than a relative tolerance."""
    return float(round(rate)) if abs(rate - round(rate)) < tolerance * rate else rate


def _require_line_end(path: Path, line: int) -> None:
    """Raise ForeignFormatError if the last line, of this number, has no line end: its last number may be truncated."""
    with path.open("rb") as file:
        if file.seek(0, os.SEEK_END) == 0:
            return
        file.seek(-1, os.SEEK_END)
        if file.read() not in b"\r\n":
            raise ForeignFormatError(
                f"line {line}, the last one, has no line end: the file may be truncated inside its last number; "
                "delete the line, or end it if it is complete"
            )


def read_lvm(path: Path) -> Table:
    """Return the table of a file: a file header, then sections, each with a header and rows of numbers.

    Sections of the same channels are concatenated.
    """
    lines = path.read_bytes().decode("utf-8-sig", errors="replace").splitlines()
    if not lines or not lines[0].startswith(LVM_FIRST_LINE):
        raise ForeignFormatError(f"does not begin with {LVM_FIRST_LINE!r}")
    line = next((line for line in lines if line.startswith("Separator")), "Separator\tTab")
    header_separator, name = line[len("Separator") :][:1] or "\t", line[len("Separator") + 1 :].strip()
    header_stop = _lvm_header_stop(lines)
    if header_stop is None:
        raise ForeignFormatError(f"a header does not end with {LVM_HEADER_END}")
    header = _lvm_entries(lines[1:header_stop], header_separator)
    separator = LVM_SEPARATORS.get(name, header_separator)
    has_decimal_comma = _first(header.get("Decimal_Separator"), ".") == ","
    columns_per_channel = 2 if _first(header.get("X_Columns"), "One") == "Multi" else 1  # with or without times
    names: list[str] = []
    units: list[str] = []
    steps: list[float] = []
    rows: list[list[float]] = []
    for entries, titles, section in _lvm_sections(lines[header_stop + 1 :], separator):
        n_channels = _lvm_channels(entries) or len(titles) - 1
        indices = range(1, 1 + columns_per_channel * n_channels, columns_per_channel)
        channel_names = [titles[index] if index < len(titles) else f"{index}" for index in indices]
        if names and channel_names != names:
            raise ForeignFormatError(f"sections of different channels: {names} and {channel_names}")
        expected = max((int(count) for count in entries.get("Samples", []) if count.isdecimal()), default=0)
        if len(section) < expected:
            raise ForeignFormatError(f"is truncated: a section of {len(section):,} rows, expected {expected:,}")
        names = channel_names
        units = [*entries.get("Y_Unit_Label", []), *[""] * n_channels][:n_channels]
        steps += [_number(text, has_decimal_comma) for text in entries.get("Delta_X", [])[:n_channels]]
        for row in section:
            texts = [row[index] if index < len(row) else "" for index in indices]
            rows.append([_number(text, has_decimal_comma) if text else np.nan for text in texts])
    if not rows:
        raise ForeignFormatError("has no rows of numbers")
    if len(set(steps)) > 1:
        raise ForeignFormatError(f"channels of different rates: Delta_X {sorted(set(steps))} s")
    values = np.array(rows)
    if np.isnan(values).any():
        raise ForeignFormatError("channels of different lengths")
    _require_line_end(path, len(lines))
    columns = zip(names, units, values.T, strict=True)
    return Table(
        tuple(Column(name, unit, np.ascontiguousarray(column)) for name, unit, column in columns),
        rate=_rounded(1 / steps[0], 1e-5) if steps and steps[0] > 0 else None,
        started_ns=_lvm_started_ns(header),
        properties={name: " ".join(words).strip() for name, words in header.items()},
    )


def _lvm_channels(entries: dict[str, list[str]]) -> int:
    """Return the number of channels that a section's header states; 0 if it states none."""
    stated = _first(entries.get("Channels"), "0")
    if not (stated.isdecimal() and len(stated) < 10 and int(stated) <= MAX_LVM_CHANNELS):
        raise ForeignFormatError(f"Channels {stated[:40]!r}, expected 0 to {MAX_LVM_CHANNELS}")
    return int(stated)


def _lvm_header_stop(lines: Sequence[str]) -> int | None:
    """Return the index of the line that ends a header; None if there is none."""
    return next((k for k, line in enumerate(lines) if line.strip().startswith(LVM_HEADER_END)), None)


def _lvm_entries(lines: Sequence[str], separator: str) -> dict[str, list[str]]:
    """Return the entries of a header, each with its values."""
    entries = ([word.strip() for word in line.split(separator)] for line in lines)
    return {words[0]: words[1:] for words in entries if words[0]}


def _lvm_sections(
    all_lines: Sequence[str], separator: str
) -> Iterator[tuple[dict[str, list[str]], list[str], list[list[str]]]]:
    """Yield header, column titles and rows of each section; a section's header begins with the line "Channels"."""
    lines = [line for line in all_lines if line.strip(f"{separator} ")]
    starts = [k for k, line in enumerate(lines) if line.startswith("Channels")]
    for start, stop in pairwise(sorted({0, *starts, len(lines)})):
        section = lines[start:stop]
        header_stop = _lvm_header_stop(section)
        entries = {} if header_stop is None else _lvm_entries(section[:header_stop], separator)
        body = section if header_stop is None else section[header_stop + 1 :]
        titles, *rows = ([word.strip() for word in line.split(separator)] for line in body or [""])
        titles = [title for title in titles if title != "Comment"]
        yield entries, titles, [row[: len(titles)] for row in rows]


def _lvm_started_ns(header: dict[str, list[str]]) -> int | None:
    """Return date and time of a header, ns since 1970, in this computer's time zone; None if there are none."""
    whole, _, fraction = _first(header.get("Time"), "").replace(",", ".").partition(".")
    try:
        started = datetime.strptime(f"{_first(header.get('Date'), '')} {whole}", "%Y/%m/%d %H:%M:%S").astimezone(UTC)
        nanoseconds = int((fraction[:9] or "0").ljust(9, "0"))
    except (ValueError, OverflowError):  # no such date, or one before the first that a time zone can have
        return None
    return round(started.timestamp()) * 1_000_000_000 + nanoseconds


def _first(values: list[str] | None, default: str) -> str:
    return values[0] if values else default
