"""The recorder: a process of its own that does nothing but carry samples from the source into the file and the ring.

It talks with the watching process over an anonymous pipe: `Opened` or `Refused` first, `Acquired` when the samples have
ended, `Closed` last. Back come results to be written beside the samples, `Stop`, and `Done` when no more will follow.
If the watching process goes away, the recorder stops the source and finishes the file by itself.
"""

import shutil
import signal
import threading
import time
from contextlib import ExitStack, closing, suppress
from dataclasses import replace
from multiprocessing.connection import Connection

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import RunHeader
from daq.drivers.factory import apply_trigger, open_source
from daq.drivers.source import Source
from daq.drivers.triggered import TriggerStart
from daq.errors import RigError, StoppedError, UsageError
from daq.session.processes import ignore_terminal_signals
from daq.session.recording.messages import (
    AcquisitionEnded,
    DeviceOpened,
    FileClosed,
    RecordingRefused,
    RecordingRequest,
    ResultsEnded,
    StopRequest,
)
from daq.session.recording.ring import BlockRing, SharedBytes
from daq.session.recording.statistics import RecorderStatistics
from recordings.errors import RecordingError
from recordings.mcap.markers import Marker, encode_marker
from recordings.mcap.parts import PartLimits, PartWriter
from recordings.mcap.results import EncodedResult

RESULTS_DEADLINE = 15.0  # s that the finished acquisition waits for the last results before the file is closed without


def record(order: RecordingRequest, ring_memory: SharedBytes, statistics_memory: SharedBytes, pipe: Connection) -> None:
    """Run the recorder; the entry point of its process."""
    ignore_terminal_signals()  # the watching process decides
    ring, statistics = BlockRing(ring_memory), RecorderStatistics(statistics_memory)
    with ExitStack() as stack:
        try:
            _require_room(order)
            source = stack.enter_context(closing(open_source(order.rig)))
            if pipe.poll():  # nobody says anything before it is told of the device, but to stop
                raise StoppedError("stopped before the device was open")
            header = run_header(order, source)
            writer = PartWriter(order.path, header, _part_limits(order, header))
        except RigError as error:
            with suppress(OSError):  # who has stopped it does not wait
                pipe.send(RecordingRefused(str(error), error.exit_code))
        except RecordingError as error:
            pipe.send(RecordingRefused(str(error), UsageError.exit_code))
        else:
            _Recorder(order, source, writer, ring, statistics, pipe).run()


def _part_limits(order: RecordingRequest, header: RunHeader) -> PartLimits:
    """Return when a run goes on in a further file, as the rig says."""
    storage = order.rig.config.storage
    samples = round(60 * storage.split_minutes * header.acquisition.rate) or None
    return PartLimits(samples, round(1e9 * storage.split_gb) or None, order.rig.config.trigger.events != 1)


def _require_room(order: RecordingRequest) -> None:
    """Raise UsageError where the disk holds less than the reserve already."""
    free, reserve = _room(order)
    if free < reserve:
        raise UsageError(_too_little(order, free, reserve))


def _room(order: RecordingRequest) -> tuple[int, int]:
    """Return the bytes that are free where the run goes, and those that must stay free."""
    return shutil.disk_usage(order.path.parent).free, int(order.rig.config.storage.reserve_gb * 1e9)


def _too_little(order: RecordingRequest, free: int, reserve: int) -> str:
    return (
        f"{order.path.parent}: {free / 1e9:.2f} GB free, expected more than storage.reserve_gb = {reserve / 1e9:g}: "
        "make room or record elsewhere (storage.folder, RIG_DATA)"
    )


def run_header(order: RecordingRequest, source: Source) -> RunHeader:
    """Return the header of the run, with the acquisition as the opened device reports it."""
    return RunHeader(
        run=order.run,
        rig=order.rig.config.rig,
        started_ns=order.started_ns,
        acquisition=source.acquisition,
        settings=order.rig.settings,
        limits=order.rig.limits,
        config_toml=order.rig.toml,
        program=order.program,
        note=order.note,
    )


def _fault(error: Exception) -> str:
    return f"recording stopped by a fault of the program: {type(error).__name__}: {error}"


