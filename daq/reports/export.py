"""Analyses and samples of a recorded run as JSON, npz, Arrow, SVG, PNG, PDF or a table."""

import gzip
import io
from collections.abc import Mapping
from enum import StrEnum
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from analysis.signals.header import Channel
from analysis.signals.units import MICROMETRE
from daq.reports.analysis_result import AnalysisResult, ProgressCallback, analysis_schema
from daq.reports.errors import ArrowUnavailableError, DataNotFoundError, RequestTooLargeError
from daq.reports.parameters import MAX_TIME, AnalysisFormat, AnalysisQuery, QueryParameters
from daq.reports.plots.panel import PlotStyle
from daq.reports.registry import KINDS
from daq.reports.run_history import file_status
from daq.reports.run_samples import RunSamples
from daq.schemas.results import ChannelSamplesSchema, SamplesSchema
from daq.schemas.units import finite
from recordings.exchange.table import Column, Table
from recordings.mcap.reader import RunReader


class SampleUnit(StrEnum):
    """Unit of the samples."""

    ENGINEERING = "engineering"  # µm towards the probe; V for the tacho
    VOLTS = "volts"
    CODES = "codes"


class SampleFormat(StrEnum):
    """Format of the samples."""

    JSON = "json"
    NPZ = "npz"
    ARROW = "arrow"


class SamplesQuery(QueryParameters):
    """Parameters of the recorded samples."""

    segment: Annotated[int, Field(description="Gap-free segment of the run", ge=0, le=1_000_000, examples=[0])] = 0
    from_s: Annotated[
        float, Field(description="Time in the segment, s; refused past its end", ge=0, le=MAX_TIME, examples=[1.0])
    ] = 0.0
    duration_s: Annotated[
        float,
        Field(
            description="Duration, s; cut at the segment's end. JSON holds 100,000 values, npz and Arrow 6,000,000",
            gt=0, le=60, examples=[0.1],
        ),
    ] = 0.1  # fmt: skip
    unit: Annotated[
        SampleUnit,
        Field(description="engineering: µm, V of the tacho; volts; or codes of the converter", examples=["volts"]),
    ] = SampleUnit.ENGINEERING
    format: Annotated[SampleFormat | None, Field(description="Overrides the Accept header", examples=["json"])] = None


ANALYSIS_CACHE_SIZE = 8
GZIP_LEVEL = 4
MAX_VALUES = {SampleFormat.JSON: 100_000, SampleFormat.NPZ: 6_000_000, SampleFormat.ARROW: 6_000_000}

Codes = NDArray[np.int16]
Columns = Mapping[str, NDArray[Any]]


def analysis_body(path: Path, kind: str, query: AnalysisQuery) -> bytes:
    """Return an analysis in the format and appearance of its query, by default JSON; its numbers are cached."""
    status = file_status(path)
    run, analysis = _cached_analysis(path, status.st_size, status.st_mtime_ns, kind, query.without_appearance())
    return encode_analysis(analysis, run, kind, query.format or AnalysisFormat.JSON, query.plot_style())


def run_analysis(
    path: Path, kind: str, query: AnalysisQuery, on_progress: ProgressCallback
) -> tuple[str, AnalysisResult]:
    """Return the run's id and the result of an analysis."""
    with RunReader(path) as reader:
        return reader.header.run, KINDS[kind].analyse(RunSamples(reader, on_progress), query)


@lru_cache(maxsize=ANALYSIS_CACHE_SIZE)
def _cached_analysis(
    path: Path, _size: int, _modified_ns: int, kind: str, query: AnalysisQuery
) -> tuple[str, AnalysisResult]:
    return run_analysis(path, kind, query, lambda _task, _fraction: None)


def encode_analysis(
    analysis: AnalysisResult, run: str, kind: str, file_format: AnalysisFormat, style: PlotStyle
) -> bytes:
    """Return an analysis encoded in a format; ``style`` is that of a plot.

    Raises
    ------
    ArrowUnavailableError
        pyarrow is not installed.
    """
    match file_format:
        case AnalysisFormat.JSON:
            return analysis_schema(run, kind, analysis).model_dump_json().encode()
        case AnalysisFormat.NPZ:
            return _npz({each.name: each.values for each in analysis.columns}, _metadata(analysis, run))
        case AnalysisFormat.ARROW:
            units = {each.name: each.quantity.unit for each in analysis.columns}
            return _arrow({each.name: each.values for each in analysis.columns}, _metadata(analysis, run), units)
        case AnalysisFormat.SVG | AnalysisFormat.PNG | AnalysisFormat.PDF:
            from daq.reports.plots.render import render  # noqa: PLC0415 - imports matplotlib, which takes a second

            return render(analysis.panels, file_format.value, style)


def analysis_table(analysis: AnalysisResult, run: str) -> Table:
    """Return an analysis as a table for export to a file."""
    columns = tuple(Column(each.name, each.quantity.unit, each.values) for each in analysis.columns)
    return Table(columns, properties=_metadata(analysis, run))


def _metadata(analysis: AnalysisResult, run: str) -> dict[str, str]:
    """Return the run, title, single values and remarks."""
    scalars = {name: f"{value:.9g}" for name, value in analysis.scalars.items()}
    remarks = {"remarks": "; ".join(analysis.remarks)} if analysis.remarks else {}
    return {"run": run, "title": analysis.title, **scalars, **remarks}


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
    if form is SampleFormat.NPZ:
        return _npz({f"channel:{name}": column for name, column in columns.items()}, metadata)
    return _arrow(columns, metadata)


def _scaled(channel: Channel, codes: Codes, unit: SampleUnit) -> tuple[NDArray[np.generic], str]:
    """Return the samples of a channel and their unit."""
    if unit is SampleUnit.CODES:
        return codes, "code"
    if unit is SampleUnit.VOLTS or channel.calibration is None:
        return channel.volts(codes), "V"
    return channel.displacement(codes) / MICROMETRE, "µm"


def _npz(columns: Columns, metadata: Mapping[str, str]) -> bytes:
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **columns, about=np.array(sorted(metadata.items())))
    return file.getvalue()


def _arrow(columns: Columns, metadata: Mapping[str, str], units: Mapping[str, str] | None = None) -> bytes:
    """Return a table as an Arrow stream; ``units`` by column are stored with the columns."""
    try:
        arrow: Any = import_module("pyarrow")  # optional, and without types
        ipc: Any = import_module("pyarrow.ipc")
    except ImportError as error:
        raise ArrowUnavailableError("Arrow needs pyarrow, which is not installed here; npz does not") from error
    rows = [arrow.array(values) for values in columns.values()]
    fields = [
        arrow.field(name, row.type, metadata=None if units is None else {"unit": units[name]})
        for name, row in zip(columns, rows, strict=True)
    ]
    table = arrow.table(rows, schema=arrow.schema(fields, metadata=metadata))
    file = io.BytesIO()
    with ipc.new_stream(file, table.schema) as stream:
        stream.write_table(table)
    return file.getvalue()
