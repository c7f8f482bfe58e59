"""The answers that are made of a recording's file by a reading process, ready to be sent."""

import gzip
import re
from collections.abc import Callable
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from analysis.live.summary import RunSummary
from analysis.signals.header import Role, RunHeader
from daq.reports.analysis_export import ANALYSIS_PATH, analysis_response
from daq.reports.parameters import AnalysisQuery, FrameQuery, TrendQuery
from daq.reports.plots.png import render_png
from daq.reports.plots.recorded import result_panels
from daq.reports.plots.svg import render_svg
from daq.reports.recorded_results import cascade, trend_schema, waterfall
from daq.reports.run_history import RunHistory, file_status, load_history, snapshot_at
from daq.schemas.results import (
    OrderVectorsSchema,
    WhirlFindingsSchema,
)
from daq.schemas.snapshot import full_spectrum_schema, orbit_schema, order_spectrum_schema
from daq.schemas.summary import speed_row_schema, sub_synchronous_schema
from daq.schemas.units import Schema

RPM = np.pi / 30.0
ANSWERS_KEPT = 128
PLOTS = re.compile(r"plots/([a-z-]+)\.(svg|png)")
PLOTTED = {"bode": "order-vectors", "polar": "order-vectors"}  # of what plots are that have a name of their own
LEVEL = 4  # of gzip: beyond it nothing is gained but time spent


def order_vectors(_path: Path, found: RunHistory) -> Schema:
    """Return 1X and 2X over speed."""
    return OrderVectorsSchema(run=found.header.run, by_speed=tuple(speed_row_schema(row) for row in found.summary.rows))


def findings(_path: Path, found: RunHistory) -> Schema:
    """Return what was found below 1X."""
    return WhirlFindingsSchema(
        run=found.header.run,
        sub_synchronous=tuple(sub_synchronous_schema(finding) for finding in found.summary.whirls),
    )


def trend(_path: Path, found: RunHistory, query: TrendQuery) -> Schema:
    """Return values over time."""
    begin = query.from_s
    end = np.inf if query.duration_s is None else begin + query.duration_s
    return trend_schema(found, query.segment, begin, end, query.entries)


def moment(path: Path, found: RunHistory, at: FrameQuery, *, what: str) -> Schema:
    """Return order spectrum, full spectrum or orbit of the frame nearest to a moment."""
    index = found.nearest(at.segment, at.time_s, None if at.speed_rpm is None else at.speed_rpm * RPM)
    snapshot, frame = snapshot_at(path, found, index)
    if what == "order-spectrum":
        return order_spectrum_schema(found.header, snapshot, frame)
    if what == "full-spectrum":
        return full_spectrum_schema(found.header, snapshot, frame)
    return orbit_schema(found.header, snapshot, frame)


def summary(path: Path) -> RunSummary:
    """Return what the run was."""
    return load_history(path).summary


ANSWERS: dict[str, Callable[..., Schema]] = {
    "order-vectors": order_vectors,
    "findings": findings,
    "trend": trend,
    "cascade": cascade,
    "waterfall": waterfall,
    "order-spectrum": partial(moment, what="order-spectrum"),
    "full-spectrum": partial(moment, what="full-spectrum"),
    "orbit": partial(moment, what="orbit"),
}


def document_of(path: Path, what: str, query: object, found: RunHistory | None = None) -> Schema:
    """Return the document of an address; of records that were read already where they are given."""
    asked = () if query is None else (query,)
    return ANSWERS[what](path, load_history(path) if found is None else found, *asked)


def address_of(what: str) -> str:
    """Return the address of the numbers of an answer, which may be a plot of them."""
    analysed = ANALYSIS_PATH.fullmatch(what)
    if analysed is not None:
        return analysed[1]
    drawn = PLOTS.fullmatch(what)
    return what if drawn is None else PLOTTED.get(drawn[1], drawn[1])


def answer_of(path: Path, what: str, query: object, packed: bool) -> bytes:  # noqa: FBT001 - sent through a pipe
    """Return an answer as JSON, gzipped where that is wanted; made once as long as the file does not change."""
    status = file_status(path)
    return _answer(path, status.st_size, status.st_mtime_ns, what, query, packed)


@lru_cache(maxsize=ANSWERS_KEPT)
def _answer(path: Path, _size: int, _changed_ns: int, what: str, query: object, packed: bool) -> bytes:  # noqa: FBT001 - a key of the cache
    drawn = PLOTS.fullmatch(what)
    if isinstance(query, AnalysisQuery):
        body = analysis_response(path, what, query)
    elif drawn is None:
        body = document_of(path, what, query).model_dump_json().encode()
    else:
        name, form = drawn.groups()
        panels = result_panels(document_of(path, address_of(what), query), name, _directions(load_history(path).header))
        body = render_svg(panels).encode() if form == "svg" else render_png(panels)
    return gzip.compress(body, LEVEL, mtime=0) if packed else body


def _directions(header: RunHeader) -> tuple[float, float]:
    """Return where the probes x and y sit, rad from X."""
    acquisition = header.acquisition
    x, y = (acquisition.channels[acquisition.row(role)].angle for role in (Role.PROBE_X, Role.PROBE_Y))
    return x, y
