"""gRPC calls to a device server with deadlines, and the driver's warnings, collected instead of printed."""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, TextIO

import grpc

from daq.config.schema import DeviceSection
from daq.drivers.ni.error_codes import driver_text
from daq.errors import DeviceError, DeviceFault

CHANNEL_OPTIONS = (
    ("grpc.max_receive_message_length", -1),  # a second of samples exceeds gRPC's default limit of 4 MiB
    ("grpc.use_local_subchannel_pool", 1),  # a new connection does not inherit the back-off of a failed one
    ("grpc.enable_http_proxy", 0),  # the server is on the bench's own network
)


@dataclass(frozen=True, slots=True)
class _CallDetails(grpc.ClientCallDetails):
    method: str
    timeout: float
    metadata: Any
    credentials: Any
    wait_for_ready: Any
    compression: Any


class DeadlineInterceptor(grpc.UnaryUnaryClientInterceptor):
    """Gives every gRPC call a deadline; nidaqmx sets none, so that a frozen server would block its client for ever.

    Parameters
    ----------
    base : float
        Time that a call may take, s, in addition to the time-out that it passes to the driver.
    """

    def __init__(self, base: float) -> None:
        self._base = base

    def intercept_unary_unary(
        self, continuation: Callable[[Any, Any], Any], client_call_details: Any, request: object
    ) -> Any:
        """Continue the call with a deadline."""
        driver_timeout = max(0.0, float(getattr(request, "timeout", 0.0)))
        details = _CallDetails(
            client_call_details.method,
            self._base + driver_timeout,
            client_call_details.metadata,
            client_call_details.credentials,
            client_call_details.wait_for_ready,
            client_call_details.compression,
        )
        return continuation(details, request)


_warnings_in_context: ContextVar["DriverWarnings | None"] = ContextVar("driver_warnings", default=None)
_previous_showwarning = warnings.showwarning


class DriverWarnings:
    """Collects the driver's warnings, each code once.

    Python would print them to the operator's screen, some of them at every read.

    Parameters
    ----------
    category : type of Warning
        The driver's class of warnings, which have an `error_code`.
    """

    def __init__(self, category: type[Warning]) -> None:
        self.category = category
        self._texts: dict[int, str] = {}
        self._n_taken = 0

    @contextmanager
    def collected(self) -> Iterator[None]:
        """Collect the warnings that the driver issues in this block and thread."""
        _install_showwarning()
        token = _warnings_in_context.set(self)
        try:
            yield
        finally:
            _warnings_in_context.reset(token)

    def add(self, warning: Any) -> None:
        """Add a warning."""
        code = int(warning.error_code)
        text = str(warning).removeprefix(f"\nWarning {code} occurred.\n\n")
        self._texts.setdefault(code, f"the driver warns: {driver_text(text)} (driver code {code})")

    def take_new(self) -> list[str]:
        """Return the warnings added since the last call."""
        texts = list(self._texts.values())[self._n_taken :]
        self._n_taken += len(texts)
        return texts


def _install_showwarning() -> None:
    """Make this module's function the one that shows warnings, even if another has been installed since."""
    global _previous_showwarning  # noqa: PLW0603 - Python has one function that shows warnings
    if warnings.showwarning is not _showwarning:
        _previous_showwarning = warnings.showwarning
        warnings.showwarning = _showwarning


def _showwarning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    collector = _warnings_in_context.get()
    if collector is not None and isinstance(message, collector.category):
        collector.add(message)
    else:
        _previous_showwarning(message, category, filename, lineno, file, line)


def open_channel(section: DeviceSection) -> grpc.Channel:
    """Return the channel to a device server, every call of which has a deadline."""
    plain = grpc.insecure_channel(section.target, options=CHANNEL_OPTIONS)
    timed: grpc.Channel = grpc.intercept_channel(plain, DeadlineInterceptor(section.deadline_s))
    return timed


def server_error(section: DeviceSection, code: grpc.StatusCode, description: str, error: Exception) -> DeviceError:
    """Return the error for a failed call to a device server, with its status code and description."""
    server = f"device server {section.target}"
    deadline = f"{section.deadline_s:g} s"
    if code == grpc.StatusCode.DEADLINE_EXCEEDED:
        return DeviceError(DeviceFault.TIMEOUT, f"{server} did not respond within its deadline of {deadline}")
    if code == grpc.StatusCode.UNAVAILABLE:
        return DeviceError(
            DeviceFault.MISSING,
            f"{server} cannot be reached (deadline {deadline}): is it running, is the network up?",
        )
    if code == grpc.StatusCode.UNIMPLEMENTED:
        return DeviceError(DeviceFault.DRIVER, f"{server} is too old: {description}")
    return DeviceError(DeviceFault.OTHER, f"{server}: {error}")
