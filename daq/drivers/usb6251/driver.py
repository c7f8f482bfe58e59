"""The card as NI-DAQmx offers it: the one file that knows nidaqmx and gRPC, where their errors become `DeviceError`."""

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import grpc
import numpy as np
from nidaqmx.constants import AcquisitionType, TaskMode, TerminalConfiguration
from nidaqmx.error_codes import DAQmxErrors
from nidaqmx.errors import DaqError, DaqNotFoundError, DaqReadError, Error, RpcError
from nidaqmx.grpc_session_options import GrpcSessionOptions, SessionInitializationBehavior
from nidaqmx.stream_readers import AnalogUnscaledReader
from nidaqmx.system.device import Device
from nidaqmx.system.system import System
from nidaqmx.task import Task
from nidaqmx.task.channels import AIChannel
from numpy.typing import NDArray

from analysis.run import Acquisition, Channel, Role
from analysis.run import Device as DeviceRecord
from daq.config.rig import Rig
from daq.config.schema import ChannelSection, DeviceSection
from daq.drivers.usb6251.devices import FoundDevice
from daq.drivers.usb6251.faults import ABSENT_CODES, BUSY_CODES, NOT_YET_AVAILABLE, bench_words, device_fault
from daq.errors import DeviceError, DeviceFault

PATIENCE = 1.0  # s that a block may come late before the device is asked what is wrong
ABANDONED_AFTER = 1.5  # s without a read after which a server's leftover acquisition belongs to nobody

TERMINALS = {
    "differential": TerminalConfiguration.DIFF,
    "rse": TerminalConfiguration.RSE,
    "nrse": TerminalConfiguration.NRSE,
}
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


class NiSystem:
    """The driver, here or at a device server, without an acquisition: what is connected and how it is.

    Parameters
    ----------
    section : DeviceSection
        Where the driver is, and which card is meant.

    Raises
    ------
    DeviceError
        From every method but `close`.
    """

    def __init__(self, section: DeviceSection) -> None:
        self._section = section
        self._channel = _channel(section) if section.target else None

    def devices(self) -> list[FoundDevice]:
        """Return what is connected."""
        with _translated(self._section):
            system = self._system()
            version = "NI-DAQmx " + ".".join(str(part) for part in system.driver_version) + _where(self._section)
            return [
                FoundDevice(
                    name=str(device.name),
                    product=str(device.product_type),
                    serial=f"{device.serial_num:X}",
                    simulated=bool(device.is_simulated),
                    busy=self._is_busy(device),
                    driver=version,
                )
                for device in system.devices
            ]

    def self_test(self) -> None:
        """Let the card that is meant test itself; it must be idle."""
        with _translated(self._section):
            _find(self._system(), self._section).self_test_device()

    def close(self) -> None:
        """Close the connection to the server; harmless when closed."""
        if self._channel is not None:
            self._channel.close()

    def _system(self) -> System:
        return System(None if self._channel is None else _session(self._channel, ""))

    def _is_busy(self, device: Device) -> bool | None:
        """Return whether another acquisition holds the device; None where it has no analog input to ask for."""
        options = None if self._channel is None else _session(self._channel, "")
        with Task(grpc_options=options) as task:
            try:
                task.ai_channels.add_ai_voltage_chan(f"{device.name}/ai0")
                task.control(TaskMode.TASK_COMMIT)
            except DaqError as error:
                return True if error.error_code in BUSY_CODES else None
        return False


