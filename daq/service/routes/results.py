"""Routes of a recorded run's analyses and other results, of its samples, and of the model's prediction for it."""

from functools import partial
from typing import Annotated, Any, Final

from fastapi import APIRouter, Query, Request, Response

from analysis.signals.units import RPM
from daq.reports.analysis_result import QUANTITIES, AnalysisSchema
from daq.reports.export import SampleFormat, SamplesQuery
from daq.reports.parameters import (
    AnalysisFormat,
    AnalysisQuery,
    QueryParameters,
    SpeedQuery,
    TrendQuery,
)
from daq.reports.registry import KINDS, AnalysisKind
from daq.schemas.results import ComparisonSchema, PredictionSchema, SamplesSchema, TrendSchema, WhirlFindingsSchema
from daq.service.http_semantics import (
    BINARY,
    NOT_MODIFIED,
    accepts_gzip,
    preferred_media_type,
    require_modified,
    weak_etag,
)
from daq.service.problems import RUN_READ_PROBLEMS, ProblemError, ProblemType, problems
from daq.service.results_reader import ANALYSIS_PREFIX
from daq.service.state import EndedRun, ServiceState, State
from recordings.catalogue.catalogue import RunEntry

JSON: Final = "application/json"
SVG: Final = "image/svg+xml"
MEDIA_TYPES: Final = {
    "json": JSON,
    "npz": "application/x-npz",
    "arrow": "application/vnd.apache.arrow.stream",
    "svg": SVG,
    "png": "image/png",
    "pdf": "application/pdf",
}
COMPRESSIBLE: Final = frozenset({JSON, SVG})
ANALYSIS_FORMATS: Final = {MEDIA_TYPES[each.value]: each.value for each in AnalysisFormat}
SAMPLE_FORMATS: Final = {MEDIA_TYPES[each.value]: each.value for each in SampleFormat}
ANALYSIS_CONTENT: Final[dict[str, Any]] = {
    media_type: {"schema": {"type": "string"}} if media_type == SVG else BINARY
    for media_type in ANALYSIS_FORMATS
    if media_type != JSON
}
SAMPLE_PROBLEMS: Final = (ProblemType.NO_DATA, ProblemType.RESPONSE_TOO_LARGE, ProblemType.NOT_ACCEPTABLE)
PREDICTION_PROBLEMS: Final = (*RUN_READ_PROBLEMS, ProblemType.NO_DATA, ProblemType.MODEL_NOT_READY)

router = APIRouter(tags=["results"])
analyses_router = APIRouter(tags=["analyses"])


@router.get(
    "/runs/{run}/findings",
    summary="Sub-synchronous components",
    response_model=WhirlFindingsSchema,
    responses={**problems(*RUN_READ_PROBLEMS), **NOT_MODIFIED},
)
async def get_run_findings(state: State, request: Request, run: EndedRun) -> Response:
    """Return the sub-synchronous components with their onset and end, as in the run's summary.

    `ETag` and `If-None-Match` avoid repeated transfers.
    """
    return await _result(state, request, run, "findings", QueryParameters())


@router.get(
    "/runs/{run}/trend",
    summary="Speed and vibration over time",
    response_model=TrendSchema,
    responses={**problems(*RUN_READ_PROBLEMS), **NOT_MODIFIED},
)
async def get_run_trend(
    state: State, request: Request, run: EndedRun, query: Annotated[TrendQuery, Query()]
) -> Response:
    """Return speed, overall vibration, 1X and whirl over time; decimation preserves minima and maxima."""
    return await _result(state, request, run, "trend", query)


@router.get(
    "/runs/{run}/prediction", summary="Predicted vibration at a speed", responses=problems(*PREDICTION_PROBLEMS)
)
async def get_run_prediction(state: State, run: EndedRun, query: Annotated[SpeedQuery, Query()]) -> PredictionSchema:
    """Return the model's prediction for the run's rig, with its configuration at the time of recording."""
    return await state.result_threads.run(state.results.prediction, run, query.speed_rpm * RPM)


@router.get(
    "/runs/{run}/comparison",
    summary="Measured and predicted vibration at a speed",
    responses=problems(*PREDICTION_PROBLEMS),
)
async def get_run_comparison(state: State, run: EndedRun, query: Annotated[SpeedQuery, Query()]) -> ComparisonSchema:
    """Return the nearest measured speed bin, within 300 r/min, and the prediction at the bin's mean speed."""
    return await state.result_threads.run(state.results.comparison, run, query.speed_rpm * RPM)


