"""The addresses of analyses: what the samples of a run say as a whole, as numbers or drawn.

The addresses of drawings: the numbers of a run's results as SVG and as PNG.
"""

from collections.abc import Awaitable, Callable
from typing import Annotated, Any, Final, Protocol, TypeAlias

from fastapi import Query, Request, Response

from daq.reports.analysis_result import AnalysisSchema
from daq.reports.columns import QUANTITIES
from daq.reports.parameters import (
    AnalysisForm,
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
from daq.service.routing import Routing, RunId

PLOT_TYPES: Final = {"svg": "image/svg+xml", "png": "image/png"}
CONTENT: Final = {"svg": {"type": "string"}, "png": {"type": "string", "format": "binary"}}

Endpoint: TypeAlias = Callable[..., Awaitable[Response]]


class PlotAnswer(Protocol):
    """Who makes the answers about a run."""

    async def __call__(self, request: Request, run: str, what: str, query: QueryParameters | None = None) -> Response:
        """Return an answer by its name."""
        ...


def add_plots(routing: Routing, answer: PlotAnswer) -> None:
    """Make the addresses known."""
    plots: tuple[tuple[str, Callable[[PlotAnswer, str], Endpoint], str], ...] = (
        ("order-spectrum", _of_moment, "The order spectrum of a moment"),
        ("full-spectrum", _of_moment, "The full spectrum of a moment"),
        ("orbit", _of_moment, "The orbit of a moment"),
        ("bode", _of_run, "Amplitude and phase of 1X over speed"),
        ("polar", _of_run, "Vectors of 1X by speed"),
        ("cascade", _of_cascade, "Order spectra over speed"),
        ("waterfall", _of_waterfall, "Order spectra over time"),
    )
    for what, endpoint, meaning in plots:
        for form, media_type in PLOT_TYPES.items():
            routing.add(
                f"/runs/{{run}}/plots/{what}.{form}",
                endpoint(answer, f"plots/{what}.{form}"),
                f"plot_run_{what.replace('-', '_')}_{form}",
                "results",
                f"{meaning}, drawn as {form.upper()}",
                *RUN_READ_PROBLEMS,
                ProblemType.NO_DATA,
                *((ProblemType.NOT_ACCEPTABLE,) if form == "png" else ()),
                responses={200: {"content": {media_type: {"schema": CONTENT[form]}}}, **NOT_MODIFIED},
            )


def _of_moment(answer: PlotAnswer, what: str) -> Endpoint:
    async def draw(request: Request, run: RunId, at: Annotated[FrameQuery, Query()]) -> Response:
        """Draw the recorded frame that is nearest, with the same numbers as the address without `plots`."""
        return await answer(request, run, what, at)

    return draw


def _of_run(answer: PlotAnswer, what: str) -> Endpoint:
    async def draw(request: Request, run: RunId) -> Response:
        """Draw 1X at both probes, with the numbers of `order-vectors`."""
        return await answer(request, run, what)

    return draw


def _of_cascade(answer: PlotAnswer, what: str) -> Endpoint:
    async def draw(request: Request, run: RunId, query: Annotated[RecordedCascadeQuery, Query()]) -> Response:
        """Draw the spectra one above the other, each with its foot at its speed."""
        return await answer(request, run, what, query)

    return draw


def _of_waterfall(answer: PlotAnswer, what: str) -> Endpoint:
    async def draw(request: Request, run: RunId, query: Annotated[RecordedWaterfallQuery, Query()]) -> Response:
        """Draw the spectra one above the other, each with its foot at its time."""
        return await answer(request, run, what, query)

    return draw


NPZ: Final = "application/x-npz"
ARROW: Final = "application/vnd.apache.arrow.stream"
FORM_TYPES: Final = {
    "application/json": AnalysisForm.JSON,
    NPZ: AnalysisForm.NPZ,
    ARROW: AnalysisForm.ARROW,
    PLOT_TYPES["svg"]: AnalysisForm.SVG,
    PLOT_TYPES["png"]: AnalysisForm.PNG,
}
BINARY: Final = {"schema": {"type": "string", "format": "binary"}}
FORMS: Final[dict[str, Any]] = {
    NPZ: BINARY,
    ARROW: BINARY,
    PLOT_TYPES["svg"]: {"schema": CONTENT["svg"]},
    PLOT_TYPES["png"]: {"schema": CONTENT["png"]},
}


class Answer(Protocol):
    """Who makes the answers about a run."""

    async def __call__(self, request: Request, run: str, what: str, query: AnalysisQuery | None = None) -> Response:
        """Return an answer by its name."""
        ...


def add_analyses(routing: Routing, answer: Answer) -> None:
    """Make the addresses known."""
    for name, kind in KINDS.items():
        endpoint = _endpoint(answer, name, kind.parameters)
        endpoint.__doc__ = _told(kind)
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
            responses={200: {"content": FORMS}, **NOT_MODIFIED},
        )


def _endpoint(answer: Answer, name: str, question: type[AnalysisQuery]) -> Endpoint:
    async def analyse(request: Request, run: RunId, query: Annotated[AnalysisQuery, Query()]) -> Response:
        form = query.format or preferred_media_type(request.headers.get("accept"), FORM_TYPES)
        if form is None:
            raise ProblemError(ProblemType.NOT_ACCEPTABLE, f"expected one of {', '.join(FORM_TYPES)}")
        return await answer(request, run, f"analyses/{name}.{form}", query)

    analyse.__annotations__["query"] = Annotated[question, Query()]
    return analyse


def _told(kind: AnalysisKind) -> str:
    """Return what the schema says of a kind: its columns with units."""
    lines = [f"- `{name}`: {QUANTITIES[name].text}" for name in kind.columns]
    return f"{kind.description}, computed from the run's samples. Its columns:\n\n" + "\n".join(lines)
