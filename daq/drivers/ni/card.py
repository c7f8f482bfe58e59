"""The card as NI-DAQmx offers it: its acquisition, reserved, started, read and released."""

import math
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress

import numpy as np
from nidaqmx.constants import AcquisitionType, TaskMode, TerminalConfiguration
from nidaqmx.errors import DaqReadError, Error
from nidaqmx.stream_readers import AnalogUnscaledReader
from nidaqmx.system.device import Device
from nidaqmx.task import Task
from nidaqmx.task.channels import AIChannel
from numpy.typing import NDArray

from analysis.signals.header import Acquisition, Channel, Role, TachoCounter
from analysis.signals.header import Device as DeviceRecord
from daq.config.rig import Rig
from daq.config.schema import ChannelSection
from daq.drivers.ni.connection import Connection
from daq.drivers.ni.counter import NiCounter
from daq.drivers.ni.error_codes import ABSENT_CODES, NOT_YET_AVAILABLE
from daq.errors import DeviceError, DeviceFault

PATIENCE = 1.0  # s that a block may come late before the device is asked what is wrong
ABANDONED_AFTER = 1.5  # s without a read after which a server's leftover acquisition belongs to nobody

TERMINALS = {
    "differential": TerminalConfiguration.DIFF,
    "rse": TerminalConfiguration.RSE,
    "nrse": TerminalConfiguration.NRSE,
}


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
        self._connection = Connection(rig.config.device)
        self._task: Task | None = None
        self._counter: NiCounter | None = None
        self._lock = threading.Lock()
        self._closed = False
        with ExitStack() as undo:
            undo.callback(self.close)
            with self._connection.translated():
                self._system = self._connection.system()
                device = self._connection.device(self._system)
                self._name = str(device.name)
                self._task = self._connection.lasting_task(self._name, abandoned_after=ABANDONED_AFTER)
                self.acquisition = self._configure(self._task, rig, device)
                if rig.tacho.counter is not None:
                    self._counter = self._open_counter(rig, rig.tacho.counter)
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

    def start_counter(self) -> None:
        """Start the counter, or start it again; it waits for `start`."""
        with self._use_counter() as counter:
            counter.task.start()

    def stop_counter(self) -> None:
        """Stop the counter; it stays reserved."""
        with self._use_counter() as counter:
            counter.task.stop()

    def counts(self) -> tuple[NDArray[np.uint32], bool]:
        """Return the counts that the tacho's edges have latched since the last call, and whether that was all."""
        with self._use_counter() as counter:
            return counter.read()

    def warnings(self) -> list[str]:
        """Return what the driver has warned of since this was last asked, each warning once."""
        return self._connection.warned.news()

    def is_present(self) -> bool:
        """Ask the driver whether the card is still there; only after `release`, for a card at work cannot be tested."""
        try:
            with self._lock, self._connection.translated():
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
            counter, self._counter = self._counter, None
            task, self._task = self._task, None
            for held in (None if counter is None else counter.task, task):
                if held is not None:
                    with suppress(Error):  # a card that is gone, or its server, cannot be told
                        held.close()

    def close(self) -> None:
        """Release the card and the connection to it; harmless when closed."""
        self.release()
        with self._lock:
            self._closed = True
            self._connection.close()

    def _open_counter(self, rig: Rig, counter: TachoCounter) -> NiCounter:
        task = self._connection.lasting_task(self._name, "-counter", abandoned_after=0.0)  # whose the inputs are
        try:
            return NiCounter(task, self._name, counter, rig.config)
        except Error:
            with suppress(Error):
                task.close()
            raise

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
                driver="NI-DAQmx " + ".".join(str(part) for part in version) + self._connection.where,
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
    def _use(self) -> Iterator[Task]:
        with self._lock, self._connection.translated():
            if self._task is None:
                raise _closed()
            yield self._task

    @contextmanager
    def _use_counter(self) -> Iterator[NiCounter]:
        with self._lock, self._connection.translated():
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