class NiCard:
    """The card with its acquisition configured and committed: reserved until `release`.

    Parameters
    ----------
    rig : Rig
        Which card, which inputs, how fast.

    Raises
    ------
    DeviceError
        From the constructor, which leaves nothing reserved, and from every method but `release` and `close`. Its code
        is 0 where not the driver but the way to it failed.
    """

    def __init__(self, rig: Rig) -> None:
        self._section = rig.config.device
        self._task: Task | None = None
        self._lock = threading.Lock()
        self._closed = False
        self._channel = _channel(self._section) if self._section.target else None
        with ExitStack() as undo:
            undo.callback(self.close)
            with _translated(self._section):
                remote = _session(self._channel, "") if self._channel is not None else None
                self._system = System(remote)
                device = _find(self._system, self._section)
                self._name = str(device.name)
                self._task = self._new_task()
                self.acquisition = self._configure(self._task, rig, device)
            undo.pop_all()

    def start(self) -> None:
        """Start, or start again after a `stop`: samples count from 0."""
        with self._use() as task:
            task.start()

    def stop(self) -> None:
        """Stop; the card stays reserved and can be started again."""
        with self._use() as task:
            task.stop()

    def read(self) -> NDArray[np.int16]:
        """Wait for the next block and return its codes, (n_channels, n_samples): fewer samples where they came late."""
        with self._use():
            try:
                n = self._reader.read_int16(self._buffer, self._block, self._timeout)
            except DaqReadError as error:
                if error.error_code != NOT_YET_AVAILABLE or not error.samps_per_chan_read:
                    raise
                n = error.samps_per_chan_read
        rows = len(self.acquisition.channels)
        return self._buffer[: rows * n].reshape(rows, n).copy()  # the driver packs short reads at the front

    def backlog(self) -> int:
        """Return the samples per channel that are acquired and not read."""
        with self._use() as task:
            return int(task.in_stream.avail_samp_per_chan)

    def position(self) -> int:
        """Return the samples per channel that the driver has delivered since the start."""
        with self._use() as task:
            return int(task.in_stream.curr_read_pos)

    def acquired(self) -> int:
        """Return the samples per channel that the card has taken since the start."""
        with self._use() as task:
            return int(task.in_stream.total_samp_per_chan_acquired)

    def is_present(self) -> bool:
        """Ask the driver whether the card is still there; only after `release`, for a card at work cannot be tested."""
        try:
            with self._lock, _translated(self._section):
                if self._closed:
                    raise _closed()
                if self._name not in self._system.devices.device_names:
                    return False
                self._system.devices[self._name].self_test_device()
        except DeviceError as error:
            return error.code not in ABSENT_CODES
        return True

    def release(self) -> None:
        """Give the card free for others; harmless when it is, waits for a read in progress."""
        with self._lock:
            task, self._task = self._task, None
            if task is not None:
                with suppress(Error):  # a card that is gone, or its server, cannot be told
                    task.close()

    def close(self) -> None:
        """Release the card and the connection to it; harmless when closed."""
        self.release()
        with self._lock:
            self._closed = True
            if self._channel is not None:
                self._channel.close()

    def _new_task(self) -> Task:
        if self._channel is None:
            return Task()
        name = f"rig-{self._name}"  # a fixed name, so that what a client that died has left can be found and cleared
        self._clear_leftover(self._channel, name)
        fresh = _session(self._channel, name, SessionInitializationBehavior.INITIALIZE_SERVER_SESSION)
        try:
            return Task(name, grpc_options=fresh)
        except Error:
            self._clear_leftover(self._channel, name)
            raise

    def _clear_leftover(self, channel: grpc.Channel, name: str) -> None:
        """Clear the acquisition that a client which died has left on the server; one that is read is another's."""
        try:
            attach = _session(channel, name, SessionInitializationBehavior.ATTACH_TO_SERVER_SESSION)
            leftover = Task(name, grpc_options=attach)
        except Error:
            return  # there is none, or what is wrong with the server will be said when the task is made
        position = _position(leftover)
        time.sleep(ABANDONED_AFTER)
        if _position(leftover) != position:
            raise DeviceError(
                DeviceFault.BUSY, f"another recording is reading {self._name}{_where(self._section)}: stop it there"
            )
        leftover.close()

    def _configure(self, task: Task, rig: Rig, device: Device) -> Acquisition:
        timing = rig.config.timing
        sections = sorted(rig.config.channel, key=lambda section: section.role is Role.TACHO)  # the tacho settles last
        inputs = [self._add(task, section) for section in sections]
        size = math.ceil(timing.rate_hz * timing.buffer_s)
        task.timing.cfg_samp_clk_timing(timing.rate_hz, sample_mode=AcquisitionType.CONTINUOUS, samps_per_chan=size)
        task.in_stream.input_buf_size = size  # samps_per_chan alone only raises the driver's own choice
        task.control(TaskMode.TASK_COMMIT)  # reserves the card, and coerces what is read back below
        rate = float(task.timing.samp_clk_rate)
        self._block = max(1, round(rate * timing.block_s))
        self._timeout = self._block / rate + PATIENCE
        self._buffer = np.empty(self._block * len(inputs), np.int16)
        self._reader = AnalogUnscaledReader(task.in_stream)
        self._reader.verify_array_shape = False  # a flat buffer: the rows of a wide one would be misplaced
        version = self._system.driver_version
        return Acquisition(
            device=DeviceRecord(
                backend="nidaqmx",
                product=str(device.product_type),
                serial=f"{device.serial_num:X}",
                driver="NI-DAQmx " + ".".join(str(part) for part in version) + _where(self._section),
                simulated=bool(device.is_simulated),
            ),
            rate=rate,
            convert_rate=float(task.timing.ai_conv_rate),
            channels=tuple(_channel_record(rig, *pair) for pair in zip(sections, inputs, strict=True)),
            tacho=rig.tacho,
        )

    def _add(self, task: Task, section: ChannelSection) -> AIChannel:
        channel: AIChannel = task.ai_channels.add_ai_voltage_chan(
            f"{self._name}/{section.physical}",
            section.name,
            terminal_config=TERMINALS[section.terminal],
            min_val=-section.range_v,
            max_val=section.range_v,
        )
        return channel

    @contextmanager
    def _use(self) -> Iterator[Task]:
        with self._lock, _translated(self._section):
            if self._task is None:
                raise _closed()
            yield self._task


