"""The card through nidaqmx: its analog inputs and its counter, configured, started, read and released."""

import math
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress

import numpy as np
from nidaqmx.constants import AcquisitionType, TaskMode, TerminalConfiguration, TriggerType
from nidaqmx.constants import Edge as NiEdge
from nidaqmx.errors import DaqReadError, Error
from nidaqmx.stream_readers import AnalogUnscaledReader, CounterReader
from nidaqmx.system.device import Device
from nidaqmx.task import Task
from nidaqmx.task.channels import AIChannel
from numpy.typing import NDArray

from analysis.signals.header import Acquisition, Channel, Edge, Role, TachoCounter
from analysis.signals.header import Device as DeviceRecord
from daq.config.devices import device_spec
from daq.config.rig import Rig
from daq.config.schema import ChannelSection, RigConfig
from daq.drivers.ni.connection import Connection
from daq.drivers.ni.error_codes import ABSENT_CODES, NOT_YET_AVAILABLE
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
        self._task = task
        self._reader = CounterReader(task.in_stream)
        self._reader.verify_array_shape = False
        self._counts = np.empty(MIN_STAMPS + math.ceil(pulse_rate * config.timing.block_s), np.uint32)

    @property
    def task(self) -> Task:
        """The task that holds the counter."""
        return self._task

    def read(self) -> tuple[NDArray[np.uint32], bool]:
        """Return the unread latched counts without waiting, and whether these were all.

        The read requests a fixed number of counts, because a USB card then sends even a partly filled packet.
        """
        try:
            n = self._reader.read_many_sample_uint32(self._counts, self._counts.size, timeout=0.0)
        except DaqReadError as error:
            if error.error_code != NOT_YET_AVAILABLE:
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

    Raises
    ------
    DeviceError
        From the constructor, which then leaves nothing reserved, and from every method except `release` and `close`.
        Its code is 0 if the connection failed, not the driver.
    """

    def __init__(self, rig: Rig) -> None:
        self._connection = Connection(rig.config.device)
        self._task: Task | None = None
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
                    self._counter = self._create_counter(rig, rig.tacho.counter)
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
            except DaqReadError as error:
                if error.error_code != NOT_YET_AVAILABLE or not error.samps_per_chan_read:
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

    def new_warnings(self) -> list[str]:
        """Return the driver's warnings since the last call, each warning once."""
        return self._connection.warnings.take_new()

    def is_present(self) -> bool:
        """Return whether the card is still connected; only after `release`, because a busy card cannot be tested."""
        try:
            with self._lock, self._connection.errors_translated():
                if self._closed:
                    raise _closed()
                if self._name not in self._system.devices.device_names:
                    return False
                self._system.devices[self._name].self_test_device()
        except DeviceError as error:
            return error.code not in ABSENT_CODES
        return True

    def release(self) -> None:
        """Free the card for other programs, after a read in progress; may be called twice."""
        with self._lock:
            counter, self._counter = self._counter, None
            task, self._task = self._task, None
            for each in (None if counter is None else counter.task, task):
                if each is not None:
                    with suppress(Error):  # the card or its server may be gone
                        each.close()

    def close(self) -> None:
        """Release the card and close the connection to it; may be called twice."""
        self.release()
        with self._lock:
            self._closed = True
            self._connection.close()

    def _create_counter(self, rig: Rig, counter: TachoCounter) -> NiCounter:
        # No wait for another client: this one has already reserved the analog inputs.
        task = self._connection.acquisition_task(self._name, "-counter", abandoned_after=0.0)
        try:
            return NiCounter(task, self._name, counter, rig.config)
        except Error:
            with suppress(Error):
                task.close()
            raise

    def _configure(self, task: Task, rig: Rig, device: Device) -> Acquisition:
        timing = rig.config.timing
        sections = sorted(rig.config.channel, key=lambda section: section.role is Role.TACHO)  # settles last
        inputs = [self._add(task, section) for section in sections]
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
            channels=tuple(_channel_record(rig, *pair) for pair in zip(sections, inputs, strict=True)),
            tacho=rig.tacho,
            buffer=int(task.in_stream.input_buf_size),
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
    def _locked_task(self) -> Iterator[Task]:
        with self._lock, self._connection.errors_translated():
            if self._task is None:
                raise _closed()
            yield self._task

    @contextmanager
    def _locked_counter(self) -> Iterator[NiCounter]:
        with self._lock, self._connection.errors_translated():
            if self._counter is None:
                raise _closed()
            yield self._counter


def _closed() -> DeviceError:
    return DeviceError(DeviceFault.OTHER, "the card has been closed")


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
