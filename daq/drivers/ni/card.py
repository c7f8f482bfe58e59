"""The driver and the card through nidaqmx: its analog inputs and its counter, configured, started, read and released.

This is the only module that imports nidaqmx.
"""

import datetime as dt
import math
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress

import grpc
import numpy as np
from nidaqmx import errors
from nidaqmx.constants import AcquisitionType, TaskMode, TerminalConfiguration, TriggerType
from nidaqmx.constants import Edge as NiEdge
from nidaqmx.error_codes import DAQmxErrors
from nidaqmx.grpc_session_options import GrpcSessionOptions, SessionInitializationBehavior
from nidaqmx.stream_readers import AnalogUnscaledReader, CounterReader
from nidaqmx.system.device import Device
from nidaqmx.system.system import System
from nidaqmx.task import Task
from nidaqmx.task.channels import AIChannel
from numpy.typing import NDArray

from analysis.signals.header import Acquisition, Channel, Edge, Role, TachoCounter
from analysis.signals.header import Device as DeviceRecord
from daq.config.devices import device_spec
from daq.config.rig import Rig
from daq.config.schema import ChannelSection, DeviceSection, RigConfig
from daq.drivers.ni import error_codes
from daq.drivers.ni.device_server import DriverWarnings, open_channel, server_error
from daq.drivers.source import FoundDevice
from daq.errors import DeviceError, DeviceFault

READ_MARGIN = 1.0  # s in addition to a block's duration before a read times out
ABANDONED_AFTER = 1.5  # s without a read after which an existing acquisition at a server counts as abandoned
PULSE_RATE_MARGIN = 4.0  # times the pulse rate at full speed that is provided for: doubled edges, overspeed
MIN_STAMPS = 64  # of the counter's buffers

TERMINALS = {
    "differential": TerminalConfiguration.DIFF,
    "rse": TerminalConfiguration.RSE,
    "nrse": TerminalConfiguration.NRSE,
}
EDGES = {Edge.RISING: NiEdge.RISING, Edge.FALLING: NiEdge.FALLING}
CLOSED = "the card has been closed"


