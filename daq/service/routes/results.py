"""Routes of one recorded run: its results, samples, predictions and file."""

from collections.abc import Callable
from functools import partial
from typing import Annotated

from fastapi import Query, Request, Response

from analysis.signals.units import RPM
from daq.reports.parameters import (
    AnalysisQuery,
    FrameQuery,
    QueryParameters,
    RecordedCascadeQuery,
    RecordedWaterfallQuery,
    SampleFormat,
    SamplesQuery,
    SpeedQuery,
    TrendQuery,
)
from daq.schemas.results import (
    CascadeSchema,
    ComparisonSchema,
    OrderVectorsSchema,
    PredictionSchema,
    SamplesSchema,
    TrendSchema,
    WaterfallSchema,
    WhirlFindingsSchema,
)
from daq.schemas.snapshot import FullSpectrumSchema, OrbitSchema, OrderSpectrumSchema
from daq.schemas.units import Schema
from daq.service.problem_types import RUN_READ_PROBLEMS, ProblemType
from daq.service.problems import ProblemError
from daq.service.responses import (
    BINARY,
    NOT_MODIFIED,
    accepts_gzip,
    preferred_media_type,
    require_modified,
    weak_etag,
)
from daq.service.routes.analyses import ARROW, NPZ, PLOT_TYPES, add_analyses, add_plots
from daq.service.routing import Routing
from daq.service.state import RunId, ServiceState
from daq.service.stream import require_ended
from recordings.catalogue.catalogue import RunEntry

MEDIA_TYPES = {**PLOT_TYPES, "npz": NPZ, "arrow": ARROW}
COMPRESSIBLE = ("application/json", PLOT_TYPES["svg"])
SAMPLE_TYPES = {"application/json": SampleFormat.JSON, NPZ: SampleFormat.NPZ, ARROW: SampleFormat.ARROW}


