"""HEAD requests: answered as GET, without the content."""

from starlette.types import ASGIApp, Receive, Scope, Send


class HeadAsGet:
    """Hands HEAD on as GET; the server, which knows what was asked, leaves the content out.

    Parameters
    ----------
    app : ASGI application
        Who answers.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on."""
        is_head = scope["type"] == "http" and scope["method"] == "HEAD"
        await self._app({**scope, "method": "GET", "rig.head": True} if is_head else scope, receive, send)
