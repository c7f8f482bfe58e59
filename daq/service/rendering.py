"""Responses computed from a recording's file in a worker process: results as JSON and as plots, gzipped if wanted."""

import gzip
import re
from collections.abc import Callable
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from analysis.live.summary import RunSummary
from analysis.signals.header import Role, RunHeader
from analysis.signals.units import RPM
from daq.reports.export import ANALYSIS_PATH, analysis_response
from daq.reports.parameters import AnalysisQuery, FrameQuery, TrendQuery
from daq.reports.plots.recorded import result_panels
from daq.reports.recorded_results import cascade, trend_schema, waterfall
from daq.reports.run_history import RunHistory, file_status, load_history, snapshot_at
from daq.schemas.results import (
    OrderVectorsSchema,
    WhirlFindingsSchema,
)
from daq.schemas.snapshot import full_spectrum_schema, orbit_schema, order_spectrum_schema
from daq.schemas.summary import SubSynchronousSchema, speed_row_schema
from daq.schemas.units import Schema

RESPONSE_CACHE_SIZE = 128
PLOT_PATH = re.compile(r"plots/([a-z-]+)\.(svg|png|pdf)")
PLOT_SOURCES = {"bode": "order-vectors", "polar": "order-vectors"}  # results shown by plots with another name
GZIP_LEVEL = 4  # higher levels take more time and save almost nothing


def order_vectors(_path: Path, history: RunHistory) -> Schema:
    """Return 1X and 2X over speed."""
    return OrderVectorsSchema(
        run=history.header.run, by_speed=tuple(speed_row_schema(row) for row in history.summary.rows)
    )


def findings(_path: Path, history: RunHistory) -> Schema:
    """Return the sub-synchronous components."""
    return WhirlFindingsSchema(
        run=history.header.run,
        sub_synchronous=tuple(SubSynchronousSchema.of(finding) for finding in history.summary.whirls),
    )


def trend(_path: Path, history: RunHistory, query: TrendQuery) -> Schema:
    """Return speed and vibration over time."""
    start = query.from_s
    end = np.inf if query.duration_s is None else start + query.duration_s
    return trend_schema(history, query.segment, start, end, query.entries)


def nearest_frame(path: Path, history: RunHistory, frame_query: FrameQuery, *, requested_path: str) -> Schema:
    """Return order spectrum, full spectrum or orbit of the order frame nearest to a time or speed."""
    index = history.nearest(
        frame_query.segment, frame_query.time_s, None if frame_query.speed_rpm is None else frame_query.speed_rpm * RPM
    )
    snapshot, frame = snapshot_at(path, history, index)
    if requested_path == "order-spectrum":
        return order_spectrum_schema(history.header, snapshot, frame)
    if requested_path == "full-spectrum":
        return full_spectrum_schema(history.header, snapshot, frame)
    return orbit_schema(history.header, snapshot, frame)


def summary(path: Path) -> RunSummary:
    """Return the run's summary."""
    return load_history(path).summary


RESULTS: dict[str, Callable[..., Schema]] = {
    "order-vectors": order_vectors,
    "findings": findings,
    "trend": trend,
    "cascade": cascade,
    "waterfall": waterfall,
    "order-spectrum": partial(nearest_frame, requested_path="order-spectrum"),
    "full-spectrum": partial(nearest_frame, requested_path="full-spectrum"),
    "orbit": partial(nearest_frame, requested_path="orbit"),
}


def result_schema(path: Path, requested_path: str, query: object, history: RunHistory | None = None) -> Schema:
    """Return the schema of a result; ``history`` saves reading the recording."""
    parameters = () if query is None else (query,)
    return RESULTS[requested_path](path, load_history(path) if history is None else history, *parameters)


def result_path(requested_path: str) -> str:
    """Return the path of the result that a path shows, for example ``order-vectors`` for ``plots/bode.svg``."""
    analysed = ANALYSIS_PATH.fullmatch(requested_path)
    if analysed is not None:
        return analysed[1]
    plot = PLOT_PATH.fullmatch(requested_path)
    return requested_path if plot is None else PLOT_SOURCES.get(plot[1], plot[1])


def result_response(path: Path, requested_path: str, query: object, gzipped: bool) -> bytes:  # noqa: FBT001 - sent through a pipe
    """Return the body of a response; cached until the file changes."""
    status = file_status(path)
    return _cached_response(path, status.st_size, status.st_mtime_ns, requested_path, query, gzipped)


@lru_cache(maxsize=RESPONSE_CACHE_SIZE)
def _cached_response(
    path: Path,
    _size: int,
    _changed_ns: int,
    requested_path: str,
    query: object,
    gzipped: bool,  # noqa: FBT001 - part of the cache key
) -> bytes:
    plot = PLOT_PATH.fullmatch(requested_path)
    if isinstance(query, AnalysisQuery):
        body = analysis_response(path, requested_path, query)
    elif plot is None:
        body = result_schema(path, requested_path, query).model_dump_json().encode()
    else:
        name, form = plot.groups()
        panels = result_panels(
            result_schema(path, result_path(requested_path), query), name, _probe_angles(load_history(path).header)
        )
        from daq.reports.plots.render import render  # noqa: PLC0415 - imports matplotlib, which takes a second

        body = render(panels, form)
    return gzip.compress(body, GZIP_LEVEL, mtime=0) if gzipped else body


def _probe_angles(header: RunHeader) -> tuple[float, float]:
    """Return the angles of the probes x and y, rad from X."""
    acquisition = header.acquisition
    x, y = (acquisition.channels[acquisition.row(role)].angle for role in (Role.PROBE_X, Role.PROBE_Y))
    return x, y