class Connection:
    """The driver that `[device]` names: on this machine, or at a device server.

    Parameters
    ----------
    section : DeviceSection
        Location of the driver, and the card.
    """

    def __init__(self, section: DeviceSection) -> None:
        self._section = section
        self._channel: grpc.Channel | None = open_channel(section) if section.target else None
        self._location = f" at device server {section.target}" if section.target else ""  # for messages
        self.warnings = DriverWarnings(errors.DaqWarning)

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
            f"no {section.product} with {identity} is connected{self._location}; connected: {there}. "
            "Check its supply (an unpowered card is not listed) and its USB cable",
        )

    def acquisition_task(self, card: str, part: str = "", *, abandoned_after: float) -> Task:
        """Return a new task for an acquisition; DeviceError if another client is reading one of this name.

        At a server it has a fixed name, with the suffix `part`, so that the task of a client that died can be found and
        cleared: it has not been read for the time `abandoned_after`, s; 0 if it is known to be abandoned.
        """
        if self._channel is None:
            return Task()
        name = f"rig-{card}{part}"
        self._clear_leftover(name, card, abandoned_after)
        fresh = self._options(name, SessionInitializationBehavior.INITIALIZE_SERVER_SESSION)
        try:
            return Task(name, grpc_options=fresh)
        except errors.Error:
            self._clear_leftover(name, card, abandoned_after)
            raise

    @contextmanager
    def errors_translated(self) -> Iterator[None]:
        """Translate nidaqmx's errors in this block to `DeviceError`, and collect the driver's warnings."""
        section = self._section
        try:
            with self.warnings.collected():
                yield
        except errors.DaqError as error:
            code = int(error.error_code)
            fault = error_codes.device_fault(code, known=error.error_type is not DAQmxErrors.UNKNOWN)
            raise DeviceError(
                fault, f"{section.product}: {error_codes.operator_message(code, str(error))}", code
            ) from error
        except errors.RpcError as error:
            raise server_error(section, error.rpc_code, error.description, error) from error
        except errors.DaqNotFoundError as error:
            raise DeviceError(DeviceFault.DRIVER, error_codes.DRIVER_NOT_INSTALLED) from error
        except errors.DaqFunctionNotSupportedError as error:
            raise DeviceError(
                DeviceFault.DRIVER, f"{error_codes.DRIVER_TOO_OLD} ({' '.join(str(error).split())})"
            ) from error
        except (errors.Error, OSError) as error:  # not for this platform, or not loadable
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
        return "NI-DAQmx " + ".".join(str(part) for part in system.driver_version) + self._location

    def self_test(self) -> dt.date | None:
        """Run the card's self-test; return the date of its last self-calibration, None if unknown."""
        with self.errors_translated():
            device = self.find_card(self.system())
            device.self_test_device()
            try:
                calibrated: dt.datetime = device.self_cal_last_date_and_time
            except (errors.DaqError, ValueError):  # not supported, or never done: no such date
                return None
        return calibrated.date()

    def _is_busy(self, device: Device) -> bool | None:
        """Return whether another acquisition holds the device; None if it has no analog input to reserve."""
        with Task(grpc_options=self._options("")) as task:  # the server closes it when its client ends
            try:
                task.ai_channels.add_ai_voltage_chan(f"{device.name}/ai0")
                task.control(TaskMode.TASK_COMMIT)
            except errors.DaqError as error:
                return True if error.error_code in error_codes.BUSY_CODES else None
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
        except errors.Error:
            return  # there is none; an error of the server is reported when the new task is created
        if abandoned_after:
            position = _position(leftover)
            time.sleep(abandoned_after)
            if _position(leftover) != position:
                where = f"{card}{self._location}"
                raise DeviceError(DeviceFault.BUSY, f"another recording is reading {where}: stop it there")
        leftover.close()


def _position(task: Task) -> int | None:
    try:
        return int(task.in_stream.curr_read_pos)
    except errors.DaqError:
        return None  # the task is not running


class NiCounter:
    """A counter that counts a clock and latches the count at every tacho edge; reserved until its task is closed.

    The analog inputs' start trigger starts the count from 0 at the first sample, so the counter must be started first.

    Parameters
    ----------
    task : Task
        A task without channels; the caller closes it.
    device : str
        The driver's name of the card, as "Dev1".
    counter : TachoCounter
        Counter, line and clock.
    config : RigConfig
        Determines the expected pulse rate.
    """

    def __init__(self, task: Task, device: str, counter: TachoCounter, config: RigConfig) -> None:
        pulse_rate = PULSE_RATE_MARGIN * config.limits.speed_rpm / 60 * config.tacho.pulses_per_revolution
        size = MIN_STAMPS + math.ceil(pulse_rate * config.timing.buffer_s)
        channel = task.ci_channels.add_ci_count_edges_chan(f"{device}/{counter.counter}")
        timebases = device_spec(config.device.product).counter_timebases
        channel.ci_count_edges_term = f"/{device}/{timebases[counter.timebase]}"
        task.timing.cfg_samp_clk_timing(
            pulse_rate,
            source=f"/{device}/{counter.terminal}",
            active_edge=EDGES[counter.edge],
            sample_mode=AcquisitionType.CONTINUOUS,
            samps_per_chan=size,
        )
        task.in_stream.input_buf_size = size
        trigger = task.triggers.arm_start_trigger
        trigger.trig_type = TriggerType.DIGITAL_EDGE
        trigger.dig_edge_src = f"/{device}/ai/StartTrigger"
        trigger.dig_edge_edge = NiEdge.RISING
        task.control(TaskMode.TASK_COMMIT)
        self.task = task
        self._reader = CounterReader(task.in_stream)
        self._reader.verify_array_shape = False
        self._counts = np.empty(MIN_STAMPS + math.ceil(pulse_rate * config.timing.block_s), np.uint32)

    def read(self) -> tuple[NDArray[np.uint32], bool]:
        """Return the unread latched counts without waiting, and whether these were all.

        The read requests a fixed number of counts, because a USB card then sends even a partly filled packet.
        """
        try:
            n = self._reader.read_many_sample_uint32(self._counts, self._counts.size, timeout=0.0)
        except errors.DaqReadError as error:
            if error.error_code != error_codes.NOT_YET_AVAILABLE:
                raise
            n = error.samps_per_chan_read
        return self._counts[:n].copy(), n < self._counts.size


