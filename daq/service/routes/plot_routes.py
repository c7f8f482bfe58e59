"""The addresses of drawings: the numbers of a run's results as SVG and as PNG."""

from collections.abc import Awaitable, Callable
from typing import Annotated, Final, Protocol, TypeAlias

from fastapi import Query, Request, Response

from daq.reports.questions import At, CascadeQuery, Question, WaterfallQuery
from daq.service.problem_types import READING, Kind
from daq.service.routing import Routing, RunId
from daq.service.tags import NOT_MODIFIED

PLOT_TYPES: Final = {"svg": "image/svg+xml", "png": "image/png"}
CONTENT: Final = {"svg": {"type": "string"}, "png": {"type": "string", "format": "binary"}}

Endpoint: TypeAlias = Callable[..., Awaitable[Response]]


class Answer(Protocol):
    """Who makes the answers about a run."""

    async def __call__(self, request: Request, run: str, what: str, query: Question | None = None) -> Response:
        """Return an answer by its name."""
        ...


def add_plots(routing: Routing, answer: Answer) -> None:
    """Make the addresses known."""
    plots: tuple[tuple[str, Callable[[Answer, str], Endpoint], str], ...] = (
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
                f"/runs/{{run}}/plots/{what}.{form}", endpoint(answer, f"plots/{what}.{form}"),
                f"draw_run_{what.replace('-', '_')}_{form}", "results", f"{meaning}, drawn as {form.upper()}",
                *READING, Kind.NO_SUCH_MOMENT, *((Kind.NOT_ACCEPTABLE,) if form == "png" else ()),
                answers={200: {"content": {media_type: {"schema": CONTENT[form]}}}, **NOT_MODIFIED},
            )  # fmt: skip


def _of_moment(answer: Answer, what: str) -> Endpoint:
    async def draw(request: Request, run: RunId, at: Annotated[At, Query()]) -> Response:
        """Draw the recorded frame that is nearest, with the same numbers as the address without `plots`."""
        return await answer(request, run, what, at)

    return draw


def _of_run(answer: Answer, what: str) -> Endpoint:
    async def draw(request: Request, run: RunId) -> Response:
        """Draw 1X at both probes, with the numbers of `order-vectors`."""
        return await answer(request, run, what)

    return draw


def _of_cascade(answer: Answer, what: str) -> Endpoint:
    async def draw(request: Request, run: RunId, query: Annotated[CascadeQuery, Query()]) -> Response:
        """Draw the spectra one above the other, each with its foot at its speed."""
        return await answer(request, run, what, query)

    return draw


def _of_waterfall(answer: Answer, what: str) -> Endpoint:
    async def draw(request: Request, run: RunId, query: Annotated[WaterfallQuery, Query()]) -> Response:
        """Draw the spectra one above the other, each with its foot at its time."""
        return await answer(request, run, what, query)

    return draw