class RunRoutes:
    """Routes of one recorded run: results, samples, predictions and file.

    Parameters
    ----------
    state : ServiceState
        State of the service.
    version : str
        Version of the service; part of the ETags.
    """

    def __init__(self, state: ServiceState, version: str) -> None:
        self._state = state
        self._results = state.results
        self._version = version
        self._lookup_threads = state.lookups
        self._result_threads = state.result_threads

    def add_to(self, routing: Routing) -> None:
        """Add the routes."""
        results: tuple[tuple[str, Callable[..., object], str, type[Schema]], ...] = (
            ("order-vectors", self.order_vectors, "1X and 2X over speed", OrderVectorsSchema),
            ("findings", self.findings, "Sub-synchronous components", WhirlFindingsSchema),
            ("trend", self.trend, "Speed and vibration over time", TrendSchema),
            ("cascade", self.cascade, "Order spectra over speed", CascadeSchema),
            ("waterfall", self.waterfall, "Order spectra over time", WaterfallSchema),
            ("order-spectrum", self.order_spectrum, "Order spectrum at a time or speed", OrderSpectrumSchema),
            ("full-spectrum", self.full_spectrum, "Full spectrum at a time or speed", FullSpectrumSchema),
            ("orbit", self.orbit, "Orbit at a time or speed", OrbitSchema),
        )
        for path, endpoint, title, model in results:
            name = f"get_run_{path.replace('-', '_')}"
            problem_types = (
                RUN_READ_PROBLEMS
                if endpoint in {self.order_vectors, self.findings, self.trend}
                else (*RUN_READ_PROBLEMS, ProblemType.NO_DATA)
            )
            routing.add(
                f"/runs/{{run}}/{path}",
                endpoint,
                name,
                "results",
                title,
                *problem_types,
                model=model,
                responses=NOT_MODIFIED,
            )
        add_plots(routing, self._result_response)
        add_analyses(routing, self._result_response)
        predicted = (*RUN_READ_PROBLEMS, ProblemType.NO_DATA, ProblemType.MODEL_NOT_READY)
        routing.add(
            "/runs/{run}/prediction",
            self.prediction,
            "get_run_prediction",
            "results",
            "Predicted vibration at a speed",
            *predicted,
        )
        routing.add(
            "/runs/{run}/comparison",
            self.comparison,
            "get_run_comparison",
            "results",
            "Measured and predicted vibration at a speed",
            *predicted,
        )
        routing.add(
            "/runs/{run}/samples",
            self.samples,
            "get_run_samples",
            "results",
            "Samples of a time range",
            *RUN_READ_PROBLEMS,
            ProblemType.NO_DATA,
            ProblemType.RESPONSE_TOO_LARGE,
            ProblemType.NOT_ACCEPTABLE,
            model=SamplesSchema,
            responses={200: {"content": {NPZ: BINARY, ARROW: BINARY}}, **NOT_MODIFIED},
        )

    async def order_vectors(self, request: Request, run: RunId) -> Response:
        """Return amplitude and phase of 1X and 2X, their scatter and the overall vibration by speed bins.

        The rows are those of the run's summary. `ETag` and `If-None-Match` avoid repeated transfers.
        """
        return await self._result_response(request, run, "order-vectors")

    async def findings(self, request: Request, run: RunId) -> Response:
        """Return the sub-synchronous components with their onset and end, as in the run's summary."""
        return await self._result_response(request, run, "findings")

    async def trend(self, request: Request, run: RunId, query: Annotated[TrendQuery, Query()]) -> Response:
        """Return speed, overall vibration, 1X and whirl over time; decimation preserves minima and maxima."""
        return await self._result_response(request, run, "trend", query)

    async def cascade(self, request: Request, run: RunId, query: Annotated[RecordedCascadeQuery, Query()]) -> Response:
        """Return the maximum amplitude per cell of speed and order, at screen resolution."""
        return await self._result_response(request, run, "cascade", query)

    async def waterfall(
        self, request: Request, run: RunId, query: Annotated[RecordedWaterfallQuery, Query()]
    ) -> Response:
        """Return the maximum amplitude per cell of time and order, at screen resolution."""
        return await self._result_response(request, run, "waterfall", query)

    async def order_spectrum(self, request: Request, run: RunId, query: Annotated[FrameQuery, Query()]) -> Response:
        """Return amplitude and phase by order of the nearest recorded order frame."""
        return await self._result_response(request, run, "order-spectrum", query)

    async def full_spectrum(self, request: Request, run: RunId, query: Annotated[FrameQuery, Query()]) -> Response:
        """Return forward and backward amplitudes by order of the nearest recorded order frame."""
        return await self._result_response(request, run, "full-spectrum", query)

    async def orbit(self, request: Request, run: RunId, query: Annotated[FrameQuery, Query()]) -> Response:
        """Return the orbit over the last complete revolutions of the nearest recorded order frame."""
        return await self._result_response(request, run, "orbit", query)

    async def prediction(self, run: RunId, query: Annotated[SpeedQuery, Query()]) -> PredictionSchema:
        """Return the model's prediction for the run's rig, with its configuration at the time of recording."""
        entry = await self._entry(run)
        return await self._result_threads.run(partial(self._results.prediction, entry, query.speed_rpm * RPM))

    async def comparison(self, run: RunId, query: Annotated[SpeedQuery, Query()]) -> ComparisonSchema:
        """Return the nearest measured speed bin, within 300 r/min, and the prediction at the bin's mean speed."""
        entry = await self._entry(run)
        return await self._result_threads.run(partial(self._results.comparison, entry, query.speed_rpm * RPM))

    async def samples(self, request: Request, run: RunId, query: Annotated[SamplesQuery, Query()]) -> Response:
        """Return samples as JSON, NumPy archive or Arrow stream, in engineering units, volts or codes.

        The archive has an array `channel:NAME` for each channel and a table `about` of names and values.
        """
        form = query.format or preferred_media_type(request.headers.get("accept"), SAMPLE_TYPES)
        if form is None:
            raise ProblemError(ProblemType.NOT_ACCEPTABLE, f"expected one of {', '.join(SAMPLE_TYPES)}")
        form = SampleFormat(form)
        media_type = next(name for name, each in SAMPLE_TYPES.items() if each is form)
        gzipped = form is SampleFormat.JSON and accepts_gzip(request.headers.get("accept-encoding"))
        entry = await self._entry(run)
        etag = weak_etag(entry, self._version, form.value, str(gzipped))
        headers = {**_cache_headers(etag, gzipped=gzipped), "Vary": "Accept, Accept-Encoding"}
        require_modified(request, headers)
        body = await self._result_threads.run(partial(self._results.samples, entry, query, form, gzipped=gzipped))
        return Response(body, headers=headers, media_type=media_type)

    async def _result_response(
        self, request: Request, run: str, path: str, query: QueryParameters | None = None
    ) -> Response:
        media_type = MEDIA_TYPES.get(path.rpartition(".")[2], "application/json")
        gzipped = media_type in COMPRESSIBLE and accepts_gzip(request.headers.get("accept-encoding"))
        entry = await self._entry(run)
        etag = weak_etag(entry, self._version, path, str(gzipped))
        headers = _cache_headers(etag, gzipped=gzipped)
        if isinstance(query, AnalysisQuery):
            headers["Vary"] = "Accept, Accept-Encoding"
        require_modified(request, headers)
        body = await self._result_threads.run(partial(self._results.result, entry, path, query, gzipped=gzipped))
        return Response(body, headers=headers, media_type=media_type)

    async def _entry(self, run: str) -> RunEntry:
        """Return a run; ProblemError if it is still in progress."""
        require_ended(self._state.live, run)
        return await self._lookup_threads.run(partial(self._state.catalogue.run, run))


def _cache_headers(etag: str, *, gzipped: bool) -> dict[str, str]:
    coding = {"Content-Encoding": "gzip"} if gzipped else {}
    return {"ETag": etag, "Cache-Control": "private, no-cache", "Vary": "Accept-Encoding", **coding}
