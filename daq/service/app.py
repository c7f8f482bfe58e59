"""The web application: REST under /api/v1, the operator's page at /, the REST reference at /docs."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any, Final

from fastapi import APIRouter, FastAPI
from fastapi.middleware.cors import CORSMiddleware

from daq.errors import ServiceError
from daq.service.access import AccessControlMiddleware, SecurityHeadersMiddleware, is_loopback
from daq.service.jobs.queue import JobQueue
from daq.service.pages import PUBLIC_PATHS, Pages, reference_page
from daq.service.problem_types import ProblemSchema, ProblemType
from daq.service.problems import UnhandledErrorMiddleware, add_exception_handlers
from daq.service.results_reader import ResultsReader
from daq.service.routes.catalogue import Catalogue, CatalogueRoutes, Summaries
from daq.service.routes.jobs import JobRoutes
from daq.service.routes.live import LiveStreamRoutes, RunControl, RunControlRoutes, RunStarter
from daq.service.routes.run_edits import EditableCatalogue, RunEditRoutes
from daq.service.routes.runs import RunRoutes
from daq.service.routes.uploads import UploadRoutes
from daq.service.routing import API_PREFIX, HeadAsGetMiddleware, Routing
from daq.service.stream import LiveFeed
from daq.service.uploads import UploadStore


@dataclass(frozen=True, slots=True)
class ServiceFeatures:
    """Optional parts of the service; routes of a part that is None do not exist.

    Parameters
    ----------
    results : ResultsReader or None
        Results of recorded runs beyond their summaries.
    run_control : RunControl or None
        Stops the current run, adds markers to it and acknowledges its alarms.
    run_starter : RunStarter or None
        Starts runs.
    catalogue : EditableCatalogue or None
        Edits, trashes, restores and receives runs; used only together with `results`.
    jobs : JobQueue or None
        Runs work that takes longer than a request may.
    cors_origins : tuple of str
        Other sites whose pages may send requests (CORS), for example ``http://notebook.lab:8888``.
    """

    results: ResultsReader | None = None
    run_control: RunControl | None = None
    run_starter: RunStarter | None = None
    catalogue: EditableCatalogue | None = None
    jobs: JobQueue | None = None
    cors_origins: tuple[str, ...] = ()


READ_ONLY: Final = ServiceFeatures()


DISTRIBUTION = "rig-service"
SCHEMA = "#/components/schemas/{model}"
API_DESCRIPTION = (
    "Recorded runs of a rotor test rig, their results, and the live values of the current run. "
    "Field names include the unit; amplitudes are peak (zero-to-peak) or peak-to-peak as named; phases are lags after "
    "the tacho mark in degrees, 0 to 360; x and y are the two probes. Numbers are rounded to four decimals."
)
OPENAPI_TAGS = [
    {"name": "runs", "description": "Recorded runs"},
    {"name": "results", "description": "Measured results of a run, and the model's prediction for it"},
    {"name": "analyses", "description": "Analyses of a run's samples, as tables and plots"},
    {"name": "uploads", "description": "Files of other programs, for import as runs"},
    {"name": "jobs", "description": "Work that takes longer than a request may"},
    {"name": "live", "description": "The run that is being recorded or replayed"},
    {"name": "service", "description": "The service itself"},
]


def create_app(
    catalogue: Catalogue,
    live: LiveFeed,
    summaries: Summaries,
    viewer_url: str | None,
    *,
    features: ServiceFeatures = READ_ONLY,
    host: str = "127.0.0.1",
    token: str | None = None,
) -> "Service":
    """Return the application.

    Parameters
    ----------
    catalogue : Catalogue
        The recorded runs.
    live : LiveFeed
        The current run.
    summaries : Summaries
        Summaries of runs.
    viewer_url : str or None
        URL of the web viewer that the page embeds; None if there is none.
    features : ServiceFeatures
        Optional parts.
    host : str
        Address that the server is bound to. A loopback address accepts only loopback host names.
    token : str or None
        Bearer token required by the REST routes (``Authorization: Bearer ...``). Required if other machines can
        reach ``host``.

    Raises
    ------
    ServiceError
        Other machines can reach ``host`` and there is no token, or a header cannot carry the token.
    """
    _check_access(host, token)
    live_streams = LiveStreamRoutes(live)
    app = Service(with_token=token is not None)
    app.shutdown_hooks.append(live_streams.close_streams)
    add_exception_handlers(app)
    common_problems = (
        ProblemType.HOST_NOT_ALLOWED,
        ProblemType.INTERNAL_ERROR,
        *((ProblemType.TOKEN_REQUIRED,) if token is not None else ()),
    )
    routing = Routing(APIRouter(prefix=API_PREFIX), common_problems)
    CatalogueRoutes(catalogue, live, summaries, app.version).add_to(routing)
    live_streams.add_to(routing)
    RunControlRoutes(features.run_control, features.run_starter).add_to(routing)
    if features.results is not None:
        RunRoutes(catalogue, live, features.results, app.version).add_to(routing)
        if features.catalogue is not None:
            RunEditRoutes(features.catalogue, live, features.results).add_to(routing)
    if features.jobs is not None:
        uploads = UploadStore(features.jobs.location.folder)
        if features.results is not None and features.catalogue is not None:
            UploadRoutes(uploads, features.results, features.catalogue.free_bytes).add_to(routing)
        job_routes = JobRoutes(catalogue, live, features.jobs, uploads)
        job_routes.add_to(routing)
        app.shutdown_hooks += [job_routes.close_streams, uploads.close]
    app.include_router(routing.router)
    app.include_router(Pages(viewer_url, reference_page(app.openapi())).router())
    app.add_middleware(UnhandledErrorMiddleware)
    app.add_middleware(
        AccessControlMiddleware, host=host, token=token, public=PUBLIC_PATHS, origins=frozenset(features.cors_origins)
    )
    if features.cors_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=features.cors_origins,
            allow_methods=("GET", "HEAD", "POST", "PATCH", "PUT", "DELETE"),
            allow_headers=("Authorization", "Content-Type", "If-Match", "If-None-Match", "If-Range", "Range"),
            expose_headers=("ETag", "Content-Disposition", "Content-Range", "Retry-After", "Location"),
        )
    app.add_middleware(HeadAsGetMiddleware)
    app.add_middleware(SecurityHeadersMiddleware)
    return app


def _check_access(host: str, token: str | None) -> None:
    if token is not None and not (token.isascii() and token.isprintable() and token.strip() == token and token):
        raise ServiceError(
            "the service's token: expected one or more printable ASCII characters without spaces at its ends"
        )
    if token is None and not is_loopback(host):
        raise ServiceError(
            f"the service at {host} can be reached from other machines: give it a token, or bind it to 127.0.0.1"
        )


class Service(FastAPI):
    """FastAPI application whose OpenAPI schema includes problem responses and the bearer token."""

    def __init__(self, *, with_token: bool) -> None:
        super().__init__(
            title="Rig service",
            version=version(DISTRIBUTION),
            description=API_DESCRIPTION,
            openapi_tags=OPENAPI_TAGS,
            license_info={"name": "Apache License 2.0", "identifier": "Apache-2.0"},
            docs_url=None,
            redoc_url=None,
            redirect_slashes=False,
        )
        self.shutdown_hooks: list[Callable[[], None]] = []
        self._with_token = with_token

    def close_streams(self) -> None:
        """End endless responses (event streams and sockets), so that the server need not wait for them."""
        for close in self.shutdown_hooks:
            close()

    def openapi(self) -> dict[str, Any]:
        """Return the OpenAPI schema."""
        schema = super().openapi()
        used = {tag for path in schema["paths"].values() for operation in path.values() for tag in operation["tags"]}
        schema["tags"] = [tag for tag in OPENAPI_TAGS if tag["name"] in used]
        components = schema["components"]
        if ProblemSchema.__name__ not in components["schemas"]:
            problem = ProblemSchema.model_json_schema(ref_template=SCHEMA, mode="serialization")
            components["schemas"] |= problem.pop("$defs") | {ProblemSchema.__name__: problem}
            if self._with_token:
                components["securitySchemes"] = {"token": {"type": "http", "scheme": "bearer"}}
                schema["security"] = [{"token": []}]
        return schema
