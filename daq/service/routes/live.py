"""Routes of the live run: its values, once or as they change, stop, markers and alarms; and the service's health."""

import asyncio
import time
from contextlib import suppress
from enum import StrEnum
from typing import Final

from fastapi import APIRouter, Request, Response, WebSocket, WebSocketDisconnect
from fastapi.responses import StreamingResponse
from pydantic import Field

from daq.schemas.events import AcknowledgedAlarmsSchema, AcknowledgeRequest, MarkerRequest, MarkerSchema
from daq.schemas.live import LiveSchema, live_schema
from daq.schemas.runs import RunId
from daq.schemas.snapshot import LiveCurvesSchema, live_curves_schema
from daq.schemas.units import Schema
from daq.service.http_semantics import BODY_PROBLEMS, JsonRoute, event_stream
from daq.service.problems import ProblemError, ProblemType, problem_response, problems
from daq.service.state import LiveStream, ServiceState, State
from daq.session.live_update import LiveUpdate, RunState
from recordings.errors import RecordingError

SUBPROTOCOL: Final = "rig.live"

router = APIRouter(tags=["live"], route_class=JsonRoute)
health_router = APIRouter(tags=["service"])


class StopRequest(Schema):
    """Request to stop the current run; it has no fields."""


class StoppingRunSchema(Schema):
    """A run that is stopping."""

    run: RunId


def _latest_update(state: ServiceState) -> LiveUpdate:
    update = state.live.latest()
    if update is None:
        raise ProblemError(ProblemType.NO_LIVE_RUN, "nothing is recorded or replayed now")
    return update


@router.get("/live", summary="Current values of the run in progress", responses=problems(ProblemType.NO_LIVE_RUN))
async def get_live_run(state: State) -> LiveSchema:
    """Return measured values, the model's prediction and the state of the recording; cheap enough for polling.

    After a run's end its last values stay, with `state` finished or failed, until the next run starts.
    """
    return live_schema(_latest_update(state))


@router.get("/live/curves", summary="Current orbit and order spectrum", responses=problems(ProblemType.NO_LIVE_RUN))
async def get_live_curves(state: State) -> LiveCurvesSchema:
    """Return the measured and predicted curves of the last complete revolutions."""
    return live_curves_schema(_latest_update(state))


@router.post(
    "/live/stop",
    status_code=202,
    summary="Stop the run in progress",
    responses=problems(ProblemType.NO_LIVE_RUN, *BODY_PROBLEMS),
)
async def stop_run(state: State, _request: StopRequest) -> StoppingRunSchema:
    """Request the end of the run, as Ctrl-C at the bench does; the recording is completed. `/live` shows its state.

    The request body is `{}`, as `application/json`; this prevents requests from other sites' pages.
    """
    run = state.live.stop()
    if run is None:
        raise ProblemError(ProblemType.NO_LIVE_RUN, "no run is in progress")
    return StoppingRunSchema(run=run)


@router.post(
    "/live/markers",
    status_code=201,
    summary="Add a marker at the current time",
    responses=problems(ProblemType.NO_LIVE_RUN, *BODY_PROBLEMS),
)
async def add_marker(state: State, request: MarkerRequest) -> MarkerSchema:
    """Add a marker at the current time to the recording, as a line typed in the terminal does.

    The run's summary lists it. A replayed run takes no markers.
    """
    marker = state.live.add_marker(request.text)
    if marker is None:
        raise ProblemError(ProblemType.NO_LIVE_RUN, "no run is being recorded")
    return marker


@router.post(
    "/live/acknowledge",
    summary="Acknowledge the alarms",
    responses=problems(ProblemType.NO_LIVE_RUN, *BODY_PROBLEMS),
)
async def acknowledge_alarms(state: State, _request: AcknowledgeRequest) -> AcknowledgedAlarmsSchema:
    """Acknowledge the active and latched alarms: ended ones disappear now, others as soon as they end.

    The recording and the summary's markers include the acknowledgement; a replay does not store it. The request
    body is `{}`.
    """
    acknowledged = state.live.acknowledge()
    if acknowledged is None:
        raise ProblemError(ProblemType.NO_LIVE_RUN, "no run is in progress whose alarms could be acknowledged")
    return acknowledged


