"""What happens when the program itself is at fault: the client is told, the log has the rest, the service goes on."""

import logging

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from daq.service.problem_types import Kind
from daq.service.problems import problem_response

logger = logging.getLogger(__name__)


class LastResort:
    """Turns an exception that nobody expected into a problem document and a log entry.

    Parameters
    ----------
    app : ASGI application
        Who may fail.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on; raise only where an answer has been begun."""
        begun = False

        async def send_on(message: Message) -> None:
            nonlocal begun
            begun = True
            await send(message)

        try:
            await self._app(scope, receive, send_on)
        except Exception as error:  # whatever it is, the service must go on for the others
            if begun or scope["type"] != "http":
                raise
            logger.exception("%s %s failed", scope["method"], scope["path"])
            detail = f"{type(error).__name__}; the service's log tells more"
            await problem_response(Kind.INTERNAL, detail, scope["path"])(scope, receive, send)
