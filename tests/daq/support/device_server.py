"""A stand-in for NI's gRPC device server, based on the servicer that nidaqmx ships.

It follows the conventions of the real server (ni/grpc-device). An error is status UNKNOWN with `ni-error` in the
trailing metadata, and `ni-samps-per-chan-read` for a read. Only a read's time-out is the status of an ordinary
response, with the samples that have arrived. Arrays have the requested length, padded with zeros. Sessions have names
and outlive their client.
"""

import threading
from collections import defaultdict, deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import grpc
import numpy as np
from nidaqmx._stubs import nidaqmx_pb2 as pb
from nidaqmx._stubs.nidaqmx_pb2_grpc import NiDAQmxServicer, add_NiDAQmxServicer_to_server
from session_pb2 import Session

from tests.daq.support.ni_driver import DriverError, NiChannel, NiCounter, NiDriver, NiTask

ATTACH, NEW = 2, 1  # of initialization_behavior
COMMIT = 3  # of TaskMode
CONTINUOUS = 10123  # of AcquisitionType
COUNT_UP = 10128  # of CountDirection


class Rpcs:
    """The remote procedures that the client calls, named as in the service and executed by the stand-in driver."""

    def __init__(self, driver: NiDriver) -> None:
        self.driver = driver
        self.tasks: dict[str, NiTask] = {}
        self.made = 0

    def task(self, request: Any) -> NiTask:
        try:
            return self.tasks[request.task.name]
        except KeyError:
            raise DriverError(-200088) from None

    def counter(self, request: Any) -> NiCounter:
        counter = self.task(request).counter
        if counter is None:
            raise DriverError(-200077)
        return counter

    def others(self, task: NiTask) -> list[NiTask]:
        return [other for other in self.tasks.values() if other is not task]

    def device(self, request: Any) -> tuple[str, int]:
        try:
            return self.driver.devices[request.device_name]
        except KeyError:
            raise DriverError(-200220) from None

    def CreateTask(self, request: Any, context: grpc.ServicerContext) -> Any:
        name, behavior = request.session_name, request.initialization_behavior
        if behavior == ATTACH and name not in self.tasks:
            context.abort(grpc.StatusCode.FAILED_PRECONDITION, f"no session {name} to attach to")
        if behavior == NEW and name in self.tasks:
            context.abort(grpc.StatusCode.ALREADY_EXISTS, f"session {name} exists")
        if name in self.tasks:
            return pb.CreateTaskResponse(task=Session(name=name), new_session_initialized=False)
        self.made += 1
        name = name or f"_unnamedTask<{self.made}>"
        self.tasks[name] = NiTask()
        return pb.CreateTaskResponse(task=Session(name=name), new_session_initialized=True)

    def ClearTask(self, request: Any, _: object) -> Any:
        self.tasks.pop(request.task.name, None)
        return pb.ClearTaskResponse()

    def GetTaskAttributeString(self, request: Any, _: object) -> Any:
        self.task(request)
        return pb.GetTaskAttributeStringResponse(value={0x1276: request.task.name}[request.attribute_raw])

    def GetSystemInfoAttributeUInt32(self, request: Any, _: object) -> Any:
        part = {0x1272: 0, 0x1923: 1, 0x2F22: 2}[request.attribute_raw]
        return pb.GetSystemInfoAttributeUInt32Response(value=self.driver.driver_version[part])

    def GetSystemInfoAttributeString(self, request: Any, _: object) -> Any:
        names = {0x193B: ", ".join(self.driver.devices)}
        return pb.GetSystemInfoAttributeStringResponse(value=names[request.attribute_raw])

    def GetDeviceAttributeString(self, request: Any, _: object) -> Any:
        return pb.GetDeviceAttributeStringResponse(value={0x631: self.device(request)[0]}[request.attribute_raw])

    def GetDeviceAttributeUInt32(self, request: Any, _: object) -> Any:
        return pb.GetDeviceAttributeUInt32Response(value={0x632: self.device(request)[1]}[request.attribute_raw])

    def GetDeviceAttributeBool(self, request: Any, _: object) -> Any:
        simulated = {0x22CA: self.driver.acquisition.device.simulated}
        return pb.GetDeviceAttributeBoolResponse(value=simulated[request.attribute_raw])

    def SelfTestDevice(self, request: Any, _: object) -> Any:
        self.driver.self_test(request.device_name)
        return pb.SelfTestDeviceResponse()

    def GetSelfCalLastDateAndTime(self, request: Any, _: object) -> Any:
        self.device(request)
        day = self.driver.self_calibrated
        if day is None:
            raise DriverError(-200197)
        return pb.GetSelfCalLastDateAndTimeResponse(year=day.year, month=day.month, day=day.day, hour=8, minute=30)

    def CreateAIVoltageChan(self, request: Any, _: object) -> Any:
        name, physical = request.name_to_assign_to_channel, request.physical_channel
        self.driver.add_channel(
            self.task(request), NiChannel(name, physical, request.max_val, request.terminal_config_raw)
        )
        return pb.CreateAIVoltageChanResponse()

    def CreateCICountEdgesChan(self, request: Any, _: object) -> Any:
        if request.counter.partition("/")[0] not in self.driver.devices:
            raise DriverError(-200220)
        assert request.count_direction_raw == COUNT_UP
        self.task(request).counter = NiCounter(request.counter, request.edge_raw, request.initial_count)
        return pb.CreateCICountEdgesChanResponse()

    def SetChanAttributeString(self, request: Any, _: object) -> Any:
        assert request.attribute_raw == 0x18C7
        self.counter(request).clock = request.value
        return pb.SetChanAttributeStringResponse()

    def SetTrigAttributeInt32(self, request: Any, _: object) -> Any:
        self.counter(request).arm[request.attribute_raw] = request.value_raw
        return pb.SetTrigAttributeInt32Response()

    def SetTrigAttributeString(self, request: Any, _: object) -> Any:
        self.counter(request).arm[request.attribute_raw] = request.value
        return pb.SetTrigAttributeStringResponse()

    def ReadCounterU32Ex(self, request: Any, context: grpc.ServicerContext) -> Any:
        task, counter = self.task(request), self.counter(request)
        counts, status = self.driver.read_counter(task, request.num_samps_per_chan, self.others(task))
        if context.is_active():
            counter.replied += counts.size
        padded = np.zeros(request.array_size_in_samps, np.uint32)
        padded[: counts.size] = counts
        return pb.ReadCounterU32ExResponse(status=status, read_array=padded, samps_per_chan_read=counts.size)

    def CfgSampClkTiming(self, request: Any, _: object) -> Any:
        task = self.task(request)
        if task.counter is not None:
            task.counter.line, task.counter.line_edge = request.source, request.active_edge_raw
        task.rate, task.continuous = request.rate, request.sample_mode_raw == CONTINUOUS
        return pb.CfgSampClkTimingResponse()

    def SetBufferAttributeUInt32(self, request: Any, _: object) -> Any:
        assert request.attribute_raw == 0x186C
        self.task(request).buffer = request.value
        return pb.SetBufferAttributeUInt32Response()

    def GetBufferAttributeUInt32(self, request: Any, _: object) -> Any:
        return pb.GetBufferAttributeUInt32Response(value={0x186C: self.task(request).buffer}[request.attribute_raw])

    def TaskControl(self, request: Any, _: object) -> Any:
        assert request.action_raw == COMMIT
        task = self.task(request)
        self.driver.commit(task, self.others(task))
        return pb.TaskControlResponse()

    def GetTimingAttributeDouble(self, request: Any, _: object) -> Any:
        acquisition = self.driver.acquisition
        task = self.task(request)
        coerced = acquisition.rate if task.committed else task.rate
        values = {0x1344: coerced, 0x1848: acquisition.convert_rate}
        return pb.GetTimingAttributeDoubleResponse(value=values[request.attribute_raw])

    def GetChanAttributeDouble(self, request: Any, _: object) -> Any:
        high = {channel.name: channel.high for channel in self.task(request).channels}[request.channel]
        return pb.GetChanAttributeDoubleResponse(value={0x1815: high, 0x1816: -high}[request.attribute_raw])

    def GetChanAttributeDoubleArray(self, request: Any, _: object) -> Any:
        assert request.attribute_raw == 0x1930
        row = [channel.name for channel in self.task(request).channels].index(request.channel)
        return pb.GetChanAttributeDoubleArrayResponse(value=self.driver.scaling[row])

    def StartTask(self, request: Any, _: object) -> Any:
        task = self.task(request)
        self.driver.start(task, self.others(task))
        return pb.StartTaskResponse()

    def StopTask(self, request: Any, _: object) -> Any:
        self.driver.stop(self.task(request))
        return pb.StopTaskResponse()

    def ReadBinaryI16(self, request: Any, context: grpc.ServicerContext) -> Any:
        task = self.task(request)
        codes, status = self.driver.read(task, request.num_samps_per_chan, request.timeout)
        if context.is_active():
            task.count.replied += codes.shape[1]
        padded = np.zeros(request.array_size_in_samps, np.int16)
        padded[: codes.size] = codes.ravel()
        return pb.ReadBinaryI16Response(status=status, read_array=padded, samps_per_chan_read=codes.shape[1])

    def GetReadAttributeUInt32(self, request: Any, _: object) -> Any:
        task = self.task(request)
        available = self.driver.count(task) - task.count.position
        return pb.GetReadAttributeUInt32Response(value={0x1223: available}[request.attribute_raw])

    def GetReadAttributeUInt64(self, request: Any, _: object) -> Any:
        task = self.task(request)
        values = {0x192A: self.driver.count(task), 0x1221: task.count.position + self.driver.miscount}
        return pb.GetReadAttributeUInt64Response(value=values[request.attribute_raw])

    def GetErrorString(self, request: Any, _: object) -> Any:
        return pb.GetErrorStringResponse(error_string=str(DriverError(request.error_code)))


