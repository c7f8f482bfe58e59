"""A counter of the card that stamps the tacho's edges: it counts a clock, and every edge latches the count."""

import math

import numpy as np
from nidaqmx.constants import AcquisitionType, TaskMode, TriggerType
from nidaqmx.constants import Edge as NiEdge
from nidaqmx.errors import DaqReadError
from nidaqmx.stream_readers import CounterReader
from nidaqmx.task import Task
from numpy.typing import NDArray

from analysis.signals.header import Edge, TachoCounter
from daq.config.checks import TIMEBASES
from daq.config.schema import RigConfig
from daq.drivers.ni.error_codes import NOT_YET_AVAILABLE

ROOM = 4.0  # times the marks at full speed that are fetched at once: doubles and a shaft that runs away
LEAST = 64  # stamps
EDGES = {Edge.RISING: NiEdge.RISING, Edge.FALLING: NiEdge.FALLING}


class NiCounter:
    """The counter, committed: reserved until its task is closed.

    It begins at 0 with the first sample, by the analog inputs' start trigger, and must be started before them.

    Parameters
    ----------
    task : Task
        Without a channel; closed by whoever made it.
    device : str
        The driver's name of the card, as "Dev1".
    counter : TachoCounter
        Which counter, which line, which clock.
    config : RigConfig
        How many edges are to be expected.
    """

    def __init__(self, task: Task, device: str, counter: TachoCounter, config: RigConfig) -> None:
        pulse_rate = ROOM * config.limits.speed_rpm / 60 * config.tacho.pulses_per_revolution
        size = LEAST + math.ceil(pulse_rate * config.timing.buffer_s)
        channel = task.ci_channels.add_ci_count_edges_chan(f"{device}/{counter.counter}")
        channel.ci_count_edges_term = f"/{device}/{TIMEBASES[counter.timebase]}"
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
        self._counts = np.empty(LEAST + math.ceil(pulse_rate * config.timing.block_s), np.uint32)

    @property
    def task(self) -> Task:
        """What holds the counter."""
        return self._task

    def read(self) -> tuple[NDArray[np.uint32], bool]:
        """Return the counts that edges have latched and that were not read, at once, and whether that was all.

        A fixed number is asked for: a USB card then sends what it holds, however little it is.
        """
        try:
            n = self._reader.read_many_sample_uint32(self._counts, self._counts.size, timeout=0.0)
        except DaqReadError as error:
            if error.error_code != NOT_YET_AVAILABLE:
                raise
            n = error.samps_per_chan_read
        return self._counts[:n].copy(), n < self._counts.size
