"""The web application: REST under /api/v1, the operator's page at /, the REST reference at /docs."""

from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager
from importlib.metadata import version
from typing import Any, Final

from fastapi import FastAPI
from fastapi.middleware import Middleware
from fastapi.middleware.cors import CORSMiddleware
from fastapi.staticfiles import StaticFiles

from daq.errors import ServiceError
from daq.service import pages
from daq.service.http_semantics import API_PREFIX
from daq.service.middleware import (
    AccessControlMiddleware,
    HeadAsGetMiddleware,
    SecurityHeadersMiddleware,
    UnhandledErrorMiddleware,
    is_loopback,
)
from daq.service.problems import (
    EXCEPTION_HANDLERS,
    PROBLEM_SCHEMA_REFERENCE,
    ProblemSchema,
    ProblemType,
    problems,
)
from daq.service.routes import jobs, live, results, runs, uploads
from daq.service.state import ServiceState

DISTRIBUTION: Final = "rig-service"
API_DESCRIPTION: Final = (
    "Recorded runs of a rotor test rig, their results, and the live values of the current run. "
    "Field names include the unit; amplitudes are peak (zero-to-peak) or peak-to-peak as named; phases are lags after "
    "the tacho mark in degrees, 0 to 360; x and y are the two probes. Numbers are rounded to four decimals, those of "
    "analyses to nine digits."
)
OPENAPI_TAGS: Final = [
    {"name": "runs", "description": "Recorded runs"},
    {"name": "results", "description": "Measured results of a run, and the model's prediction for it"},
    {"name": "analyses", "description": "Analyses of a run's samples, as tables and plots"},
    {"name": "uploads", "description": "Files of other programs, for import as runs"},
    {"name": "jobs", "description": "Work that takes longer than a request may"},
    {"name": "live", "description": "The run that is being recorded or replayed"},
    {"name": "service", "description": "The service itself"},
]


def create_app(
    state: ServiceState,
    viewer_url: str = "",
    *,
    host: str = "127.0.0.1",
    token: str | None = None,
    cors_origins: Iterable[str] = (),
) -> FastAPI:
    """Return the application.

    Parameters
    ----------
    state : ServiceState
        What the routes share.
    viewer_url : str
        URL of the web viewer that the page embeds; empty if there is none.
    host : str
        Address that the server is bound to. A loopback address accepts only loopback host names.
    token : str or None
        Bearer token required by the REST routes (``Authorization: Bearer ...``). Required if other machines can
        reach ``host``.
    cors_origins : iterable of str
        Other sites whose pages may send requests (CORS), for example ``http://notebook.lab:8888``.

    Raises
    ------
    ServiceError
        Other machines can reach ``host`` and there is no token, or a header cannot carry the token.
    ValueError
        ``viewer_url`` is no URL of http or https.
    """
    _check_access(host, token)
    app = FastAPI(
        title="Rig service",
        version=version(DISTRIBUTION),
        description=API_DESCRIPTION,
        openapi_tags=OPENAPI_TAGS,
        license_info={"name": "Apache License 2.0", "identifier": "Apache-2.0"},
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
        exception_handlers=EXCEPTION_HANDLERS,
        generate_unique_id_function=lambda route: route.name,
        lifespan=_lifespan,
        middleware=_middleware(host, token, frozenset(cors_origins)),
    )
    app.state.service = state
    app.state.reference = None
    app.state.viewer_url = viewer_url
    app.state.viewer_origin = pages.origin(viewer_url) if viewer_url else pages.NO_SOURCE
    common = (
        ProblemType.HOST_NOT_ALLOWED,
        ProblemType.INTERNAL_ERROR,
        *([ProblemType.TOKEN_REQUIRED] if token else []),
    )
    routers = [*(module.router for module in (runs, results, uploads, jobs, live)), results.analyses_router]
    routers += [live.health_router, *([runs.start_router] if state.run_manager else [])]
    for router in routers:
        app.include_router(router, prefix=API_PREFIX, responses=problems(*common))
    app.include_router(pages.router)
    app.mount("/console", StaticFiles(directory=pages.CONSOLE))
    _complete_schema(app.openapi(), with_token=token is not None)
    return app


def _middleware(host: str, token: str | None, origins: frozenset[str]) -> list[Middleware]:
    """Return the middleware, the outermost first."""
    cors = Middleware(
        CORSMiddleware,
        allow_origins=tuple(origins),
        allow_methods=("GET", "HEAD", "POST", "PATCH", "PUT", "DELETE"),
        allow_headers=("Authorization", "Content-Type", "If-Match", "If-None-Match", "If-Range", "Range"),
        expose_headers=("ETag", "Content-Disposition", "Content-Range", "Retry-After", "Location"),
    )
    return [
        Middleware(SecurityHeadersMiddleware),
        Middleware(HeadAsGetMiddleware),
        *([cors] if origins else []),
        Middleware(AccessControlMiddleware, host=host, token=token, origins=origins),
        Middleware(UnhandledErrorMiddleware),
    ]


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    try:
        yield
    finally:  # also where a response in progress hangs, so that the server cancels all
        state: ServiceState = app.state.service
        state.uploads.close()


def _check_access(host: str, token: str | None) -> None:
    if token is not None and not (token.isascii() and token.isprintable() and token.strip() == token and token):
        raise ServiceError(
            "the service's token: expected one or more printable ASCII characters without spaces at its ends"
        )
    if token is None and not is_loopback(host):
        raise ServiceError(
            f"the service at {host} can be reached from other machines: give it a token, or bind it to 127.0.0.1"
        )


def _complete_schema(schema: dict[str, Any], *, with_token: bool) -> None:
    """Add the problem responses' schema and the bearer token, which no route declares, to an OpenAPI schema."""
    template = PROBLEM_SCHEMA_REFERENCE.replace(ProblemSchema.__name__, "{model}")
    problem = ProblemSchema.model_json_schema(ref_template=template, mode="serialization")
    schema["components"]["schemas"] |= problem.pop("$defs") | {ProblemSchema.__name__: problem}
    if with_token:
        schema["components"]["securitySchemes"] = {"token": {"type": "http", "scheme": "bearer"}}
        schema["security"] = [{"token": []}]