class _Recorder:
    """Source → file and ring, until the end; results on the side."""

    def __init__(
        self,
        order: RecordingRequest,
        source: Source,
        writer: PartWriter,
        ring: BlockRing,
        statistics: RecorderStatistics,
        pipe: Connection,
    ) -> None:
        self._order = order
        self._header = run_header(order, source)
        self._source = apply_trigger(source, order.rig.config.trigger, self)
        self._passed = 0  # samples per channel that the trigger skipped since the last block it delivered
        self._writer = writer
        self._ring = ring
        self._statistics = statistics
        self._pipe = pipe
        self._ends: list[SegmentEnd] = []
        self._message = ""
        self._skipped: int | None = None  # not known before the watching process says that it is done
        self._done = threading.Event()
        self._disk_checked = -1.0
        rate = source.acquisition.rate
        self._rate = rate
        self._limit = None if order.duration is None else max(1, round(order.duration * rate))

    def run(self) -> None:
        signal.signal(signal.SIGTERM, lambda *_: self._source.stop())
        listener = threading.Thread(target=self._listen, name="recorder-listener", daemon=True)
        try:
            self._pipe.send(DeviceOpened(self._header))
            listener.start()
            self._statistics.start()
            self._pump()
        except Exception as error:  # noqa: BLE001 - whatever it is, the file is finished and the operator is told
            self._message = _fault(error)
            self._source.stop()
        finally:
            self._ring.finish()
            self._source.close()
            with suppress(OSError):  # the watching process may be gone; the file matters
                self._pipe.send(AcquisitionEnded(tuple(self._ends)))
                self._done.wait(RESULTS_DEADLINE)
            self._close()
            listener.join(1.0)

    def _pump(self) -> None:
        for item in self._source.blocks():
            try:
                self._take(item)
            except RecordingError as error:
                self._give_up(item, str(error))
                return

    def _take(self, item: SampleBlock | SegmentEnd) -> None:
        if isinstance(item, SegmentEnd):
            if item.reason is EndReason.STOPPED:
                planned = self._limit is not None and self._statistics.samples >= self._limit
                item = replace(
                    item, reason=EndReason.FINISHED if planned else item.reason, detail=self._message or item.detail
                )
            self._writer.write_segment_end(item)
            self._statistics.add_end(item)
            self._ends.append(item)
        else:
            self._writer.write_block(item)
            self._statistics.add_block(item)
            self._guard_disk()
            if self._limit is not None and self._statistics.samples >= self._limit:
                self._source.stop()
        self._ring.put(item)

    def on_waiting(self, event: int, speed: float) -> None:
        """Show that the start of an event is waited for; as a `TriggerListener`."""
        self._statistics.set_armed(event, speed)

    def on_skipped(self, samples: int) -> None:
        """Count the samples that a trigger skips; as a `TriggerListener`."""
        self._writer.skip_samples(samples)
        self._passed += samples

    def on_start(self, start: TriggerStart) -> None:
        """Record the start of an event as a marker; as a `TriggerListener`."""
        text = f"start: {start.condition}, after {self._passed:,} samples ({self._passed / self._rate:,.1f} s) skipped"
        self._passed = 0
        marker = Marker(start.segment, start.sample, text, time.time_ns())
        self._writer.add_result(encode_marker(marker, self._header))

    def _give_up(self, item: SampleBlock | SegmentEnd, message: str) -> None:
        """Stop when the file takes no more; what came after the last good block is counted as lost."""
        self._message = message
        self._source.stop()
        lost = item.n_samples if isinstance(item, SampleBlock) else 0
        end = SegmentEnd(
            item.segment,
            self._statistics.segment_samples,
            EndReason.RECORDER,
            lost,
            lost_is_exact=False,
            detail=message,
        )
        self._statistics.add_end(end)
        self._ends.append(end)
        self._ring.put(end)

    def _guard_disk(self) -> None:
        now = time.monotonic()
        if now - self._disk_checked < 1.0:
            return
        self._disk_checked = now
        free, reserve = _room(self._order)
        self._statistics.disk_bytes_left = max(0, free - reserve)
        if free < reserve and not self._message:
            self._message = "recording stopped: " + _too_little(self._order, free, reserve)
            self._source.stop()

    def _listen(self) -> None:
        """Take results and orders from the watching process until it is done or gone; then nobody is left to stop."""
        try:
            while True:
                message = self._pipe.recv()
                if isinstance(message, EncodedResult):
                    with suppress(RecordingError):  # the sample path meets the same trouble and tells it
                        self._writer.add_result(message)
                elif isinstance(message, StopRequest):
                    self._source.stop()
                elif isinstance(message, ResultsEnded):
                    self._skipped = message.skipped_samples
                    return
        except (EOFError, OSError):
            pass  # the watching process is gone
        except Exception as error:  # noqa: BLE001 - whatever it is, the file is finished and the operator is told
            self._message = _fault(error)
        finally:
            self._source.stop()
            self._done.set()

    def _close(self) -> None:
        try:
            # without word from the watching process its results may be anything
            skipped = self._statistics.samples if self._skipped is None else self._skipped
            self._writer.close(skipped_samples=skipped)
        except RecordingError as error:
            self._message = self._message or str(error)
        with suppress(OSError):
            self._pipe.send(FileClosed(self._message))
