"""Following the live run instead of asking again and again: as events, or over a WebSocket."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import suppress
from typing import Final

from fastapi import Request, Response, WebSocket, WebSocketDisconnect
from fastapi.responses import StreamingResponse

from daq.schemas import live_document, picture_document
from daq.service.hub import Hub
from daq.service.live_run import Live
from daq.service.problem_types import Kind
from daq.service.problems import ProblemError, problem_response
from daq.service.routing import EVENTS, Routing, event_stream

PROTOCOL: Final = "rig.live"
PICTURE_INTERVAL: Final = 0.25  # s


class FollowingRoutes:
    """The live run's values and its picture, whenever they change.

    Parameters
    ----------
    live : Live
        The run under way.
    """

    def __init__(self, live: Live) -> None:
        self._values = _Followed(Hub(live, live_document), "live")
        self._picture = _Followed(Hub(live, picture_document, PICTURE_INTERVAL), "picture")

    def add_to(self, routing: Routing) -> None:
        """Make the addresses known."""
        routing.add(
            "/live/events", self.events, "follow_live", "live", "The run under way, whenever it changes", Kind.BUSY,
            answers=event_stream("live"),
        )  # fmt: skip
        routing.router.add_api_websocket_route("/live/socket", self._values.socket, name="follow_live_socket")
        routing.add(
            "/live/picture/events", self.picture_events, "follow_live_picture", "live",
            "Orbit and order spectrum, whenever they change", Kind.BUSY, answers=event_stream("picture"),
        )  # fmt: skip
        routing.router.add_api_websocket_route(
            "/live/picture/socket", self._picture.socket, name="follow_live_picture_socket"
        )

    async def events(self, request: Request) -> Response:
        """Send server-sent events of type `live` whose data is the document of `/live`, or `null` without a run.

        A client that is slow is sent the newest and not all between; every 15 s without news comes a comment. The
        WebSocket `/api/v1/live/socket` sends the same documents as text messages; where a token is needed, a browser
        names the subprotocols `rig.live` and `token.<token>`.
        """
        return self._values.events(request)

    async def picture_events(self, request: Request) -> Response:
        """Send server-sent events of type `picture` whose data is the document of `/live/picture`, or `null`.

        Up to four times a second; the WebSocket `/api/v1/live/picture/socket` sends the same.
        """
        return self._picture.events(request)

    def end(self) -> None:
        """Let all who follow go."""
        self._values.end()
        self._picture.end()


class _Followed:
    """What a hub tells, as answers.

    Parameters
    ----------
    hub : Hub
        Who looks at the run.
    name : str
        Of the events.
    """

    def __init__(self, hub: Hub, name: str) -> None:
        self._hub = hub
        self._name = name
        self.end = hub.end

    def events(self, request: Request) -> Response:
        """Return the stream of events."""
        self._hub.require_room()
        if request.scope.get("rig.head"):
            return Response(media_type=EVENTS)
        return StreamingResponse(self._events(), media_type=EVENTS, headers={"X-Accel-Buffering": "no"})

    async def _events(self) -> AsyncIterator[str]:
        with suppress(ProblemError):  # the last place was taken in between: the stream ends, and the client comes again
            async for text in self._hub.moments():
                yield f"event: {self._name}\ndata: {text}\n\n" if text else ": still here\n\n"

    async def socket(self, socket: WebSocket) -> None:
        """Send the live document as text whenever it changes."""
        try:
            self._hub.require_room()
        except ProblemError as error:
            await socket.send_denial_response(problem_response(error.kind, error.detail, socket.url.path))
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
            async for text in self._hub.moments():
                if text:
                    await socket.send_text(text)
            await socket.close(1001)
