"""Following the live run instead of asking again and again: as events, or over a WebSocket.

Starting a run, ending it, and naming its moments.
"""

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
    """Who can end the run that is under way."""

    def stop(self) -> str | None:
        """Ask for its end; return its id, None where no run is under way."""
        ...

    def add_marker(self, text: str) -> MarkerSchema | None:
        """Name the present moment of the run that is recorded; None where none is."""
        ...

    def acknowledge(self) -> AcknowledgedAlarmsSchema | None:
        """Take note of the alarms of the run that is shown; None where none is."""
        ...


class RunStarter(Protocol):
    """Who starts runs, one at a time."""

    @property
    def rigs(self) -> tuple[str, ...]:
        """Names of the rigs that may be chosen."""
        ...

    def start(self, rig: str, note: str, duration: float | None) -> RunHeader:
        """Begin a run and return its header once samples come; RigError where it cannot be."""
        ...


class RunControlRoutes:
    """The beginning of a run, its end, and what is said to it.

    Parameters
    ----------
    run_control : RunControl or None
        Who can end it; None: nobody here.
    run_starter : RunStarter or None
        Who can start one; None: nobody here.
    """

    def __init__(self, run_control: RunControl | None, run_starter: RunStarter | None) -> None:
        self._run_starter = run_starter
        self._starting = BoundedThreadPool(threads=1, waiting=0)
        self._run_control = run_control

    def add_to(self, routing: Routing) -> None:
        """Add the routes."""
        if self._run_control is not None:
            routing.add(
                "POST /live/stop",
                self.stop,
                "stop_run",
                "live",
                "End the run under way",
                ProblemType.NO_LIVE_RUN,
                status=202,
            )
            routing.add(
                "POST /live/markers",
                self.add_marker,
                "add_marker",
                "live",
                "Name this moment of the run under way",
                ProblemType.NO_LIVE_RUN,
                status=201,
            )
            routing.add(
                "POST /live/acknowledge",
                self.acknowledge,
                "acknowledge_alarms",
                "live",
                "Take note of the alarms",
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

    async def start(self, order: StartRequest, response: Response) -> StartedRunSchema:
        """Start a run with a rig that the service was started with, and answer when samples come, which takes seconds.

        One run goes at a time. `/live` follows it, `/live/stop` ends it, and so does the service's own end.
        """
        if self._run_starter is None:
            raise ProblemError(ProblemType.RUN_CANNOT_START, "this service starts no runs")
        rig = order.rig or self._run_starter.rigs[0]
        if rig not in self._run_starter.rigs:
            raise ProblemError(
                ProblemType.RUN_CANNOT_START, f"rig: {rig!r}, expected one of {', '.join(self._run_starter.rigs)}"
            )
        try:
            header = await self._starting.run(partial(self._run_starter.start, rig, order.note, order.duration_s))
        except RigError as error:
            raise ProblemError(ProblemType.RUN_CANNOT_START, str(error)) from error
        response.headers["Location"] = f"/api/v1/runs/{header.run}"
        return StartedRunSchema(run=header.run, rig=header.rig, started_at=utc_time(header.started_ns))

    async def stop(self, _order: StopRequest) -> StoppingRunSchema:
        """Ask for the end, as Ctrl-C at the bench does: the file is finished and kept. `/live` tells when that is done.

        What is sent is `{}`, as `application/json`; pages of other sites are turned away.
        """
        run = None if self._run_control is None else self._run_control.stop()
        if run is None:
            raise ProblemError(ProblemType.NO_LIVE_RUN, "no run is under way")
        return StoppingRunSchema(run=run)

    async def add_marker(self, order: MarkerRequest) -> MarkerSchema:
        """Keep a word on this moment in the recording, as a line typed at the command's terminal does.

        It is in the run's summary when the run has ended. A run that is replayed takes none.
        """
        made = None if self._run_control is None else self._run_control.add_marker(order.text)
        if made is None:
            raise ProblemError(ProblemType.NO_LIVE_RUN, "no run is being recorded")
        return made

    async def acknowledge(self, _order: AcknowledgeRequest) -> AcknowledgedAlarmsSchema:
        """Take note of the alarms in sight: those that are over go, those that last stay until they are over.

        It is kept in the recording and told among the summary's markers; a replay forgets it. What is sent is `{}`.
        """
        noted = None if self._run_control is None else self._run_control.acknowledge()
        if noted is None:
            raise ProblemError(ProblemType.NO_LIVE_RUN, "there is no run whose alarms could be acknowledged")
        return noted


PROTOCOL: Final = "rig.live"
CURVES_INTERVAL: Final = 0.25  # s


class LiveStreamRoutes:
    """The live run's values and its picture, whenever they change.

    Parameters
    ----------
    live : LiveFeed
        The run under way.
    """

    def __init__(self, live: LiveFeed) -> None:
        self._values = _Followed(LiveBroadcaster(live, live_schema), "live")
        self._curves = _Followed(LiveBroadcaster(live, live_curves_schema, CURVES_INTERVAL), "curves")

    def add_to(self, routing: Routing) -> None:
        """Add the routes."""
        routing.add(
            "/live/events",
            self.events,
            "stream_live_run",
            "live",
            "The run under way, whenever it changes",
            ProblemType.BUSY,
            responses=event_stream("live"),
        )
        routing.router.add_api_websocket_route("/live/socket", self._values.socket, name="live_run_socket")
        routing.add(
            "/live/curves/events",
            self.curves_events,
            "stream_live_curves",
            "live",
            "Orbit and order spectrum, whenever they change",
            ProblemType.BUSY,
            responses=event_stream("curves"),
        )
        routing.router.add_api_websocket_route("/live/curves/socket", self._curves.socket, name="live_curves_socket")

    async def events(self, request: Request) -> Response:
        """Send server-sent events of type `live` whose data is the document of `/live`, or `null` without a run.

        A client that is slow is sent the newest and not all between; every 15 s without news comes a comment. The
        WebSocket `/api/v1/live/socket` sends the same documents as text messages; where a token is needed, a browser
        names the subprotocols `rig.live` and `token.<token>`.
        """
        return self._values.events(request)

    async def curves_events(self, request: Request) -> Response:
        """Send server-sent events of type `curves` whose data is the document of `/live/curves`, or `null`.

        Up to four times a second; the WebSocket `/api/v1/live/curves/socket` sends the same.
        """
        return self._curves.events(request)

    def close_streams(self) -> None:
        """Let all who follow go."""
        self._values.close()
        self._curves.close()


class _Followed:
    """What a hub tells, as answers.

    Parameters
    ----------
    hub : Hub
        Who looks at the run.
    name : str
        Of the events.
    """

    def __init__(self, hub: LiveBroadcaster, name: str) -> None:
        self._hub = hub
        self._name = name
        self.close = hub.close

    def events(self, request: Request) -> Response:
        """Return the stream of events."""
        self._hub.require_capacity()
        if request.scope.get("rig.head"):
            return Response(media_type=EVENT_STREAM)
        return StreamingResponse(self._events(), media_type=EVENT_STREAM, headers={"X-Accel-Buffering": "no"})

    async def _events(self) -> AsyncIterator[str]:
        with suppress(ProblemError):  # the last place was taken in between: the stream ends, and the client comes again
            async for text in self._hub.updates():
                yield f"event: {self._name}\ndata: {text}\n\n" if text else ": still here\n\n"

    async def socket(self, socket: WebSocket) -> None:
        """Send the live document as text whenever it changes."""
        try:
            self._hub.require_capacity()
        except ProblemError as error:
            await socket.send_denial_response(problem_response(error.problem_type, error.detail, socket.url.path))
            return
        await socket.accept(PROTOCOL if PROTOCOL in socket.scope.get("subprotocols", ()) else None)
        sending = asyncio.create_task(self._send(socket))
        try:
            while True:
                await socket.receive()
        except (WebSocketDisconnect, RuntimeError):  # gone, or told so already
            sending.cancel()
            with suppress(asyncio.CancelledError):
                await sending

    async def _send(self, socket: WebSocket) -> None:
        with suppress(WebSocketDisconnect, ProblemError, RuntimeError):
            async for text in self._hub.updates():
                if text:
                    await socket.send_text(text)
            await socket.close(1001)
