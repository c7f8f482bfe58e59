"""Live view of a run in the rerun viewer; rerun is optional and imported when a view is opened."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from daq.errors import ServiceError

if TYPE_CHECKING:
    from daq.view.live_view import LiveView


def open_live_view(
    host: str = "127.0.0.1", web_port: int = 0, grpc_port: int = 0, *, origins: Sequence[str] = ()
) -> "LiveView":
    """Open the live view; see `daq.view.live_view.LiveView` for the parameters.

    Raises
    ------
    ServiceError
        rerun is not installed, or a port is not available.
    """
    try:
        from daq.view.live_view import LiveView  # noqa: PLC0415 - needs rerun, which is optional
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] not in {"rerun", "rerun_bindings"}:
            raise
        raise ServiceError(
            "the live view needs rerun, which is not installed: pip install .[view], or go without the live view"
        ) from error
    return LiveView(host, web_port, grpc_port, origins=origins)
