"""Samples of a recorded run as JSON, npz or Arrow; runs in a worker process."""

import gzip
import io
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import Channel
from analysis.signals.units import MICROMETRE
from daq.reports.errors import ArrowUnavailableError, DataNotFoundError, RequestTooLargeError
from daq.reports.parameters import SampleFormat, SamplesQuery, SampleUnit
from daq.schemas.results import ChannelSamplesSchema, SamplesSchema
from daq.schemas.units import finite
from recordings.mcap.reader import RunReader

GZIP_LEVEL = 4
MAX_VALUES = {SampleFormat.JSON: 100_000, SampleFormat.NPZ: 6_000_000, SampleFormat.ARROW: 6_000_000}

Codes = NDArray[np.int16]


def encode_samples(path: Path, query: SamplesQuery, form: SampleFormat, compress: bool) -> bytes:  # noqa: FBT001 - sent through a pipe
    """Return consecutive samples; ``compress`` gzips JSON.

    Raises
    ------
    DataNotFoundError
        The segment does not exist or ends earlier.
    RequestTooLargeError
        More values than the format may hold.
    ArrowUnavailableError
        pyarrow is not installed.
    """
    with RunReader(path) as reader:
        header, rate = reader.header, reader.header.acquisition.rate
        lengths = {end.segment: end.samples for end in reader.segment_ends}
        first = round(query.from_s * rate)
        if first >= lengths.get(query.segment, 0):
            there = (
                f"it holds {lengths[query.segment] / rate:g} s"
                if query.segment in lengths
                else "there is no such segment"
            )
            raise DataNotFoundError(f"segment {query.segment} at {query.from_s:g} s: {there}")
        stop = min(first + max(round(query.duration_s * rate), 1), lengths[query.segment])
        values = (stop - first) * len(header.acquisition.channels)
        if values > MAX_VALUES[form]:
            raise RequestTooLargeError(
                f"{values:,} values, expected at most {MAX_VALUES[form]:,} as {form.value}: ask for less than "
                f"{MAX_VALUES[form] / len(header.acquisition.channels) / rate:g} s at a time"
            )
        codes = reader.samples(query.segment, first, stop)
    channels = header.acquisition.channels
    scaled = [_scaled(channel, row, query.unit) for channel, row in zip(channels, codes, strict=True)]
    if form is SampleFormat.JSON:
        schema = SamplesSchema(
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
        body = schema.model_dump_json().encode()
        return gzip.compress(body, GZIP_LEVEL, mtime=0) if compress else body
    columns = {channel.name: row for channel, (row, _) in zip(channels, scaled, strict=True)}
    metadata = {
        "run": header.run,
        "segment": str(query.segment),
        "first_sample": str(first),
        "rate_hz": repr(rate),
        **{f"unit:{channel.name}": unit for channel, (_, unit) in zip(channels, scaled, strict=True)},
    }
    return _npz(columns, metadata) if form is SampleFormat.NPZ else _arrow(columns, metadata)


def _scaled(channel: Channel, codes: Codes, unit: SampleUnit) -> tuple[NDArray[np.generic], str]:
    """Return the samples of a channel and their unit."""
    if unit is SampleUnit.CODES:
        return codes, "code"
    if unit is SampleUnit.VOLTS or channel.calibration is None:
        return channel.volts(codes), "V"
    return channel.displacement(codes) / MICROMETRE, "µm"


def _npz(columns: dict[str, NDArray[np.generic]], metadata: dict[str, str]) -> bytes:
    file = io.BytesIO()
    properties = {"about": np.array(sorted(metadata.items()))}
    np.savez(file, allow_pickle=False, **{f"channel:{name}": column for name, column in columns.items()}, **properties)
    return file.getvalue()


def _arrow(columns: dict[str, NDArray[np.generic]], metadata: dict[str, str]) -> bytes:
    try:
        arrow: Any = import_module("pyarrow")  # optional, and without types
        ipc: Any = import_module("pyarrow.ipc")
    except ImportError as error:
        raise ArrowUnavailableError("Arrow needs pyarrow, which is not installed here; npz does not") from error
    table = arrow.table(columns).replace_schema_metadata(metadata)
    file = io.BytesIO()
    with ipc.new_stream(file, table.schema) as stream:
        stream.write_table(table)
    return file.getvalue()