@router.get(
    "/live/events",
    summary="Live values as server-sent events",
    response_class=StreamingResponse,
    responses={**problems(ProblemType.BUSY), **event_stream("live")},
)
async def stream_live_run(state: State, request: Request) -> Response:
    """Send server-sent events of type `live` with the JSON of `/live` as data, or `null` without a run.

    A slow client skips updates; a comment follows every 15 s without a change. The WebSocket
    `/api/v1/live/socket` sends the same JSON as text messages; if a token is required, a browser names the
    subprotocols `rig.live` and `token.<token>`.
    """
    return state.values.event_response(request, "live", state.values.texts())


@router.get(
    "/live/curves/events",
    summary="Live orbit and order spectrum as server-sent events",
    response_class=StreamingResponse,
    responses={**problems(ProblemType.BUSY), **event_stream("curves")},
)
async def stream_live_curves(state: State, request: Request) -> Response:
    """Send server-sent events of type `curves` with the JSON of `/live/curves` as data, or `null` without a run.

    Up to four times a second; the WebSocket `/api/v1/live/curves/socket` sends the same.
    """
    return state.curves.event_response(request, "curves", state.curves.texts())


@router.websocket("/live/socket")
async def live_run_socket(state: State, socket: WebSocket) -> None:
    """Send the live values as text messages."""
    await _send_updates(socket, state.values)


@router.websocket("/live/curves/socket")
async def live_curves_socket(state: State, socket: WebSocket) -> None:
    """Send the live curves as text messages."""
    await _send_updates(socket, state.curves)


async def _send_updates(socket: WebSocket, stream: LiveStream) -> None:
    """Send each update as a text message until the client is gone."""
    try:
        stream.require_capacity()
    except ProblemError as error:
        await socket.send_denial_response(problem_response(error.problem_type, error.detail, socket.url.path))
        return
    await socket.accept(SUBPROTOCOL if SUBPROTOCOL in socket.scope.get("subprotocols", ()) else None)

    async def send() -> None:
        with suppress(WebSocketDisconnect, ProblemError, RuntimeError):
            async for text in stream.changes(stream.texts()):
                if text:
                    await socket.send_text(text)
            await socket.close(1001)

    sending = asyncio.create_task(send())
    try:
        while True:
            await socket.receive()
    except (WebSocketDisconnect, RuntimeError):  # the client is gone, or the socket is closed
        sending.cancel()
        with suppress(asyncio.CancelledError):
            await sending


class Health(StrEnum):
    """Overall health of the service."""

    GOOD = "good"
    TROUBLE = "trouble"  # the data folder cannot be read, or the current run has failed


class HealthSchema(Schema):
    """Health of the service."""

    health: Health = Field(description="good, or trouble with the reason in `detail`", examples=["good"])
    detail: str = Field(description="Cause of the trouble; empty if there is none", examples=[""])
    version: str = Field(description="Version of the service", examples=["0.1.0"])
    uptime_s: float = Field(description="Time since the start of the service, s", examples=[162.4])
    runs: int | None = Field(
        description="Number of runs in the data folder; null if it cannot be read", examples=[12], ge=0
    )
    live_run: str | None = Field(
        description="Id of the run in progress; null if there is none", examples=["2026-11-24T09-12-07-gj90c"]
    )


@health_router.get("/health", summary="Health of the service", responses=problems(ProblemType.BUSY))
async def get_health(state: State, request: Request) -> HealthSchema:
    """Return the health of data folder and current run; any response shows that the service is up."""
    reasons, runs = [], None
    try:
        runs = len(await state.lookups.run(state.catalogue.runs))
    except RecordingError as error:
        reasons.append(str(error))
    update = state.live.latest()
    if update is not None and update.status.state is RunState.FAILED:
        reasons.append(f"run {update.header.run} failed: {update.status.detail or 'no reason was given'}")
    return HealthSchema(
        health=Health.TROUBLE if reasons else Health.GOOD,
        detail="; ".join(reasons),
        version=request.app.version,
        uptime_s=round(time.monotonic() - state.started_at, 3),
        runs=runs,
        live_run=update.header.run if update is not None and update.status.state.is_active else None,
    )
