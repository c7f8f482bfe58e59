"""An analysis in the forms in which it is sent or written: JSON, npz, Arrow, SVG, PNG, a table for a file.

Analyses as they are asked for over REST: made once as long as the file does not change.
"""

import io
import re
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from daq.reports.analysis_result import AnalysisResult, ProgressCallback
from daq.reports.analysis_schema import analysis_schema
from daq.reports.errors import ArrowUnavailableError
from daq.reports.parameters import AnalysisForm, AnalysisQuery
from daq.reports.plots.png import render_png
from daq.reports.plots.svg import render_svg
from daq.reports.registry import KINDS
from daq.reports.run_history import file_status
from daq.reports.run_samples import RunSamples
from recordings.exchange.table import Column, Table
from recordings.mcap.reader import RunReader

ANALYSIS_CACHE_SIZE = 8
ANALYSIS_PATH = re.compile(r"(analyses/([a-z-]+))\.([a-z]+)")


def analysis_response(path: Path, what: str, query: AnalysisQuery) -> bytes:
    """Return the answer of an address with its form, as "analyses/orbit.svg"."""
    asked = ANALYSIS_PATH.fullmatch(what)
    if asked is None:
        raise ValueError(f"what: {what!r}, expected an analysis and its form, as analyses/orbit.svg")
    status = file_status(path)
    alike = query.model_copy(update={"format": None})
    run, analysis = _made(path, status.st_size, status.st_mtime_ns, asked[2], alike)
    return encode_analysis(analysis, run, asked[2], AnalysisForm(asked[3]))


def run_analysis(path: Path, kind: str, query: AnalysisQuery, tell: ProgressCallback) -> tuple[str, AnalysisResult]:
    """Return a run's id and an analysis of it."""
    with RunReader(path) as reader:
        return reader.header.run, KINDS[kind].analyse(RunSamples(reader, tell), query)


@lru_cache(maxsize=ANALYSIS_CACHE_SIZE)
def _made(path: Path, _size: int, _changed_ns: int, kind: str, query: AnalysisQuery) -> tuple[str, AnalysisResult]:
    return run_analysis(path, kind, query, lambda _doing, _part: None)


def encode_analysis(analysis: AnalysisResult, run: str, kind: str, form: AnalysisForm) -> bytes:
    """Return an analysis as a file of this form.

    Raises
    ------
    PngUnavailableError, ArrowUnavailableError
        The package that writes the form is not installed.
    """
    match form:
        case AnalysisForm.JSON:
            return analysis_schema(run, kind, analysis).model_dump_json().encode()
        case AnalysisForm.NPZ:
            return _npz(analysis, run)
        case AnalysisForm.ARROW:
            return _arrow(analysis, run)
        case AnalysisForm.SVG:
            return render_svg(analysis.panels).encode()
        case AnalysisForm.PNG:
            return render_png(analysis.panels)


def analysis_table(analysis: AnalysisResult, run: str) -> Table:
    """Return an analysis as a table for a file."""
    columns = tuple(Column(each.name, each.quantity.unit, each.values) for each in analysis.columns)
    return Table(columns, properties=_about(analysis, run))


def _about(analysis: AnalysisResult, run: str) -> dict[str, str]:
    """Return what there is to say beside the columns."""
    figures = {name: f"{value:.9g}" for name, value in analysis.figures.items()}
    remarks = {"remarks": "; ".join(analysis.remarks)} if analysis.remarks else {}
    return {"run": run, "title": analysis.title, **figures, **remarks}


def _npz(analysis: AnalysisResult, run: str) -> bytes:
    file = io.BytesIO()
    about = np.array(sorted(_about(analysis, run).items()))
    np.savez(file, allow_pickle=False, **{each.name: each.values for each in analysis.columns}, about=about)
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
    made = arrow.table(rows, schema=arrow.schema(fields, metadata=_about(analysis, run)))
    file = io.BytesIO()
    with ipc.new_stream(file, made.schema) as stream:
        stream.write_table(made)
    return file.getvalue()
