"""LVM, LabVIEW's text format: a heading for the file, one for every stretch of rows, then rows of numbers."""

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
    """Read a file; stretches of rows of the same channels are put one after another."""
    text = path.read_bytes().decode("utf-8-sig", errors="replace")
    all_lines = text.splitlines()
    lines = iter(all_lines)
    if not next(lines, "").startswith(FIRST_LINE):
        raise ForeignFormatError(f"does not begin with {FIRST_LINE!r}")
    about = _heading(lines, None)
    separator = SEPARATORS.get(about.get("Separator", ["Tab"])[0], "\t")
    comma = about.get("Decimal_Separator", ["."])[0] == ","
    per_channel = about.get("X_Columns", ["One"])[0] == "Multi"
    names: list[str] = []
    units: list[str] = []
    steps: list[float] = []
    rows: list[list[float]] = []
    for channel_about, titles, stretch in _stretches(lines, separator, comma=comma):
        n_channels = int(_first(channel_about.get("Channels"), "0")) or len(titles) - 1
        places = [2 * k + 1 if per_channel else k + 1 for k in range(n_channels)]
        found = [titles[place] if place < len(titles) else f"{place}" for place in places]
        if names and found != names:
            raise ForeignFormatError(f"stretches of different channels: {names} and {found}")
        _require_all(channel_about.get("Samples", []), len(stretch))
        names = found
        units = [*channel_about.get("Y_Unit_Label", []), *[""] * n_channels][:n_channels]
        steps += [_number(step, comma=comma) for step in channel_about.get("Delta_X", [])[:n_channels]]
        rows += [[row[place] if place < len(row) else np.nan for place in places] for row in stretch]
    if not rows:
        raise ForeignFormatError("holds no rows of numbers")
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
        started_ns=_moment(about, comma=comma),
        properties={name: " ".join(words).strip() for name, words in about.items()},
    )


def _rate(steps: list[float]) -> float | None:
    if not steps or not steps[0] > 0:
        return None
    rate = 1 / steps[0]
    return float(round(rate)) if abs(rate - round(rate)) < 1e-5 * rate else rate


def _heading(lines: Iterator[str], separator: str | None) -> dict[str, list[str]]:
    """Return the entries of a heading up to its end."""
    entries: dict[str, list[str]] = {}
    for line in lines:
        if line.strip().startswith(END):
            return entries
        words = [word.strip() for word in (line.split(separator) if separator else _split(line))]
        if words and words[0]:
            entries[words[0]] = words[1:]
    raise ForeignFormatError(f"a heading does not end with {END}")


def _split(line: str) -> list[str]:
    """Split a line of the first heading, before the separator is known: a name, then the rest."""
    for separator in ("\t", ";", ","):
        if separator in line:
            name, _, rest = line.partition(separator)
            return [name, rest.strip() or {"\t": "Tab", ";": "Semicolon", ",": "Comma"}[separator]]
    return [line]


def _stretches(
    lines: Iterator[str], separator: str, *, comma: bool
) -> Iterator[tuple[dict[str, list[str]], list[str], list[list[float]]]]:
    """Yield heading, titles and rows of each stretch."""
    pending = [line for line in lines if line.strip(f"{separator} ")]
    place = 0
    while place < len(pending):
        rest = iter(pending[place:])
        stop = next((k for k in range(place, len(pending)) if pending[k].strip().startswith(END)), None)
        about = {} if stop is None else _heading(rest, separator)
        place = place if stop is None else stop + 1
        titles = [title.strip() for title in pending[place].split(separator)] if place < len(pending) else []
        titles = [title for title in titles if title != "Comment"]
        place += 1
        rows = []
        while place < len(pending) and not pending[place].startswith("Channels"):
            words = pending[place].split(separator)[: len(titles)]
            rows.append([_number(word, comma=comma) if word.strip() else np.nan for word in words])
            place += 1
        yield about, titles, rows


def _require_all(told: list[str], n_rows: int) -> None:
    """Raise ForeignFormatError where a stretch has fewer rows than its heading tells of samples."""
    expected = max((int(count) for count in told if count.isdecimal()), default=0)
    if n_rows < expected:
        raise ForeignFormatError(f"a stretch of {n_rows:,} rows, its heading tells of {expected:,}: it is cut short")


def _number(text: str, *, comma: bool) -> float:
    try:
        return float(text.replace(",", ".") if comma else text)
    except ValueError:
        raise ForeignFormatError(f"{text!r}, expected a number") from None


def _moment(about: dict[str, list[str]], *, comma: bool) -> int | None:
    """Return date and time of a heading, ns since 1970, by the clock of this computer; None where there are none."""
    day, clock = _first(about.get("Date"), ""), _first(about.get("Time"), "")
    if comma:
        clock = clock.replace(",", ".")
    whole, _, fraction = clock.partition(".")
    try:
        moment = datetime.strptime(f"{day} {whole}", "%Y/%m/%d %H:%M:%S").astimezone(UTC)  # local, as written
    except ValueError:
        return None
    return round(moment.timestamp()) * 1_000_000_000 + int((fraction[:9] or "0").ljust(9, "0"))


def _first(words: list[str] | None, missing: str) -> str:
    return words[0] if words else missing