class DeviceServer:
    """A server on a loopback port, a free one by default.

    `faults["ReadBinaryI16"].extend([0, -200279])` lets one read succeed and the next one fail. `refusals` are calls
    that the server itself refuses. `log` lists the calls. `at_call` maps the number of a call to a function that runs
    before it.
    """

    def __init__(self, driver: NiDriver, *, port: int = 0) -> None:
        self.driver = driver
        self.rpcs = Rpcs(driver)
        self.faults: dict[str, deque[int]] = defaultdict(deque)
        self.refusals: dict[str, grpc.StatusCode] = {}
        self.log: list[str] = []
        self.at_call: dict[int, Callable[[], None]] = {}
        self._thawed = threading.Event()
        self._thawed.set()
        self._pool = ThreadPoolExecutor(max_workers=16)  # more than the calls that clients abandon while it is frozen
        self._server = grpc.server(self._pool)
        calls = {
            name: staticmethod(self._call(name, method))
            for name, method in ((name, getattr(self.rpcs, name)) for name in vars(Rpcs) if name[0].isupper())
        }
        add_NiDAQmxServicer_to_server(type("Servicer", (NiDAQmxServicer,), calls)(), self._server)
        self.target = f"127.0.0.1:{self._server.add_insecure_port(f'127.0.0.1:{port}')}"
        self._server.start()

    @property
    def tasks(self) -> list[str]:
        """Names of the tasks that have not been cleared."""
        return list(self.rpcs.tasks)

    def freeze(self) -> None:
        """Block all calls until `thaw`."""
        self._thawed.clear()

    def thaw(self) -> None:
        self._thawed.set()

    def kill(self) -> None:
        """Stop at once and abort the calls in progress."""
        self._thawed.set()
        self._server.stop(None).wait()
        self._pool.shutdown()

    def _fail(self, name: str) -> None:
        code = self.faults[name].popleft() if self.faults[name] else 0
        if code:
            raise DriverError(code)

    def _call(self, name: str, method: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        def handle(request: Any, context: grpc.ServicerContext) -> Any:
            self.log.append(name)
            self.at_call.pop(len(self.log), lambda: None)()
            self._thawed.wait()
            if name in self.refusals:
                context.abort(self.refusals[name], f"{name} is refused")
            try:
                with self.driver.lock:
                    self._fail(name)
                    return method(request, context)
            except DriverError as error:
                metadata = [("ni-error", str(error.code))]
                if name.startswith("Read"):
                    metadata.append(("ni-samps-per-chan-read", "0"))
                context.set_trailing_metadata(metadata)
                context.abort(grpc.StatusCode.UNKNOWN, str(error))

        return handle


@contextmanager
def serving(driver: NiDriver) -> Iterator[DeviceServer]:
    """Yield a running server, and stop it at the end."""
    server = DeviceServer(driver)
    try:
        yield server
    finally:
        server.kill()
