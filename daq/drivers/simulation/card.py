"""The simulated card: its converter, its samples, and the source that delivers them with the pace and buffer of a card.

The limits are those of the card's `DeviceSpec`; the converter's other figures are from NI's M Series manual and 6255
specification.
"""

import time
from collections.abc import Generator, Iterator

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import CODE_MAX, CODE_MIN, Acquisition, Device, Role
from daq.config.devices import device_spec
from daq.config.rig import Rig
from daq.drivers.simulation import StreamPurpose, random_stream
from daq.drivers.simulation.motion import SamplingInstants, shaft_motion
from daq.drivers.simulation.sensors import SimulatedProbe, SimulatedTacho
from daq.drivers.simulation.speed import make_speed_profile
from daq.drivers.simulation.wiring import FAULTS, SensorRows
from daq.drivers.source import RestartLimiter
from daq.stop_flag import StopFlag
from model.errors import WallContactError

FloatArray = NDArray[np.float64]

# An uncalibrated converter, relative to the range: it exceeds the range by 4.8 % and has offset and curvature.
OFFSET = 6e-5
GAIN = 1.048
SQUARE = 1.5e-5  # at full scale
CUBE = -2.5e-5  # at full scale


def scaling_polynomial(full_range: float) -> tuple[float, float, float, float]:
    """Return the device's scaling polynomial, V per code**k, for the range ±``full_range``, V."""
    full_code = float(CODE_MAX + 1)
    return (
        OFFSET * full_range,
        GAIN * full_range / full_code,
        SQUARE * full_range / full_code**2,
        CUBE * full_range / full_code**3,
    )


def quantized(volts: FloatArray, polynomial: tuple[float, ...]) -> NDArray[np.int16]:
    """Return the converter's codes for voltages, V: the inverted scaling polynomial, rounded and clipped."""
    offset, gain, square, cube = polynomial
    linear = (volts - offset) / gain
    code = linear
    for _ in range(2):  # the curvature is small, so each iteration gains four digits
        code = linear - code * code * (square + cube * code) / gain
    return np.clip(np.rint(code), CODE_MIN, CODE_MAX).astype(np.int16)


PORTION = 8192  # samples computed together, whatever the block size, so that the codes do not depend on it


class SimulatedCard:
    """A simulated bench that runs once through its speed profile, and the card that digitises it.

    The same rig always gives the same codes, for any block size.

    Parameters
    ----------
    rig : Rig
        Card, channels and bench to simulate.

    Attributes
    ----------
    acquisition : Acquisition
        The acquisition, as the driver of a real card would report it.
    speed_profile : SpeedProfile
        The shaft's true speed and angle.
    n_samples, n_read : int
        Length of the whole run and what has been read so far, samples per channel.
    """

    def __init__(self, rig: Rig) -> None:
        config, bench = rig.config, rig.config.simulation
        self.acquisition = _acquisition(rig)
        self.speed_profile = make_speed_profile(bench)
        self.n_samples = int(bench.profile[-1].time_s * self.acquisition.rate)
        self.n_read = 0
        self._bench = bench
        self._motion = shaft_motion(rig, self.speed_profile, self.acquisition)
        x, y, tacho = (self.acquisition.row(role) for role in (Role.PROBE_X, Role.PROBE_Y, Role.TACHO))
        self._probe_rows, self._tacho_row = [x, y], tacho
        self._probes = [
            SimulatedProbe(rig.calibrations[config.channel[row].name], bench, number, self.acquisition.rate)
            for number, row in enumerate(self._probe_rows)
        ]
        self._tacho = SimulatedTacho(rig.tacho, bench, self.speed_profile)
        self._wiring = FAULTS[bench.miswiring](SensorRows(x, y, tacho), bench.seed)
        self._portion = 0
        self._left = np.empty((len(config.channel), 0), dtype=np.int16)

    def skip(self, n: int) -> None:
        """Discard samples, as lost in an overrun."""
        while n > 0 and (passed := self.next_codes(min(n, PORTION)).shape[1]) > 0:
            n -= passed

    def next_codes(self, n: int) -> NDArray[np.int16]:
        """Return the next codes, shape (n_channels, n); fewer at the end of the run, none after it."""
        wanted = min(n, self.n_samples - self.n_read)
        parts = [self._left[:, :wanted]]
        self._left = self._left[:, wanted:]
        missing = wanted - parts[0].shape[1]
        while missing > 0:
            portion = self._next_portion()
            parts.append(portion[:, :missing])
            self._left = portion[:, missing:]
            missing -= parts[-1].shape[1]
        self.n_read += wanted
        return np.concatenate(parts, axis=1)

    def ticks(self, first: int, stop: int, begin: int = 0) -> NDArray[np.int64]:
        """Return the counter's timestamps of the edges in an interval of samples.

        Parameters
        ----------
        first, stop : int
            First sample and one past the last, from the beginning of the run.
        begin : int
            Sample at which the counter started.

        Returns
        -------
        ndarray of int64, shape (n_pulses,)
            Whole ticks of the timebase from the counter's start to the edges; empty without a counter.
        """
        counter, rate = self.acquisition.tacho.counter, self.acquisition.rate
        if counter is None or stop <= first or not self._wiring.reaches_counter:
            return np.empty(0, np.int64)
        times = self._tacho.timestamps(first / rate, stop / rate, counter.edge)
        return np.floor((times - begin / rate) * counter.timebase).astype(np.int64)

    def _next_portion(self) -> NDArray[np.int16]:
        """Return the codes of the run's next portion."""
        acquisition, portion = self.acquisition, self._portion
        time = (portion * PORTION + np.arange(PORTION)) / acquisition.rate
        lags = np.arange(len(acquisition.channels)) / acquisition.convert_rate
        instants = SamplingInstants.along(self.speed_profile, time, lags[self._probe_rows])
        displacement = np.sum([component.advance(instants) for component in self._motion], axis=0)
        volts = np.empty((len(acquisition.channels), PORTION))
        for row, probe, moved in zip(self._probe_rows, self._probes, displacement, strict=True):
            volts[row] = probe.volts(portion, moved)
        noise = random_stream(self._bench.seed, StreamPurpose.TACHO_NOISE, portion).standard_normal(PORTION)
        volts[self._tacho_row] = self._tacho.volts(time + lags[self._tacho_row]) + self._bench.tacho_noise_v * noise
        self._portion += 1
        self._wiring.apply(time, volts, random_stream(self._bench.seed, StreamPurpose.WIRING_NOISE, portion))
        codes = np.empty(volts.shape, dtype=np.int16)
        for row, channel in enumerate(acquisition.channels):
            codes[row] = quantized(volts[row], channel.scaling)
        return codes


