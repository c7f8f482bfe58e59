"""Routes of the current run: start, stop, markers, alarms, and its values as server-sent events or over WebSocket."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import suppress
from functools import partial
from typing import Final, Protocol

from fastapi import Request, Response, WebSocket, WebSocketDisconnect
from fastapi.responses import StreamingResponse

from analysis.signals.header import RunHeader
from daq.errors import RigError
from daq.schemas.events import AcknowledgedAlarmsSchema, AcknowledgeRequest, MarkerRequest, MarkerSchema
from daq.schemas.live import live_schema
from daq.schemas.snapshot import live_curves_schema
from daq.schemas.units import utc_time
from daq.service.problem_types import ProblemType
from daq.service.problems import ProblemError, problem_response
from daq.service.routing import EVENT_STREAM, BoundedThreadPool, Routing, event_stream
from daq.service.schemas.runs import StartedRunSchema, StartRequest, StoppingRunSchema, StopRequest
from daq.service.stream import LiveBroadcaster, LiveFeed


class RunControl(Protocol):
    """Control of the current run."""

    def stop(self) -> str | None:
        """Request the end of the run; return its id, None if no run is in progress."""
        ...

    def add_marker(self, text: str) -> MarkerSchema | None:
        """Add a marker at the current time of the recorded run; None if nothing is being recorded."""
        ...

    def acknowledge(self) -> AcknowledgedAlarmsSchema | None:
        """Acknowledge the alarms of the current run; None if there is no run."""
        ...


class RunStarter(Protocol):
    """Starts runs, one at a time."""

    @property
    def rigs(self) -> tuple[str, ...]:
        """Names of the available rigs."""
        ...

    def start(self, rig: str, note: str, duration: float | None) -> RunHeader:
        """Start a run and return its header once samples arrive; RigError if it cannot start."""
        ...


class RunControlRoutes:
    """Routes that start, stop, mark and acknowledge.

    Parameters
    ----------
    run_control : RunControl or None
        Controls the current run; None: no such routes.
    run_starter : RunStarter or None
        Starts runs; None: no such route.
    """

    def __init__(self, run_control: RunControl | None, run_starter: RunStarter | None) -> None:
        self._run_starter = run_starter
        self._start_thread = BoundedThreadPool(threads=1, waiting=0)
        self._run_control = run_control

    def add_to(self, routing: Routing) -> None:
        """Add the routes."""
        if self._run_control is not None:
            routing.add(
                "POST /live/stop",
                self.stop,
                "stop_run",
                "live",
                "Stop the run in progress",
                ProblemType.NO_LIVE_RUN,
                status=202,
            )
            routing.add(
                "POST /live/markers",
                self.add_marker,
                "add_marker",
                "live",
                "Add a marker at the current time",
                ProblemType.NO_LIVE_RUN,
                status=201,
            )
            routing.add(
                "POST /live/acknowledge",
                self.acknowledge,
                "acknowledge_alarms",
                "live",
                "Acknowledge the alarms",
                ProblemType.NO_LIVE_RUN,
            )

        if self._run_starter is not None:
            routing.add(
                "POST /runs",
                self.start,
                "start_run",
                "runs",
                "Start a run",
                ProblemType.RUN_CANNOT_START,
                ProblemType.BUSY,
                ProblemType.STORAGE_UNAVAILABLE,
                status=201,
            )

    async def start(self, request: StartRequest, response: Response) -> StartedRunSchema:
        """Start a run with one of the service's rigs, and respond once samples arrive, which takes seconds.

        Only one run at a time. `/live` returns its values; `/live/stop` or the end of the service stops it.
        """
        if self._run_starter is None:
            raise ProblemError(ProblemType.RUN_CANNOT_START, "this service starts no runs")
        rig = request.rig or self._run_starter.rigs[0]
        if rig not in self._run_starter.rigs:
            raise ProblemError(
                ProblemType.RUN_CANNOT_START, f"rig: {rig!r}, expected one of {', '.join(self._run_starter.rigs)}"
            )
        try:
            header = await self._start_thread.run(
                partial(self._run_starter.start, rig, request.note, request.duration_s)
            )
        except RigError as error:
            raise ProblemError(ProblemType.RUN_CANNOT_START, str(error)) from error
        response.headers["Location"] = f"/api/v1/runs/{header.run}"
        return StartedRunSchema(run=header.run, rig=header.rig, started_at=utc_time(header.started_ns))

    async def stop(self, _request: StopRequest) -> StoppingRunSchema:
        """Request the end of the run, as Ctrl-C at the bench does; the recording is completed. `/live` shows its state.

        The request body is `{}`, as `application/json`; this prevents requests from other sites' pages.
        """
        run = None if self._run_control is None else self._run_control.stop()
        if run is None:
            raise ProblemError(ProblemType.NO_LIVE_RUN, "no run is in progress")
        return StoppingRunSchema(run=run)

    async def add_marker(self, request: MarkerRequest) -> MarkerSchema:
        """Add a marker at the current time to the recording, as a line typed in the terminal does.

        The run's summary lists it. A replayed run takes no markers.
        """
        marker = None if self._run_control is None else self._run_control.add_marker(request.text)
        if marker is None:
            raise ProblemError(ProblemType.NO_LIVE_RUN, "no run is being recorded")
        return marker

    async def acknowledge(self, _request: AcknowledgeRequest) -> AcknowledgedAlarmsSchema:
        """Acknowledge the active and latched alarms: ended ones disappear now, others as soon as they end.

        The recording and the summary's markers include the acknowledgement; a replay does not store it. The request
        body is `{}`.
        """
        acknowledged = None if self._run_control is None else self._run_control.acknowledge()
        if acknowledged is None:
            raise ProblemError(ProblemType.NO_LIVE_RUN, "no run is in progress whose alarms could be acknowledged")
        return acknowledged


SUBPROTOCOL: Final = "rig.live"
CURVES_INTERVAL: Final = 0.25  # s


class LiveStreamRoutes:
    """Routes that stream the current run's values and curves as they change.

    Parameters
    ----------
    live : LiveFeed
        The current run.
    """

    def __init__(self, live: LiveFeed) -> None:
        self._values = _LiveStream(LiveBroadcaster(live, live_schema), "live")
        self._curves = _LiveStream(LiveBroadcaster(live, live_curves_schema, CURVES_INTERVAL), "curves")

    def add_to(self, routing: Routing) -> None:
        """Add the routes."""
        routing.add(
            "/live/events",
            self.events,
            "stream_live_run",
            "live",
            "Live values as server-sent events",
            ProblemType.BUSY,
            responses=event_stream("live"),
        )
        routing.router.add_api_websocket_route("/live/socket", self._values.socket, name="live_run_socket")
        routing.add(
            "/live/curves/events",
            self.curves_events,
            "stream_live_curves",
            "live",
            "Live orbit and order spectrum as server-sent events",
            ProblemType.BUSY,
            responses=event_stream("curves"),
        )
        routing.router.add_api_websocket_route("/live/curves/socket", self._curves.socket, name="live_curves_socket")

    async def events(self, request: Request) -> Response:
        """Send server-sent events of type `live` with the JSON of `/live` as data, or `null` without a run.

        A slow client skips updates; a comment follows every 15 s without a change. The WebSocket
        `/api/v1/live/socket` sends the same JSON as text messages; if a token is required, a browser names the
        subprotocols `rig.live` and `token.<token>`.
        """
        return self._values.events(request)

    async def curves_events(self, request: Request) -> Response:
        """Send server-sent events of type `curves` with the JSON of `/live/curves` as data, or `null` without a run.

        Up to four times a second; the WebSocket `/api/v1/live/curves/socket` sends the same.
        """
        return self._curves.events(request)

    def close_streams(self) -> None:
        """End all streams."""
        self._values.close()
        self._curves.close()


class _LiveStream:
    """Updates of a broadcaster as server-sent events and over WebSocket.

    Parameters
    ----------
    broadcaster : LiveBroadcaster
        Source of the updates.
    name : str
        Type of the events.
    """

    def __init__(self, broadcaster: LiveBroadcaster, name: str) -> None:
        self._broadcaster = broadcaster
        self._name = name
        self.close = broadcaster.close

    def events(self, request: Request) -> Response:
        """Return the event stream."""
        self._broadcaster.require_capacity()
        if request.scope.get("rig.head"):
            return Response(media_type=EVENT_STREAM)
        return StreamingResponse(self._events(), media_type=EVENT_STREAM, headers={"X-Accel-Buffering": "no"})

    async def _events(self) -> AsyncIterator[str]:
        with suppress(ProblemError):  # another client took the last place: the stream ends, the client reconnects
            async for text in self._broadcaster.updates():
                yield f"event: {self._name}\ndata: {text}\n\n" if text else ": keep-alive\n\n"

    async def socket(self, socket: WebSocket) -> None:
        """Send each update as a text message."""
        try:
            self._broadcaster.require_capacity()
        except ProblemError as error:
            await socket.send_denial_response(problem_response(error.problem_type, error.detail, socket.url.path))
            return
        await socket.accept(SUBPROTOCOL if SUBPROTOCOL in socket.scope.get("subprotocols", ()) else None)
        sending = asyncio.create_task(self._send(socket))
        try:
            while True:
                await socket.receive()
        except (WebSocketDisconnect, RuntimeError):  # the client is gone, or the socket is closed
            sending.cancel()
            with suppress(asyncio.CancelledError):
                await sending

    async def _send(self, socket: WebSocket) -> None:
        with suppress(WebSocketDisconnect, ProblemError, RuntimeError):
            async for text in self._broadcaster.updates():
                if text:
                    await socket.send_text(text)
            await socket.close(1001)
