"""LVM, LabVIEW's text format: a file header, then sections, each with a header and rows of numbers."""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from recordings.errors import ForeignFormatError
from recordings.exchange.table import Column, Table, require_ended

END = "***End_of_Header***"
FIRST_LINE = "LabVIEW Measurement"
SEPARATORS = {"Tab": "\t", "Comma": ",", "Semicolon": ";"}


def read(path: Path) -> Table:
    """Return the table of a file; sections of the same channels are concatenated."""
    text = path.read_bytes().decode("utf-8-sig", errors="replace")
    all_lines = text.splitlines()
    lines = iter(all_lines)
    if not next(lines, "").startswith(FIRST_LINE):
        raise ForeignFormatError(f"does not begin with {FIRST_LINE!r}")
    header = _header(lines, None)
    separator = SEPARATORS.get(header.get("Separator", ["Tab"])[0], "\t")
    comma = header.get("Decimal_Separator", ["."])[0] == ","
    per_channel = header.get("X_Columns", ["One"])[0] == "Multi"
    names: list[str] = []
    units: list[str] = []
    steps: list[float] = []
    rows: list[list[float]] = []
    for section_header, titles, section in _sections(lines, separator, comma=comma):
        n_channels = int(_first(section_header.get("Channels"), "0")) or len(titles) - 1
        indices = [2 * k + 1 if per_channel else k + 1 for k in range(n_channels)]
        found = [titles[index] if index < len(titles) else f"{index}" for index in indices]
        if names and found != names:
            raise ForeignFormatError(f"sections of different channels: {names} and {found}")
        _require_complete(section_header.get("Samples", []), len(section))
        names = found
        units = [*section_header.get("Y_Unit_Label", []), *[""] * n_channels][:n_channels]
        steps += [_number(step, comma=comma) for step in section_header.get("Delta_X", [])[:n_channels]]
        rows += [[row[index] if index < len(row) else np.nan for index in indices] for row in section]
    if not rows:
        raise ForeignFormatError("has no rows of numbers")
    if len(set(steps)) > 1:
        raise ForeignFormatError(f"channels of different rates: Delta_X {sorted(set(steps))} s")
    values = np.array(rows)
    if np.isnan(values).any():
        raise ForeignFormatError("channels of different lengths")
    require_ended(path, len(all_lines))
    columns = zip(names, units, values.T, strict=True)
    return Table(
        tuple(Column(name, unit, np.ascontiguousarray(column)) for name, unit, column in columns),
        rate=_rate(steps),
        started_ns=_started_ns(header, comma=comma),
        properties={name: " ".join(words).strip() for name, words in header.items()},
    )


def _rate(steps: list[float]) -> float | None:
    if not steps or not steps[0] > 0:
        return None
    rate = 1 / steps[0]
    return float(round(rate)) if abs(rate - round(rate)) < 1e-5 * rate else rate


def _header(lines: Iterator[str], separator: str | None) -> dict[str, list[str]]:
    """Return the entries of a header."""
    entries: dict[str, list[str]] = {}
    for line in lines:
        if line.strip().startswith(END):
            return entries
        words = [word.strip() for word in (line.split(separator) if separator else _split(line))]
        if words and words[0]:
            entries[words[0]] = words[1:]
    raise ForeignFormatError(f"a header does not end with {END}")


def _split(line: str) -> list[str]:
    """Split a line of the file header, whose separator is unknown: a name, then the rest."""
    for separator in ("\t", ";", ","):
        if separator in line:
            name, _, rest = line.partition(separator)
            return [name, rest.strip() or {"\t": "Tab", ";": "Semicolon", ",": "Comma"}[separator]]
    return [line]


def _sections(
    lines: Iterator[str], separator: str, *, comma: bool
) -> Iterator[tuple[dict[str, list[str]], list[str], list[list[float]]]]:
    """Yield header, column titles and rows of each section."""
    pending = [line for line in lines if line.strip(f"{separator} ")]
    position = 0
    while position < len(pending):
        rest = iter(pending[position:])
        stop = next((k for k in range(position, len(pending)) if pending[k].strip().startswith(END)), None)
        header = {} if stop is None else _header(rest, separator)
        position = position if stop is None else stop + 1
        titles = [title.strip() for title in pending[position].split(separator)] if position < len(pending) else []
        titles = [title for title in titles if title != "Comment"]
        position += 1
        rows = []
        while position < len(pending) and not pending[position].startswith("Channels"):
            words = pending[position].split(separator)[: len(titles)]
            rows.append([_number(word, comma=comma) if word.strip() else np.nan for word in words])
            position += 1
        yield header, titles, rows


def _require_complete(declared: list[str], n_rows: int) -> None:
    """Raise ForeignFormatError if a section has fewer rows than the samples that its header declares."""
    expected = max((int(count) for count in declared if count.isdecimal()), default=0)
    if n_rows < expected:
        raise ForeignFormatError(f"is cut short: a section of {n_rows:,} rows, expected {expected:,}")


def _number(text: str, *, comma: bool) -> float:
    try:
        return float(text.replace(",", ".") if comma else text)
    except ValueError:
        raise ForeignFormatError(f"{text!r}, expected a number") from None


def _started_ns(header: dict[str, list[str]], *, comma: bool) -> int | None:
    """Return date and time of a header, ns since 1970, in this computer's time zone; None if there are none."""
    day, clock = _first(header.get("Date"), ""), _first(header.get("Time"), "")
    if comma:
        clock = clock.replace(",", ".")
    whole, _, fraction = clock.partition(".")
    try:
        started = datetime.strptime(f"{day} {whole}", "%Y/%m/%d %H:%M:%S").astimezone(UTC)  # local time, as in the file
    except ValueError:
        return None
    return round(started.timestamp()) * 1_000_000_000 + int((fraction[:9] or "0").ljust(9, "0"))


def _first(values: list[str] | None, default: str) -> str:
    return values[0] if values else default
