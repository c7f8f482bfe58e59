"""Routes of a run's analyses, as numbers or plots, and of plots of its results as SVG, PNG or PDF."""

from collections.abc import Awaitable, Callable
from typing import Annotated, Any, Final, Protocol, TypeAlias

from fastapi import Query, Request, Response

from daq.reports.analysis_result import QUANTITIES, AnalysisSchema
from daq.reports.parameters import (
    AnalysisFormat,
    AnalysisQuery,
    FrameQuery,
    QueryParameters,
    RecordedCascadeQuery,
    RecordedWaterfallQuery,
)
from daq.reports.registry import KINDS, AnalysisKind
from daq.service.problem_types import RUN_READ_PROBLEMS, ProblemType
from daq.service.problems import ProblemError
from daq.service.responses import NOT_MODIFIED, preferred_media_type
from daq.service.routing import Routing
from daq.service.state import RunId

PLOT_TYPES: Final = {"svg": "image/svg+xml", "png": "image/png", "pdf": "application/pdf"}
BINARY: Final = {"type": "string", "format": "binary"}
PLOT_SCHEMAS: Final = {"svg": {"type": "string"}, "png": BINARY, "pdf": BINARY}

Handler: TypeAlias = Callable[..., Awaitable[Response]]


class ResultHandler(Protocol):
    """Handler of requests for a run's results."""

    async def __call__(self, request: Request, run: str, path: str, query: QueryParameters | None = None) -> Response:
        """Return the response of a result by its path."""
        ...


def add_plots(routing: Routing, respond: ResultHandler) -> None:
    """Add the routes."""
    plots: tuple[tuple[str, Callable[[ResultHandler, str], Handler], str], ...] = (
        ("order-spectrum", _frame_plot, "Order spectrum at a time or speed"),
        ("full-spectrum", _frame_plot, "Full spectrum at a time or speed"),
        ("orbit", _frame_plot, "Orbit at a time or speed"),
        ("bode", _run_plot, "Amplitude and phase of 1X over speed"),
        ("polar", _run_plot, "1X vectors over speed"),
        ("cascade", _cascade_plot, "Order spectra over speed"),
        ("waterfall", _waterfall_plot, "Order spectra over time"),
    )
    for path, endpoint, title in plots:
        for file_format, media_type in PLOT_TYPES.items():
            routing.add(
                f"/runs/{{run}}/plots/{path}.{file_format}",
                endpoint(respond, f"plots/{path}.{file_format}"),
                f"plot_run_{path.replace('-', '_')}_{file_format}",
                "results",
                f"{title}, as {file_format.upper()} plot",
                *RUN_READ_PROBLEMS,
                ProblemType.NO_DATA,
                responses={200: {"content": {media_type: {"schema": PLOT_SCHEMAS[file_format]}}}, **NOT_MODIFIED},
            )


def _frame_plot(respond: ResultHandler, path: str) -> Handler:
    async def plot(request: Request, run: RunId, frame: Annotated[FrameQuery, Query()]) -> Response:
        """Plot the nearest recorded order frame, with the numbers of the path without `plots`."""
        return await respond(request, run, path, frame)

    return plot


def _run_plot(respond: ResultHandler, path: str) -> Handler:
    async def plot(request: Request, run: RunId) -> Response:
        """Plot 1X of both probes, with the numbers of `order-vectors`."""
        return await respond(request, run, path)

    return plot


def _cascade_plot(respond: ResultHandler, path: str) -> Handler:
    async def plot(request: Request, run: RunId, query: Annotated[RecordedCascadeQuery, Query()]) -> Response:
        """Plot the spectra stacked, each with its baseline at its speed."""
        return await respond(request, run, path, query)

    return plot


def _waterfall_plot(respond: ResultHandler, path: str) -> Handler:
    async def plot(request: Request, run: RunId, query: Annotated[RecordedWaterfallQuery, Query()]) -> Response:
        """Plot the spectra stacked, each with its baseline at its time."""
        return await respond(request, run, path, query)

    return plot


NPZ: Final = "application/x-npz"
ARROW: Final = "application/vnd.apache.arrow.stream"
ANALYSIS_MEDIA_TYPES: Final = {
    "application/json": AnalysisFormat.JSON,
    NPZ: AnalysisFormat.NPZ,
    ARROW: AnalysisFormat.ARROW,
    **{media_type: AnalysisFormat(file_format) for file_format, media_type in PLOT_TYPES.items()},
}
ANALYSIS_CONTENT: Final[dict[str, Any]] = {
    NPZ: {"schema": BINARY},
    ARROW: {"schema": BINARY},
    **{media_type: {"schema": PLOT_SCHEMAS[file_format]} for file_format, media_type in PLOT_TYPES.items()},
}


class AnalysisHandler(Protocol):
    """Handler of requests for a run's analyses."""

    async def __call__(self, request: Request, run: str, path: str, query: AnalysisQuery | None = None) -> Response:
        """Return the response of an analysis by its path."""
        ...


def add_analyses(routing: Routing, respond: AnalysisHandler) -> None:
    """Add the routes."""
    for name, kind in KINDS.items():
        endpoint = _analysis_handler(respond, name, kind.parameters)
        endpoint.__doc__ = _description(kind)
        routing.add(
            f"/runs/{{run}}/analyses/{name}",
            endpoint,
            f"analyse_run_{name.replace('-', '_')}",
            "analyses",
            kind.title,
            *RUN_READ_PROBLEMS,
            ProblemType.NO_DATA,
            ProblemType.INSUFFICIENT_DATA,
            ProblemType.RESPONSE_TOO_LARGE,
            ProblemType.NOT_ACCEPTABLE,
            model=AnalysisSchema,
            responses={200: {"content": ANALYSIS_CONTENT}, **NOT_MODIFIED},
        )


def _analysis_handler(respond: AnalysisHandler, name: str, query_class: type[AnalysisQuery]) -> Handler:
    async def analyse(request: Request, run: RunId, query: Annotated[AnalysisQuery, Query()]) -> Response:
        file_format = query.format or preferred_media_type(request.headers.get("accept"), ANALYSIS_MEDIA_TYPES)
        if file_format is None:
            raise ProblemError(ProblemType.NOT_ACCEPTABLE, f"expected one of {', '.join(ANALYSIS_MEDIA_TYPES)}")
        return await respond(request, run, f"analyses/{name}.{file_format}", query)

    analyse.__annotations__["query"] = Annotated[query_class, Query()]
    return analyse


def _description(kind: AnalysisKind) -> str:
    """Return the OpenAPI description of an analysis: its columns with units."""
    lines = [f"- `{name}`: {QUANTITIES[name].text}" for name in kind.columns]
    return f"{kind.description}, computed from the run's samples. Its columns:\n\n" + "\n".join(lines)
