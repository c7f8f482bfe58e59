"""Samples of a stretch of a run as JSON, npz or Arrow, made by a reading process."""

import gzip
import io
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import Channel
from daq.reports.errors import ArrowUnavailableError, DataNotFoundError, RequestTooLargeError
from daq.reports.parameters import SampleFormat, SamplesQuery, SampleUnit
from daq.schemas.results import ChannelSamplesSchema, SamplesSchema
from daq.schemas.units import finite
from recordings.mcap.reader import RunReader

LEVEL = 4
MOST_VALUES = {SampleFormat.JSON: 100_000, SampleFormat.NPZ: 6_000_000, SampleFormat.ARROW: 6_000_000}

Codes = NDArray[np.int16]


def encode_samples(path: Path, query: SamplesQuery, form: SampleFormat, packed: bool) -> bytes:  # noqa: FBT001 - sent through a pipe
    """Return a stretch of samples; JSON is gzipped where that is wanted.

    Raises
    ------
    DataNotFoundError
        The segment does not exist or does not reach so far.
    RequestTooLargeError
        The answer would be too large.
    ArrowUnavailableError
        Arrow is wanted and cannot be made.
    """
    with RunReader(path) as reader:
        header, rate = reader.header, reader.header.acquisition.rate
        held = {end.segment: end.samples for end in reader.segment_ends}
        first = round(query.from_s * rate)
        if first >= held.get(query.segment, 0):
            there = (
                f"it holds {held[query.segment] / rate:g} s" if query.segment in held else "there is no such segment"
            )
            raise DataNotFoundError(f"segment {query.segment} at {query.from_s:g} s: {there}")
        stop = min(first + max(round(query.duration_s * rate), 1), held[query.segment])
        values = (stop - first) * len(header.acquisition.channels)
        if values > MOST_VALUES[form]:
            raise RequestTooLargeError(
                f"{values:,} values, expected at most {MOST_VALUES[form]:,} as {form.value}: ask for less than "
                f"{MOST_VALUES[form] / len(header.acquisition.channels) / rate:g} s at a time"
            )
        codes = reader.samples(query.segment, first, stop)
    channels = header.acquisition.channels
    scaled = [_scaled(channel, row, query.unit) for channel, row in zip(channels, codes, strict=True)]
    if form is SampleFormat.JSON:
        document = SamplesSchema(
            run=header.run,
            segment=query.segment,
            first_sample=first,
            samples=stop - first,
            rate_hz=rate,
            channels=tuple(
                ChannelSamplesSchema(name=channel.name, unit=unit, values=tuple(map(finite, row.tolist())))
                for channel, (row, unit) in zip(channels, scaled, strict=True)
            ),
        )
        body = document.model_dump_json().encode()
        return gzip.compress(body, LEVEL, mtime=0) if packed else body
    columns = {channel.name: row for channel, (row, _) in zip(channels, scaled, strict=True)}
    about = {
        "run": header.run,
        "segment": str(query.segment),
        "first_sample": str(first),
        "rate_hz": repr(rate),
        **{f"unit:{channel.name}": unit for channel, (_, unit) in zip(channels, scaled, strict=True)},
    }
    return _npz(columns, about) if form is SampleFormat.NPZ else _arrow(columns, about)


def _scaled(channel: Channel, codes: Codes, unit: SampleUnit) -> tuple[NDArray[np.generic], str]:
    """Return a channel's samples and the unit that they have."""
    if unit is SampleUnit.CODES:
        return codes, "code"
    if unit is SampleUnit.VOLTS or channel.calibration is None:
        return channel.volts(codes), "V"
    return channel.displacement(codes) * 1e6, "µm"


def _npz(columns: dict[str, NDArray[np.generic]], about: dict[str, str]) -> bytes:
    file = io.BytesIO()
    properties = {"about": np.array(sorted(about.items()))}
    np.savez(file, allow_pickle=False, **{f"channel:{name}": column for name, column in columns.items()}, **properties)
    return file.getvalue()


def _arrow(columns: dict[str, NDArray[np.generic]], about: dict[str, str]) -> bytes:
    try:
        arrow: Any = import_module("pyarrow")  # optional, and without types
        ipc: Any = import_module("pyarrow.ipc")
    except ImportError as error:
        raise ArrowUnavailableError("Arrow needs pyarrow, which is not installed here; npz does not") from error
    table = arrow.table(columns).replace_schema_metadata(about)
    file = io.BytesIO()
    with ipc.new_stream(file, table.schema) as stream:
        stream.write_table(table)
    return file.getvalue()