def _acquisition(rig: Rig) -> Acquisition:
    config = rig.config
    card = device_spec(config.device.product)
    rate = card.coerced_rate(config.timing.rate_hz)
    return Acquisition(
        device=Device(
            backend=str(config.device.backend),
            product=config.device.product,
            serial=config.device.serial,
            driver="simulated",
            simulated=True,
        ),
        rate=rate,
        convert_rate=card.convert_rate(rate, len(config.channel)),
        channels=tuple(
            rig.channel(each, (-each.range_v, each.range_v), scaling_polynomial(each.range_v))
            for each in config.channel
        ),
        tacho=rig.tacho,
        buffer=round(config.timing.buffer_s * rate),
    )


class SimulatedSource:
    """A `Source` that delivers the simulated card's blocks.

    A reader that is later than the buffer allows loses samples, as with a real card: the segment ends with the loss,
    and the acquisition continues as the next segment. The simulated bench does not wait for the reader.

    Parameters
    ----------
    card : SimulatedCard
        The card, from which no samples have been read.
    block : int
        Samples per channel and block.
    buffer : int
        Samples per channel that the card's buffer holds.
    real_time : bool
        Whether samples arrive at the card's rate; otherwise as fast as they are read.
    restarts : RestartLimiter
        Limits new segments after faults.
    """

    def __init__(
        self, card: SimulatedCard, *, block: int, buffer: int, real_time: bool, restarts: RestartLimiter
    ) -> None:
        self._card = card
        self._block = block
        self._buffer = buffer
        self._real_time = real_time
        self.acquisition = card.acquisition  # as the driver of a real card would report it
        self._restarts = restarts
        self._stopping = StopFlag()
        self._started = 0.0
        self._read = 0  # samples per channel delivered in this segment

    def blocks(self) -> Iterator[SourceItem]:
        """Start, and yield blocks and segment ends until stopped or until the speed profile ends.

        Deadlines count from the start, so that the pace does not drift.
        """
        self._started = time.monotonic()
        lost, segment = 0, 0
        while True:
            self._read = 0
            try:
                self._card.skip(lost)
                end = yield from self._segment(segment)
            except WallContactError as error:
                end = SegmentEnd(segment, self._read, EndReason.DEVICE_ERROR, detail=str(error))
            lost = end.lost
            over = self._stopping.is_set() or self._card.n_read + lost >= self._card.n_samples
            continues = end.reason is EndReason.OVERRUN and not over
            continues, end = self._restarts.decide(end, continues=continues)
            yield end
            if not continues or self._stopping.is_set():
                return
            segment += 1

    def stop(self) -> None:
        """Request the stop, from any thread."""
        self._stopping.set()

    def close(self) -> None:
        """Request the stop; there is no device to release."""
        self._stopping.set()

    def _segment(self, segment: int) -> Generator[SampleBlock, None, SegmentEnd]:
        """Yield the blocks of a segment and return its end."""
        before = self._card.n_read
        while not self._stopping.is_set():
            late = self._acquired() - before - self._read
            if late > self._buffer:
                return self._overrun(segment, late)
            codes = self._card.next_codes(self._block)
            if codes.shape[1] == 0:
                return SegmentEnd(segment, self._read, EndReason.FINISHED)
            if not self._wait_for(self._card.n_read):
                break
            first, self._read = self._read, self._read + codes.shape[1]
            backlog = max(self._acquired() - self._card.n_read, 0)
            ticks = self._ticks(before, first)
            yield SampleBlock(codes, segment, first, host_time_ns=time.time_ns(), backlog=backlog, ticks=ticks)
        return SegmentEnd(segment, self._read, EndReason.STOPPED)

    def _ticks(self, before: int, first: int) -> NDArray[np.int64] | None:
        """Return the counter's timestamps since sample `first` of the segment, which begins at the run's `before`."""
        if self.acquisition.tacho.counter is None:
            return None
        return self._card.ticks(before + first, self._card.n_read, before)

    def _wait_for(self, sample: int) -> bool:
        """Wait until the card has digitised a sample; return False if a stop was requested meanwhile."""
        if not self._real_time:
            return True
        due = self._started + sample / self.acquisition.rate
        return not self._stopping.wait(max(due - time.monotonic(), 0.0))

    def _acquired(self) -> int:
        """Return how many samples per channel the card has digitised by now; 0 if it does not run in real time."""
        if not self._real_time:
            return 0
        return min(int((time.monotonic() - self._started) * self.acquisition.rate), self._card.n_samples)

    def _overrun(self, segment: int, late: int) -> SegmentEnd:
        rate = self.acquisition.rate
        detail = f"the reader was {late / rate:.1f} s late, the card's buffer holds {self._buffer / rate:.1f} s"
        return SegmentEnd(segment, self._read, EndReason.OVERRUN, lost=late, detail=detail)
