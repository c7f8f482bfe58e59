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

from daq.reports.analysis import Analysis, Tell
from daq.reports.analysis_schema import analysis_schema
from daq.reports.parameters import AnalysisForm, Asked
from daq.reports.plots.png import picture
from daq.reports.plots.svg import drawing
from daq.reports.records import status_of
from daq.reports.registry import KINDS
from daq.reports.run_samples import RunSamples
from daq.reports.samples import NoArrowError
from recordings.exchange.table import Column, Table
from recordings.mcap.reader import RunReader

MADE_KEPT = 8
ADDRESS = re.compile(r"(analyses/([a-z-]+))\.([a-z]+)")


def analysis_answer(path: Path, what: str, query: Asked) -> bytes:
    """Return the answer of an address with its form, as "analyses/orbit.svg"."""
    asked = ADDRESS.fullmatch(what)
    if asked is None:
        raise ValueError(f"what: {what!r}, expected an analysis and its form, as analyses/orbit.svg")
    status = status_of(path)
    alike = query.model_copy(update={"format": None})
    run, analysis = _made(path, status.st_size, status.st_mtime_ns, asked[2], alike)
    return content(analysis, run, asked[2], AnalysisForm(asked[3]))


def analysis_made(path: Path, kind: str, query: Asked, tell: Tell) -> tuple[str, Analysis]:
    """Return a run's id and an analysis of it."""
    with RunReader(path) as reader:
        return reader.header.run, KINDS[kind].make(RunSamples(reader, tell), query)


@lru_cache(maxsize=MADE_KEPT)
def _made(path: Path, _size: int, _changed_ns: int, kind: str, query: Asked) -> tuple[str, Analysis]:
    return analysis_made(path, kind, query, lambda _doing, _part: None)


def content(analysis: Analysis, run: str, kind: str, form: AnalysisForm) -> bytes:
    """Return an analysis in a form; NoPngError or NoArrowError where a package for it is not installed here."""
    match form:
        case AnalysisForm.JSON:
            return analysis_schema(run, kind, analysis).model_dump_json().encode()
        case AnalysisForm.NPZ:
            return _npz(analysis, run)
        case AnalysisForm.ARROW:
            return _arrow(analysis, run)
        case AnalysisForm.SVG:
            return drawing(analysis.panels).encode()
        case AnalysisForm.PNG:
            return picture(analysis.panels)


def table(analysis: Analysis, run: str) -> Table:
    """Return an analysis as a table for a file."""
    columns = tuple(Column(each.name, each.quantity.unit, each.values) for each in analysis.columns)
    return Table(columns, properties=_about(analysis, run))


def _about(analysis: Analysis, run: str) -> dict[str, str]:
    """Return what there is to say beside the columns."""
    figures = {name: f"{value:.9g}" for name, value in analysis.figures.items()}
    remarks = {"remarks": "; ".join(analysis.remarks)} if analysis.remarks else {}
    return {"run": run, "title": analysis.title, **figures, **remarks}


def _npz(analysis: Analysis, run: str) -> bytes:
    file = io.BytesIO()
    about = np.array(sorted(_about(analysis, run).items()))
    np.savez(file, allow_pickle=False, **{each.name: each.values for each in analysis.columns}, about=about)
    return file.getvalue()


def _arrow(analysis: Analysis, run: str) -> bytes:
    try:
        arrow: Any = import_module("pyarrow")  # optional, and without types
        ipc: Any = import_module("pyarrow.ipc")
    except ImportError as error:
        raise NoArrowError("Arrow needs pyarrow, which is not installed here; npz does not") from error
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
