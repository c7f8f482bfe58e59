"""The simulated card and the simulated bench connected to it."""

import math

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import Acquisition, Channel, Device, Role
from analysis.signals.units import MICROMETRE, MICROSECOND, RPM
from daq.config.devices import device_spec
from daq.config.rig import Rig
from daq.config.schema import ChannelSection
from daq.drivers.simulation import converter
from daq.drivers.simulation.motion import MotionComponent, SamplingInstants
from daq.drivers.simulation.probe import SimulatedProbe
from daq.drivers.simulation.random_streams import StreamPurpose, random_stream
from daq.drivers.simulation.shaft import shaft_motion
from daq.drivers.simulation.speed import SpeedProfile, make_speed_profile
from daq.drivers.simulation.tacho import SimulatedTacho, TachoSignal
from daq.drivers.simulation.wiring import SensorRows, SimulatedWiring

PORTION = 8192  # samples computed together, whatever the block size, so that the codes do not depend on it


class SimulatedCard:
    """A simulated bench that runs once through its speed profile, and the card that digitises it.

    The same rig always gives the same codes, for any block size.

    Parameters
    ----------
    rig : Rig
        Card, channels and bench to simulate.
    """

    def __init__(self, rig: Rig) -> None:
        config, bench = rig.config, rig.config.simulation
        self._acquisition = _acquisition(rig)
        self._speed_profile = _speed_profile(rig)
        self._motion: MotionComponent = shaft_motion(rig, self._speed_profile, self._acquisition)
        rate = self._acquisition.rate
        self._n_samples = int(bench.profile[-1].time_s * rate)
        self._probe_rows = [self._acquisition.row(role) for role in (Role.PROBE_X, Role.PROBE_Y)]
        self._tacho_row = self._acquisition.row(Role.TACHO)
        self._probes = [
            SimulatedProbe(
                rig.calibrations[config.channel[row].name],
                standing_gap=bench.gap_um[number] * MICROMETRE,
                noise=bench.sensor_noise_um * MICROMETRE,
                bandwidth=bench.sensor_bandwidth_hz,
                glitches=(bench.glitches_per_s, bench.glitch_um * MICROMETRE),
                rate=rate,
                key=(bench.seed, number),
            )
            for number, row in enumerate(self._probe_rows)
        ]
        self._tacho = SimulatedTacho(
            tacho=rig.tacho,
            signal=TachoSignal(
                high=bench.tacho_high_v,
                low=bench.tacho_low_v,
                rise=bench.tacho_rise_us * MICROSECOND,
                jitter=bench.tacho_jitter_us * MICROSECOND,
            ),
            speed_profile=self._speed_profile,
            seed=bench.seed,
        )
        self._tacho_noise = bench.tacho_noise_v
        self._wiring = SimulatedWiring(
            bench.miswiring, SensorRows(self._probe_rows[0], self._probe_rows[1], self._tacho_row), bench.seed
        )
        self._seed = bench.seed
        self._portion = 0
        self._left = np.empty((len(config.channel), 0), dtype=np.int16)
        self._n_read = 0

    @property
    def acquisition(self) -> Acquisition:
        """The acquisition, as the driver of a real card would report it."""
        return self._acquisition

    @property
    def speed_profile(self) -> SpeedProfile:
        """The shaft's true speed and angle."""
        return self._speed_profile

    @property
    def n_samples(self) -> int:
        """Length of the whole run, samples per channel."""
        return self._n_samples

    @property
    def n_read(self) -> int:
        """Samples per channel read so far."""
        return self._n_read

    def skip(self, n: int) -> None:
        """Discard samples, as lost in an overrun."""
        while n > 0 and (passed := self.next_codes(min(n, PORTION)).shape[1]) > 0:
            n -= passed

    def next_codes(self, n: int) -> NDArray[np.int16]:
        """Return the next codes, shape (n_channels, n); fewer at the end of the run, none after it."""
        wanted = min(n, self._n_samples - self._n_read)
        parts = [self._left[:, :wanted]]
        self._left = self._left[:, wanted:]
        missing = wanted - parts[0].shape[1]
        while missing > 0:
            portion = self._next_portion()
            parts.append(portion[:, :missing])
            self._left = portion[:, missing:]
            missing -= parts[-1].shape[1]
        self._n_read += wanted
        return np.concatenate(parts, axis=1)

    def ticks(self, first: int, stop: int, begin: int = 0) -> NDArray[np.int64]:
        """Return the counter's stamps of the edges in an interval of samples.

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
        counter, rate = self._acquisition.tacho.counter, self._acquisition.rate
        if counter is None or stop <= first or not self._wiring.reaches_counter:
            return np.empty(0, np.int64)
        times = self._tacho.stamps(first / rate, stop / rate, counter.edge)
        return np.floor((times - begin / rate) * counter.timebase).astype(np.int64)

    def _next_portion(self) -> NDArray[np.int16]:
        """Return the codes of the run's next portion."""
        acquisition, portion = self._acquisition, self._portion
        time = (portion * PORTION + np.arange(PORTION)) / acquisition.rate
        lags = np.arange(len(acquisition.channels)) / acquisition.convert_rate
        displacement = self._motion.advance(SamplingInstants.along(self._speed_profile, time, lags[self._probe_rows]))
        volts = np.empty((len(acquisition.channels), PORTION))
        for row, probe, moved in zip(self._probe_rows, self._probes, displacement, strict=True):
            volts[row] = probe.volts(portion, moved)
        noise = random_stream(self._seed, StreamPurpose.TACHO_NOISE, portion).standard_normal(PORTION)
        volts[self._tacho_row] = self._tacho.volts(time + lags[self._tacho_row]) + self._tacho_noise * noise
        self._portion += 1
        at_inputs = self._wiring.transmit(portion, time, volts)
        codes = np.empty(at_inputs.shape, dtype=np.int16)
        for row, channel in enumerate(acquisition.channels):
            codes[row] = converter.codes(at_inputs[row], channel.scaling)
        return codes


def _speed_profile(rig: Rig) -> SpeedProfile:
    bench = rig.config.simulation
    return make_speed_profile(
        [point.time_s for point in bench.profile],
        [point.speed_rpm * RPM for point in bench.profile],
        random_stream(bench.seed, StreamPurpose.SPEED),
        rms=bench.speed_fluctuation,
        correlation_time=bench.fluctuation_time_s,
        drift=bench.speed_drift / 60.0,
    )


def _acquisition(rig: Rig) -> Acquisition:
    config = rig.config
    card = device_spec(config.device.product)
    rate = converter.coerced_rate(card, config.timing.rate_hz)
    return Acquisition(
        device=Device(
            backend=str(config.device.backend),
            product=config.device.product,
            serial=config.device.serial,
            driver="simulated",
            simulated=True,
        ),
        rate=rate,
        convert_rate=converter.convert_rate(card, rate, len(config.channel)),
        channels=tuple(_channel(rig, section) for section in config.channel),
        tacho=rig.tacho,
        buffer=round(config.timing.buffer_s * rate),
    )


def _channel(rig: Rig, section: ChannelSection) -> Channel:
    gap_low, gap_high = section.gap_window_v if section.role is not Role.TACHO else (-math.inf, math.inf)
    return Channel(
        name=section.name,
        role=section.role,
        physical=section.physical,
        range_low=-section.range_v,
        range_high=section.range_v,
        scaling=converter.scaling(section.range_v),
        calibration=rig.calibrations.get(section.name),
        angle=math.radians(section.angle_deg),
        gap_low=gap_low,
        gap_high=gap_high,
    )