@router.get(
    "/runs/{run}/samples",
    summary="Samples of a time range",
    response_model=SamplesSchema,
    responses={
        **problems(*RUN_READ_PROBLEMS, *SAMPLE_PROBLEMS),
        200: {"content": {media_type: BINARY for media_type in SAMPLE_FORMATS if media_type != JSON}},
        **NOT_MODIFIED,
    },
)
async def get_run_samples(
    state: State, request: Request, run: EndedRun, query: Annotated[SamplesQuery, Query()]
) -> Response:
    """Return samples as JSON, NumPy archive or Arrow stream, in engineering units, volts or codes.

    The archive has an array `channel:NAME` for each channel and a table `about` of names and values.
    """
    form = SampleFormat(query.format or _accepted_format(request, SAMPLE_FORMATS))
    headers = _headers(request, run, "samples", form.value)
    gzipped = "Content-Encoding" in headers
    compute = partial(state.results.samples, run, query, form, gzipped=gzipped)
    return Response(await state.result_threads.run(compute), headers=headers)


def _add_analysis(name: str, kind: AnalysisKind) -> None:
    """Add the route of an analysis kind, which has its own query parameters."""

    async def analyse(
        state: State, request: Request, run: EndedRun, query: Annotated[AnalysisQuery, Query()]
    ) -> Response:
        file_format = AnalysisFormat(query.format or _accepted_format(request, ANALYSIS_FORMATS))
        query = query.model_copy(update={"format": file_format})
        return await _result(state, request, run, f"{ANALYSIS_PREFIX}{name}", query)

    analyse.__annotations__["query"] = Annotated[kind.parameters, Query()]
    analyses_router.get(
        f"/runs/{{run}}/analyses/{name}",
        name=f"analyse_run_{name.replace('-', '_')}",
        summary=kind.title,
        description=_description(kind),
        response_model=AnalysisSchema,
        responses={
            **problems(*RUN_READ_PROBLEMS, *SAMPLE_PROBLEMS, ProblemType.INSUFFICIENT_DATA),
            200: {"content": ANALYSIS_CONTENT},
            **NOT_MODIFIED,
        },
    )(analyse)


def _description(kind: AnalysisKind) -> str:
    """Return the OpenAPI description of an analysis: its sources and its columns with units."""
    lines = "\n".join(f"- `{name}`: {QUANTITIES[name].text}" for name in kind.columns)
    text = f"{kind.description}. Columns of the table from samples:\n\n{lines}"
    if kind.analyse_recorded is None:
        return text
    for source, names in (("samples", kind.parameters.only_samples), ("recorded", kind.parameters.only_recorded)):
        text += f"\n\nOnly with `source={source}`: {', '.join(f'`{name}`' for name in sorted(names)) or 'none'}."
    return text


for _name, _kind in KINDS.items():
    _add_analysis(_name, _kind)


def _accepted_format(request: Request, formats: dict[str, str]) -> str:
    """Return the format that the Accept header prefers; ProblemError if it accepts none."""
    preferred = preferred_media_type(request.headers.get("accept"), formats)
    if preferred is None:
        raise ProblemError(ProblemType.NOT_ACCEPTABLE, f"expected one of {', '.join(formats)}")
    return preferred


def _headers(request: Request, run: RunEntry, name: str, file_format: str) -> dict[str, str]:
    """Return the headers of a result; HTTPException (304) if the client has it already."""
    media_type = MEDIA_TYPES[file_format]
    gzipped = media_type in COMPRESSIBLE and accepts_gzip(request.headers.get("accept-encoding"))
    headers = {
        "ETag": weak_etag(run, request.app.version, name, file_format, str(gzipped)),
        "Vary": "Accept, Accept-Encoding",
        **({"Content-Encoding": "gzip"} if gzipped else {}),
    }
    require_modified(request, headers)
    return {**headers, "Content-Type": media_type}


async def _result(state: ServiceState, request: Request, run: RunEntry, name: str, query: QueryParameters) -> Response:
    """Return a result, computed and compressed in a worker process: GZipMiddleware would do that beside acquisition."""
    file_format = query.format if isinstance(query, AnalysisQuery) else None
    headers = _headers(request, run, name, file_format or AnalysisFormat.JSON)
    compute = partial(state.results.result, run, name, query, gzipped="Content-Encoding" in headers)
    return Response(await state.result_threads.run(compute), headers=headers)