def _find(system: System, section: DeviceSection) -> Device:
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
        f"no {section.product} of {binding} is connected{_where(section)}; there is {there}. "
        "Check its supply (it is not listed without) and its USB cable",
    )


def _where(section: DeviceSection) -> str:
    return f" at device server {section.target}" if section.target else ""


@contextmanager
def _translated(section: DeviceSection) -> Iterator[None]:
    try:
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
    except (Error, OSError) as error:  # not for this platform, too old for a function, or not loadable
        raise DeviceError(DeviceFault.DRIVER, f"NI-DAQmx: {' '.join(str(error).split())}") from error


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


def _closed() -> DeviceError:
    return DeviceError(DeviceFault.OTHER, "the card has been closed")


def _channel(section: DeviceSection) -> grpc.Channel:
    plain = grpc.insecure_channel(section.target, options=CHANNEL_OPTIONS)
    timed: grpc.Channel = grpc.intercept_channel(plain, Deadline(section.deadline_s))
    return timed


def _position(task: Task) -> int | None:
    try:
        return int(task.in_stream.curr_read_pos)
    except DaqError:
        return None  # it does not run


def _session(
    channel: grpc.Channel,
    name: str,
    behavior: SessionInitializationBehavior = SessionInitializationBehavior.AUTO,
) -> GrpcSessionOptions:
    return GrpcSessionOptions(channel, name, initialization_behavior=behavior)


def _channel_record(rig: Rig, section: ChannelSection, channel: AIChannel) -> Channel:
    scaling = tuple(float(term) for term in channel.ai_dev_scaling_coeff)
    if len(scaling) < 2 or scaling[1] == 0:
        raise DeviceError(
            DeviceFault.OTHER, f"{section.physical}: scaling polynomial {scaling} from the device, expected a slope"
        )
    low, high = section.gap_window_v
    probe = section.role is not Role.TACHO
    return Channel(
        name=section.name,
        role=section.role,
        physical=section.physical,
        range_low=float(channel.ai_rng_low),
        range_high=float(channel.ai_rng_high),
        scaling=scaling,
        calibration=rig.calibrations.get(section.name),
        angle=math.radians(section.angle_deg) if probe else 0.0,
        gap_low=low if probe else -math.inf,
        gap_high=high if probe else math.inf,
    )
