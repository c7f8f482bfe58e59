"""Analyses of a recorded run as JSON, npz, Arrow, SVG, PNG, PDF or a table; cached until the file changes."""

import io
import re
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from daq.reports.analysis_result import AnalysisResult, ProgressCallback, analysis_schema
from daq.reports.errors import ArrowUnavailableError
from daq.reports.parameters import AnalysisFormat, AnalysisQuery
from daq.reports.plots.theme import PlotStyle
from daq.reports.registry import KINDS
from daq.reports.run_history import file_status
from daq.reports.run_samples import RunSamples
from recordings.exchange.table import Column, Table
from recordings.mcap.reader import RunReader

ANALYSIS_CACHE_SIZE = 8
ANALYSIS_PATH = re.compile(r"(analyses/([a-z-]+))\.([a-z]+)")


def analysis_response(path: Path, what: str, query: AnalysisQuery) -> bytes:
    """Return the response body for a path with a suffix, such as "analyses/orbit.svg"."""
    match = ANALYSIS_PATH.fullmatch(what)
    if match is None:
        raise ValueError(f"what: {what!r}, expected an analysis and its format, such as analyses/orbit.svg")
    status = file_status(path)
    run, analysis = _cached_analysis(path, status.st_size, status.st_mtime_ns, match[2], query.without_appearance())
    return encode_analysis(analysis, run, match[2], AnalysisFormat(match[3]), query.plot_style())


def run_analysis(
    path: Path, kind: str, query: AnalysisQuery, on_progress: ProgressCallback
) -> tuple[str, AnalysisResult]:
    """Return the run's id and the result of an analysis."""
    with RunReader(path) as reader:
        return reader.header.run, KINDS[kind].analyse(RunSamples(reader, on_progress), query)


@lru_cache(maxsize=ANALYSIS_CACHE_SIZE)
def _cached_analysis(
    path: Path, _size: int, _changed_ns: int, kind: str, query: AnalysisQuery
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
            return _npz(analysis, run)
        case AnalysisFormat.ARROW:
            return _arrow(analysis, run)
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


def _npz(analysis: AnalysisResult, run: str) -> bytes:
    file = io.BytesIO()
    metadata = np.array(sorted(_metadata(analysis, run).items()))
    np.savez(file, allow_pickle=False, **{each.name: each.values for each in analysis.columns}, about=metadata)
    return file.getvalue()


def _arrow(analysis: AnalysisResult, run: str) -> bytes:
    try:
        arrow: Any = import_module("pyarrow")  # optional, and without types
        ipc: Any = import_module("pyarrow.ipc")
    except ImportError as error:
        raise ArrowUnavailableError("Arrow needs pyarrow, which is not installed here; npz does not") from error
    fields = [
        arrow.field(each.name, arrow.array(each.values.tolist()).type, metadata={"unit": each.quantity.unit})
        for each in analysis.columns
    ]
    rows = [arrow.array(each.values.tolist()) for each in analysis.columns]
    table = arrow.table(rows, schema=arrow.schema(fields, metadata=_metadata(analysis, run)))
    file = io.BytesIO()
    with ipc.new_stream(file, table.schema) as stream:
        stream.write_table(table)
    return file.getvalue()
