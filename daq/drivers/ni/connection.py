"""The way to NI-DAQmx, here or at a device server, with a deadline for every call; its errors become `DeviceError`."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import grpc
from nidaqmx.error_codes import DAQmxErrors
from nidaqmx.errors import DaqError, DaqFunctionNotSupportedError, DaqNotFoundError, Error, RpcError
from nidaqmx.grpc_session_options import GrpcSessionOptions, SessionInitializationBehavior
from nidaqmx.system.device import Device
from nidaqmx.system.system import System
from nidaqmx.task import Task

from daq.config.schema import DeviceSection
from daq.drivers.ni.driver_warnings import Warned
from daq.drivers.ni.error_codes import bench_words, device_fault
from daq.errors import DeviceError, DeviceFault

CHANNEL_OPTIONS = (
    ("grpc.max_receive_message_length", -1),  # a second of samples is more than the 4 MiB that gRPC would take
    ("grpc.use_local_subchannel_pool", 1),  # a new opening tries anew, it does not inherit the last one's back-off
    ("grpc.enable_http_proxy", 0),  # the server stands on the bench's own network
)


@dataclass(frozen=True, slots=True)
class _CallDetails(grpc.ClientCallDetails):
    method: str
    timeout: float
    metadata: Any
    credentials: Any
    wait_for_ready: Any
    compression: Any


class Deadline(grpc.UnaryUnaryClientInterceptor):
    """Give every call a deadline: nidaqmx sets none, and a frozen server would hold its client for ever.

    Parameters
    ----------
    base : float
        Time that a call may take, s, beyond the time-out that it asks the driver for.
    """

    def __init__(self, base: float) -> None:
        self._base = base

    def intercept_unary_unary(
        self, continuation: Callable[[Any, Any], Any], client_call_details: Any, request: object
    ) -> Any:
        """Pass the call on, with its deadline."""
        asked = max(0.0, float(getattr(request, "timeout", 0.0)))
        details = _CallDetails(
            client_call_details.method,
            self._base + asked,
            client_call_details.metadata,
            client_call_details.credentials,
            client_call_details.wait_for_ready,
            client_call_details.compression,
        )
        return continuation(details, request)


class Connection:
    """The driver that a section of rig.toml names: on this machine, or at a device server.

    Parameters
    ----------
    section : DeviceSection
        Where the driver is, and which card is meant.
    """

    def __init__(self, section: DeviceSection) -> None:
        self._section = section
        self._channel = _channel(section) if section.target else None
        self.warned = Warned()

    @property
    def where(self) -> str:
        """Where the driver is, to be added to what is said of it; empty on this machine."""
        return f" at device server {self._section.target}" if self._section.target else ""

    def system(self) -> System:
        """Return the driver itself."""
        return System(self._options(""))

    def device(self, system: System) -> Device:
        """Return the card that is meant; DeviceError where it is not connected."""
        section = self._section
        devices: list[Device] = list(system.devices)
        for device in devices:
            if section.serial:
                bound = f"{device.serial_num:X}" == section.serial.upper().removeprefix("0X").lstrip("0")
            else:
                bound = device.name.casefold() == section.name.casefold()
            if bound and device.product_type.startswith(section.product):
                return device
        binding = f"serial number {section.serial}" if section.serial else f"name {section.name}"
        there = ", ".join(f"{d.name}: {d.product_type}, serial number {d.serial_num:X}" for d in devices) or "no device"
        raise DeviceError(
            DeviceFault.MISSING,
            f"no {section.product} of {binding} is connected{self.where}; there is {there}. "
            "Check its supply (it is not listed without) and its USB cable",
        )

    def task(self) -> Task:
        """Return a new task that ends with its client."""
        return Task(grpc_options=self._options(""))

    def lasting_task(self, card: str, part: str = "", *, abandoned_after: float) -> Task:
        """Return a new task for an acquisition.

        At a server it has a fixed name, so that what a client that died has left there can be found and cleared.

        Parameters
        ----------
        card : str
            The driver's name of the card.
        part : str
            What of it the task is for, where it is not the only one.
        abandoned_after : float
            Time without a read after which a leftover belongs to nobody, s; 0 where it is known to.

        Raises
        ------
        DeviceError
            Another client reads a task of this name.
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
    def translated(self) -> Iterator[None]:
        """Make the errors of nidaqmx in its block those of this program, and keep what the driver warns of."""
        section = self._section
        try:
            with self.warned.hearing():
                yield
        except DaqError as error:
            code = int(error.error_code)
            fault = device_fault(code, known=error.error_type is not DAQmxErrors.UNKNOWN)
            raise DeviceError(fault, f"{section.product}: {bench_words(code, str(error))}", code) from error
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
        """Close the connection to the server; harmless when closed."""
        if self._channel is not None:
            self._channel.close()

    def _options(
        self, name: str, behavior: SessionInitializationBehavior = SessionInitializationBehavior.AUTO
    ) -> GrpcSessionOptions | None:
        if self._channel is None:
            return None
        return GrpcSessionOptions(self._channel, name, initialization_behavior=behavior)

    def _clear_leftover(self, name: str, card: str, abandoned_after: float) -> None:
        """Clear the task that a client which died has left on the server; one that is read is another's."""
        try:
            leftover = Task(
                name, grpc_options=self._options(name, SessionInitializationBehavior.ATTACH_TO_SERVER_SESSION)
            )
        except Error:
            return  # there is none, or what is wrong with the server will be said when the task is made
        if abandoned_after:
            position = _position(leftover)
            time.sleep(abandoned_after)
            if _position(leftover) != position:
                raise DeviceError(DeviceFault.BUSY, f"another recording is reading {card}{self.where}: stop it there")
        leftover.close()


def _channel(section: DeviceSection) -> grpc.Channel:
    plain = grpc.insecure_channel(section.target, options=CHANNEL_OPTIONS)
    timed: grpc.Channel = grpc.intercept_channel(plain, Deadline(section.deadline_s))
    return timed


def _server_error(section: DeviceSection, error: RpcError) -> DeviceError:
    server = f"device server {section.target}"
    deadline = f"{section.deadline_s:g} s"
    if error.rpc_code == grpc.StatusCode.DEADLINE_EXCEEDED:
        return DeviceError(DeviceFault.TIMEOUT, f"{server} did not answer within its deadline of {deadline}")
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
        return None  # it does not run
