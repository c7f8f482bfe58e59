"""The connection to NI-DAQmx on this machine or at a device server: deadlines, error translation, warnings, tasks."""

import datetime as dt
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, TextIO

import grpc
from nidaqmx.constants import TaskMode
from nidaqmx.error_codes import DAQmxErrors
from nidaqmx.errors import DaqError, DaqFunctionNotSupportedError, DaqNotFoundError, DaqWarning, Error, RpcError
from nidaqmx.grpc_session_options import GrpcSessionOptions, SessionInitializationBehavior
from nidaqmx.system.device import Device
from nidaqmx.system.system import System
from nidaqmx.task import Task

from daq.config.schema import DeviceSection
from daq.drivers.ni.devices import FoundDevice
from daq.drivers.ni.error_codes import BUSY_CODES, device_fault, driver_text, operator_message
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
    """

    def __init__(self) -> None:
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

    def add(self, warning: DaqWarning) -> None:
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
    if collector is not None and isinstance(message, DaqWarning):
        collector.add(message)
    else:
        _previous_showwarning(message, category, filename, lineno, file, line)


class Connection:
    """The driver that `[device]` names: on this machine, or at a device server.

    Parameters
    ----------
    section : DeviceSection
        Location of the driver, and the card.
    """

    def __init__(self, section: DeviceSection) -> None:
        self._section = section
        self._channel = _channel(section) if section.target else None
        self.warnings = DriverWarnings()

    @property
    def location(self) -> str:
        """Location of the driver, to be appended to a message; empty on this machine."""
        return f" at device server {self._section.target}" if self._section.target else ""

    def system(self) -> System:
        """Return nidaqmx's object for the driver."""
        return System(self._options(""))

    def find_card(self, system: System) -> Device:
        """Return the card that `[device]` names; DeviceError if it is not connected."""
        section = self._section
        devices: list[Device] = list(system.devices)
        for device in devices:
            if section.serial:
                matches = f"{device.serial_num:X}" == section.serial.upper().removeprefix("0X").lstrip("0")
            else:
                matches = device.name.casefold() == section.name.casefold()
            if matches and device.product_type.startswith(section.product):
                return device
        identity = f"serial number {section.serial}" if section.serial else f"name {section.name}"
        there = ", ".join(f"{d.name}: {d.product_type}, serial number {d.serial_num:X}" for d in devices) or "no device"
        raise DeviceError(
            DeviceFault.MISSING,
            f"no {section.product} with {identity} is connected{self.location}; connected: {there}. "
            "Check its supply (an unpowered card is not listed) and its USB cable",
        )

    def temporary_task(self) -> Task:
        """Return a new task that the server closes when its client ends."""
        return Task(grpc_options=self._options(""))

    def acquisition_task(self, card: str, part: str = "", *, abandoned_after: float) -> Task:
        """Return a new task for an acquisition.

        At a server it has a fixed name. So the task of a client that died can be found and cleared.

        Parameters
        ----------
        card : str
            The driver's name of the card.
        part : str
            Suffix of the name of a further task.
        abandoned_after : float
            Time without a read after which an existing task counts as abandoned, s; 0 if it is known to be.

        Raises
        ------
        DeviceError
            Another client is reading a task of this name.
        """
        if self._channel is None:
            return Task()
        name = f"rig-{card}{part}"
        self._clear_leftover(name, card, abandoned_after)
        fresh = self._options(name, SessionInitializationBehavior.INITIALIZE_SERVER_SESSION)
        try:
            return Task(name, grpc_options=fresh)
        except Error:
            self._clear_leftover(name, card, abandoned_after)
            raise

    @contextmanager
    def errors_translated(self) -> Iterator[None]:
        """Translate nidaqmx's errors in this block to `DeviceError`, and collect the driver's warnings."""
        section = self._section
        try:
            with self.warnings.collected():
                yield
        except DaqError as error:
            code = int(error.error_code)
            fault = device_fault(code, known=error.error_type is not DAQmxErrors.UNKNOWN)
            raise DeviceError(fault, f"{section.product}: {operator_message(code, str(error))}", code) from error
        except RpcError as error:
            raise _server_error(section, error) from error
        except DaqNotFoundError as error:
            raise DeviceError(
                DeviceFault.DRIVER,
                "the NI-DAQmx driver is not installed on this machine: install NI-DAQmx from ni.com/downloads, or set "
                "device.target to the host:port of a device server",
            ) from error
        except DaqFunctionNotSupportedError as error:
            raise DeviceError(
                DeviceFault.DRIVER,
                f"the NI-DAQmx driver on this machine is too old: install a newer one ({' '.join(str(error).split())})",
            ) from error
        except (Error, OSError) as error:  # not for this platform, or not loadable
            raise DeviceError(DeviceFault.DRIVER, f"NI-DAQmx: {' '.join(str(error).split())}") from error

    def close(self) -> None:
        """Close the connection to the server; may be called twice."""
        if self._channel is not None:
            self._channel.close()

    def devices(self) -> list[FoundDevice]:
        """Return the devices that the driver lists."""
        with self.errors_translated():
            system = self.system()
            return [
                FoundDevice(
                    name=str(device.name),
                    product=str(device.product_type),
                    serial=f"{device.serial_num:X}",
                    simulated=bool(device.is_simulated),
                    busy=self._is_busy(device),
                    driver=self.driver(system),
                )
                for device in system.devices
            ]

    def driver(self, system: System) -> str:
        """Return name, version and location of the driver."""
        return "NI-DAQmx " + ".".join(str(part) for part in system.driver_version) + self.location

    def self_test(self) -> dt.date | None:
        """Run the card's self-test; return the date of its last self-calibration, None if unknown."""
        with self.errors_translated():
            device = self.find_card(self.system())
            device.self_test_device()
            try:
                calibrated: dt.datetime = device.self_cal_last_date_and_time
            except (DaqError, ValueError):  # not supported, or never done: no such date
                return None
        return calibrated.date()

    def _is_busy(self, device: Device) -> bool | None:
        """Return whether another acquisition holds the device; None if it has no analog input to reserve."""
        with self.temporary_task() as task:
            try:
                task.ai_channels.add_ai_voltage_chan(f"{device.name}/ai0")
                task.control(TaskMode.TASK_COMMIT)
            except DaqError as error:
                return True if error.error_code in BUSY_CODES else None
        return False

    def _options(
        self, name: str, behavior: SessionInitializationBehavior = SessionInitializationBehavior.AUTO
    ) -> GrpcSessionOptions | None:
        if self._channel is None:
            return None
        return GrpcSessionOptions(self._channel, name, initialization_behavior=behavior)

    def _clear_leftover(self, name: str, card: str, abandoned_after: float) -> None:
        """Clear a task that a dead client left on the server; DeviceError if another client is reading it."""
        try:
            leftover = Task(
                name, grpc_options=self._options(name, SessionInitializationBehavior.ATTACH_TO_SERVER_SESSION)
            )
        except Error:
            return  # there is none; an error of the server is reported when the new task is created
        if abandoned_after:
            position = _position(leftover)
            time.sleep(abandoned_after)
            if _position(leftover) != position:
                raise DeviceError(
                    DeviceFault.BUSY, f"another recording is reading {card}{self.location}: stop it there"
                )
        leftover.close()


def _channel(section: DeviceSection) -> grpc.Channel:
    plain = grpc.insecure_channel(section.target, options=CHANNEL_OPTIONS)
    timed: grpc.Channel = grpc.intercept_channel(plain, DeadlineInterceptor(section.deadline_s))
    return timed


def _server_error(section: DeviceSection, error: RpcError) -> DeviceError:
    server = f"device server {section.target}"
    deadline = f"{section.deadline_s:g} s"
    if error.rpc_code == grpc.StatusCode.DEADLINE_EXCEEDED:
        return DeviceError(DeviceFault.TIMEOUT, f"{server} did not respond within its deadline of {deadline}")
    if error.rpc_code == grpc.StatusCode.UNAVAILABLE:
        return DeviceError(
            DeviceFault.MISSING,
            f"{server} cannot be reached (deadline {deadline}): is it running, is the network up?",
        )
    if error.rpc_code == grpc.StatusCode.UNIMPLEMENTED:
        return DeviceError(DeviceFault.DRIVER, f"{server} is too old: {error.description}")
    return DeviceError(DeviceFault.OTHER, f"{server}: {error}")


def _position(task: Task) -> int | None:
    try:
        return int(task.in_stream.curr_read_pos)
    except DaqError:
        return None  # the task is not running
