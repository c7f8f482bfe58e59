"""The addresses of analyses: what the samples of a run say as a whole, as numbers or drawn."""

from collections.abc import Awaitable, Callable
from typing import Annotated, Any, Final, Protocol, TypeAlias

from fastapi import Query, Request, Response

from daq.reports.analyses_questions import AnalysisForm, Asked
from daq.reports.analysis_schema import AnalysisDocument
from daq.reports.columns import QUANTITIES
from daq.reports.registry import KINDS, AnalysisKind
from daq.service.acceptance import best_type
from daq.service.problem_types import READING, Kind
from daq.service.problems import ProblemError
from daq.service.routes.plot_routes import CONTENT, PLOT_TYPES
from daq.service.routing import Routing, RunId
from daq.service.tags import NOT_MODIFIED

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

Endpoint: TypeAlias = Callable[..., Awaitable[Response]]


class Answer(Protocol):
    """Who makes the answers about a run."""

    async def __call__(self, request: Request, run: str, what: str, query: Asked | None = None) -> Response:
        """Return an answer by its name."""
        ...


def add_analyses(routing: Routing, answer: Answer) -> None:
    """Make the addresses known."""
    for name, kind in KINDS.items():
        endpoint = _endpoint(answer, name, kind.question)
        endpoint.__doc__ = _told(kind)
        routing.add(
            f"/runs/{{run}}/analyses/{name}", endpoint, f"analyse_run_{name.replace('-', '_')}", "analyses", kind.title,
            *READING, Kind.NO_SUCH_MOMENT, Kind.NOT_TOLD, Kind.TOO_MUCH, Kind.NOT_ACCEPTABLE, model=AnalysisDocument,
            answers={200: {"content": FORMS}, **NOT_MODIFIED},
        )  # fmt: skip


def _endpoint(answer: Answer, name: str, question: type[Asked]) -> Endpoint:
    async def analyse(request: Request, run: RunId, query: Annotated[Asked, Query()]) -> Response:
        form = query.format or best_type(request.headers.get("accept"), FORM_TYPES)
        if form is None:
            raise ProblemError(Kind.NOT_ACCEPTABLE, f"expected one of {', '.join(FORM_TYPES)}")
        return await answer(request, run, f"analyses/{name}.{form}", query)

    analyse.__annotations__["query"] = Annotated[question, Query()]
    return analyse


def _told(kind: AnalysisKind) -> str:
    """Return what the schema says of a kind: its columns with units."""
    lines = [f"- `{name}`: {QUANTITIES[name].told}" for name in kind.columns]
    return f"{kind.meaning}, computed from the run's samples. Its columns:\n\n" + "\n".join(lines)