class NiCard:
    """The card with its acquisition configured and committed; reserved until `release`.

    Parameters
    ----------
    rig : Rig
        Determines card, inputs and rate.

    Attributes
    ----------
    acquisition : Acquisition
        The acquisition with its actual settings, read back from the device.
    counter_wrap : int
        Number of ticks after which a count starts again from 0.
    warnings : DriverWarnings
        The driver's warnings.

    Raises
    ------
    DeviceError
        From the constructor, which then leaves nothing reserved, and from every method except `release` and `close`.
        Its code is 0 if the connection failed, not the driver.
    """

    def __init__(self, rig: Rig) -> None:
        self._connection = Connection(rig.config.device)
        self.warnings = self._connection.warnings
        self._task: Task | None = None
        self._counter_task: Task | None = None
        self._counter: NiCounter | None = None
        self._lock = threading.Lock()
        self._closed = False
        self.counter_wrap = device_spec(rig.config.device.product).counter_wrap
        with ExitStack() as undo:
            undo.callback(self.close)
            with self._connection.errors_translated():
                self._system = self._connection.system()
                device = self._connection.find_card(self._system)
                self._name = str(device.name)
                self._task = self._connection.acquisition_task(self._name, abandoned_after=ABANDONED_AFTER)
                self.acquisition = self._configure(self._task, rig, device)
                if rig.tacho.counter is not None:
                    # No wait for another client: this one has already reserved the analog inputs.
                    self._counter_task = self._connection.acquisition_task(self._name, "-counter", abandoned_after=0.0)
                    self._counter = NiCounter(self._counter_task, self._name, rig.tacho.counter, rig.config)
            undo.pop_all()

    def start(self) -> None:
        """Start, also after a `stop`; samples count from 0."""
        with self._locked_task() as task:
            task.start()

    def stop(self) -> None:
        """Stop; the card stays reserved and can be started again."""
        with self._locked_task() as task:
            task.stop()

    def read(self) -> NDArray[np.int16]:
        """Wait for the next block and return its codes, (n_channels, n_samples); a late block may be shorter."""
        with self._locked_task():
            try:
                n = self._reader.read_int16(self._buffer, self._block, self._timeout)
            except errors.DaqReadError as error:
                if error.error_code != error_codes.NOT_YET_AVAILABLE or not error.samps_per_chan_read:
                    raise
                n = error.samps_per_chan_read
        rows = len(self.acquisition.channels)
        return self._buffer[: rows * n].reshape(rows, n).copy()  # the driver packs short reads at the front

    def backlog(self) -> int:
        """Return the number of samples per channel that are acquired but not read."""
        with self._locked_task() as task:
            return int(task.in_stream.avail_samp_per_chan)

    def position(self) -> int:
        """Return the number of samples per channel that the driver has delivered since the start."""
        with self._locked_task() as task:
            return int(task.in_stream.curr_read_pos)

    def acquired(self) -> int:
        """Return the number of samples per channel that the card has acquired since the start."""
        with self._locked_task() as task:
            return int(task.in_stream.total_samp_per_chan_acquired)

    def start_counter(self) -> None:
        """Start the counter, also after `stop_counter`; it begins to count at `start`."""
        with self._locked_counter() as counter:
            counter.task.start()

    def stop_counter(self) -> None:
        """Stop the counter; it stays reserved."""
        with self._locked_counter() as counter:
            counter.task.stop()

    def counts(self) -> tuple[NDArray[np.uint32], bool]:
        """Return the counts latched at tacho edges since the last call, and whether these were all."""
        with self._locked_counter() as counter:
            return counter.read()

    def is_present(self) -> bool:
        """Return whether the card is still connected; only after `release`, because a busy card cannot be tested."""
        try:
            with self._lock, self._connection.errors_translated():
                if self._closed:
                    return True  # unknown
                if self._name not in self._system.devices.device_names:
                    return False
                self._system.devices[self._name].self_test_device()
        except DeviceError as error:
            return error.code not in error_codes.ABSENT_CODES
        return True

    def release(self) -> None:
        """Free the card for other programs, after a read in progress; may be called twice."""
        with self._lock:
            tasks = [each for each in (self._counter_task, self._task) if each is not None]
            self._counter_task = self._task = self._counter = None
            for each in tasks:
                with suppress(errors.Error):  # the card or its server may be gone
                    each.close()

    def close(self) -> None:
        """Release the card and close the connection to it; may be called twice."""
        self.release()
        with self._lock:
            self._closed = True
            self._connection.close()

    def _configure(self, task: Task, rig: Rig, device: Device) -> Acquisition:
        timing = rig.config.timing
        sections = sorted(rig.config.channel, key=lambda section: section.role is Role.TACHO)  # settles last
        inputs: list[AIChannel] = [
            task.ai_channels.add_ai_voltage_chan(
                f"{self._name}/{section.physical}",
                section.name,
                terminal_config=TERMINALS[section.terminal],
                min_val=-section.range_v,
                max_val=section.range_v,
            )
            for section in sections
        ]
        size = math.ceil(timing.rate_hz * timing.buffer_s)
        task.timing.cfg_samp_clk_timing(timing.rate_hz, sample_mode=AcquisitionType.CONTINUOUS, samps_per_chan=size)
        task.in_stream.input_buf_size = size  # samps_per_chan alone only raises the driver's default
        task.control(TaskMode.TASK_COMMIT)  # reserves the card and coerces the settings that are read back below
        rate = float(task.timing.samp_clk_rate)
        self._block = max(1, round(rate * timing.block_s))
        self._timeout = self._block / rate + READ_MARGIN
        self._buffer = np.empty(self._block * len(inputs), np.int16)
        self._reader = AnalogUnscaledReader(task.in_stream)
        self._reader.verify_array_shape = False  # a flat buffer: the rows of a wide one would be misplaced
        return Acquisition(
            device=DeviceRecord(
                backend="nidaqmx",
                product=str(device.product_type),
                serial=f"{device.serial_num:X}",
                driver=self._connection.driver(self._system),
                simulated=bool(device.is_simulated),
            ),
            rate=rate,
            convert_rate=float(task.timing.ai_conv_rate),
            channels=tuple(_channel(rig, *pair) for pair in zip(sections, inputs, strict=True)),
            tacho=rig.tacho,
            buffer=int(task.in_stream.input_buf_size),
        )

    @contextmanager
    def _locked_task(self) -> Iterator[Task]:
        with self._lock, self._connection.errors_translated():
            if self._task is None:
                raise DeviceError(DeviceFault.OTHER, CLOSED)
            yield self._task

    @contextmanager
    def _locked_counter(self) -> Iterator[NiCounter]:
        with self._lock, self._connection.errors_translated():
            if self._counter is None:
                raise DeviceError(DeviceFault.OTHER, CLOSED)
            yield self._counter


def _channel(rig: Rig, section: ChannelSection, channel: AIChannel) -> Channel:
    scaling = tuple(float(term) for term in channel.ai_dev_scaling_coeff)
    if len(scaling) < 2 or scaling[1] == 0:
        message = f"{section.physical}: scaling polynomial {scaling} from the device, expected a slope"
        raise DeviceError(DeviceFault.OTHER, message)
    return rig.channel(section, (float(channel.ai_rng_low), float(channel.ai_rng_high)), scaling)
