"""The simulated sensors: a probe with its conditioner, and the tacho with its waveform."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from analysis.signals.header import Calibration, Edge, Tacho
from analysis.signals.units import MICROMETRE, MICROSECOND
from daq.config.schema import SimulationSection
from daq.drivers.simulation import StreamPurpose, random_stream
from daq.drivers.simulation.speed import SpeedProfile

FloatArray = NDArray[np.float64]

TABLE_SIZE = 4096
SATURATION_MARGIN = 0.1  # of the calibrated span: the conditioner's output exceeds the span by it, then saturates
GLITCH_LENGTH = 1e-4  # s


class GapToVolts:
    """The inverse of a calibration: voltage as a function of gap, saturating beyond the calibrated span.

    Parameters
    ----------
    calibration : Calibration
        Gap, m, as a rising polynomial of voltage.
    """

    def __init__(self, calibration: Calibration) -> None:
        margin = SATURATION_MARGIN * (calibration.volts_high - calibration.volts_low)
        volts = np.linspace(calibration.volts_low - margin, calibration.volts_high + margin, TABLE_SIZE)
        gaps = np.polynomial.polynomial.polyval(volts, calibration.coefficients)
        falls = np.flatnonzero(np.diff(gaps) <= 0.0)
        middle = TABLE_SIZE // 2
        first = int(falls[falls < middle].max()) + 1 if np.any(falls < middle) else 0
        stop = int(falls[falls >= middle].min()) + 1 if np.any(falls >= middle) else TABLE_SIZE
        self._volts, self._gaps = volts[first:stop], gaps[first:stop]

    def __call__(self, gap: FloatArray) -> FloatArray:
        """Return the voltage, V, for gaps, m."""
        return np.asarray(np.interp(gap, self._gaps, self._volts), dtype=np.float64)

    def slope(self, gap: float) -> float:
        """Return the change of voltage with gap, V/m, near a gap, m; 0 if the output is saturated."""
        near = np.array([gap - 1e-6, gap + 1e-6])
        return float(np.diff(self(near))[0] / 2e-6)


class FirstOrderLowPass:
    """A first-order low-pass filter, exact for an input that is linear between samples.

    Parameters
    ----------
    corner : float
        Frequency of -3 dB, Hz.
    rate : float
        Sample rate, Hz.
    """

    def __init__(self, corner: float, rate: float) -> None:
        decay = 2.0 * np.pi * corner / rate
        pole = np.exp(-decay)
        held = (1.0 - pole) / decay
        self._forward = np.array([1.0 - held, held - pole])
        self._back = np.array([1.0, -pole])
        self._state: FloatArray | None = None

    def __call__(self, signal: FloatArray) -> FloatArray:
        """Return the next filtered samples; the input is assumed constant before the first one."""
        if self._state is None:
            self._state = np.array([(1.0 - self._forward[0]) * signal[0]])
        filtered, self._state = lfilter(self._forward, self._back, signal, zi=self._state)
        return np.asarray(filtered, dtype=np.float64)


class SimulatedProbe:
    """A probe and its conditioner.

    Parameters
    ----------
    calibration : Calibration
        Calibration of the probe.
    bench : SimulationSection
        Gap, noise, bandwidth and glitches.
    number : int
        Number of the probe: 0 for x, 1 for y.
    rate : float
        Sample rate, Hz.
    """

    def __init__(self, calibration: Calibration, bench: SimulationSection, number: int, rate: float) -> None:
        self._bench = bench
        self._number = number
        self._rate = rate
        self._gap_to_volts = GapToVolts(calibration)
        self._standing_gap = bench.gap_um[number] * MICROMETRE  # with the shaft in the bearing's centre
        self._noise = bench.sensor_noise_um * MICROMETRE * abs(self._gap_to_volts.slope(self._standing_gap))
        self._low_pass = FirstOrderLowPass(bench.sensor_bandwidth_hz, rate)

    def volts(self, portion: int, displacement: FloatArray) -> FloatArray:
        """Return the conditioner's output, V, in the next fixed portion of the run.

        Parameters
        ----------
        portion : int
            Its number; consecutive calls count from 0.
        displacement : ndarray of float64, shape (n,)
            Displacement of the shaft towards the probe, m.
        """
        gap = self._standing_gap - displacement - self._glitch(portion, displacement.size)
        volts = self._low_pass(self._gap_to_volts(gap))
        rng = random_stream(self._bench.seed, StreamPurpose.PROBE_NOISE, self._number, portion)
        return volts + self._noise * rng.standard_normal(displacement.size)

    def _glitch(self, portion: int, n: int) -> FloatArray | float:
        """Return the glitches of a portion, m: half sine waves too short to be shaft motion."""
        rng = random_stream(self._bench.seed, StreamPurpose.GLITCHES, self._number, portion)
        count = int(rng.poisson(self._bench.glitches_per_s * n / self._rate))
        length = min(max(int(GLITCH_LENGTH * self._rate), 1), n)
        if count == 0:
            return 0.0
        glitches = np.zeros(n)
        shape = np.sin(np.pi * (np.arange(length) + 0.5) / length)
        for start in rng.integers(0, n - length + 1, size=count):
            glitches[start : start + length] += self._bench.glitch_um * MICROMETRE * rng.standard_normal() * shape
        return glitches


TURN = 2.0 * np.pi
JITTER_BLOCK = 256  # edges whose jitter is drawn together


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedTacho:
    """The tacho's voltage as a function of time.

    Apart from jitter, the timed edge crosses the threshold ``delay`` after the mark passes at theta = 0.

    Parameters
    ----------
    tacho : Tacho
        Mark fraction, timed edge, delay and threshold.
    bench : SimulationSection
        Levels of the output, rise time, jitter and seed.
    speed_profile : SpeedProfile
        Speed of the shaft.
    """

    tacho: Tacho
    bench: SimulationSection
    speed_profile: SpeedProfile

    def volts(self, time: FloatArray) -> FloatArray:
        """Return the voltage, V, at rising times, s."""
        numbers, times = self._edges(time[0], time[-1])
        if times.size == 0:
            angle, _ = self.speed_profile.angle_and_speed(time[:1] - self.tacho.delay)
            return np.full(time.size, self._level_at(float(angle[0])))
        high, low, rise = self.bench.tacho_high_v, self.bench.tacho_low_v, self.bench.tacho_rise_us * MICROSECOND
        crossing = (self.tacho.threshold - low) / (high - low)
        rising = (numbers % 2 == 0) == (self.tacho.edge is Edge.RISING)
        before = np.where(rising, crossing, 1.0 - crossing) * rise
        corners = np.stack([times - before, times - before + rise], axis=1).ravel()
        levels = np.where(rising, high, low)
        ends = np.stack([high + low - levels, levels], axis=1).ravel()
        return np.asarray(np.interp(time, np.maximum.accumulate(corners), ends), dtype=np.float64)

    def timestamps(self, first: float, last: float, edge: Edge) -> FloatArray:
        """Return the times, s, of the rising or falling edges in [first, last), in order."""
        numbers, times = self._edges(first, last)
        stamped = (numbers % 2 == 0) == (self.tacho.edge is edge)
        return np.sort(times[stamped & (times >= first) & (times < last)])

    def _edges(self, first: float, last: float) -> tuple[NDArray[np.int64], FloatArray]:
        """Return numbers and times, s, of the edges that affect an interval; even numbers are the timed edges."""
        span = np.array([first, last]) - self.tacho.delay
        angles, _ = self.speed_profile.angle_and_speed(span)
        marks = np.floor(angles * self.tacho.pulses_per_revolution / TURN).astype(np.int64)
        numbers = np.arange(max(2 * (int(marks[0]) - 1), 0), 2 * (int(marks[1]) + 2), dtype=np.int64)
        in_marks = numbers // 2 + np.where(numbers % 2 == 0, 0.0, self._second_edge)
        times = self.speed_profile.time_at(in_marks * TURN / self.tacho.pulses_per_revolution)
        times = times + self.tacho.delay + self._jitter(numbers)
        known = np.isfinite(times)
        return numbers[known], times[known]

    @property
    def _second_edge(self) -> float:
        """Position of the other edge after the timed one, as a fraction of the distance between marks."""
        fraction = self.tacho.mark_fraction
        return fraction if self.tacho.edge is Edge.RISING else 1.0 - fraction

    def _level_at(self, angle: float) -> float:
        after_timed = angle * self.tacho.pulses_per_revolution / TURN % 1.0 < self._second_edge
        return self.bench.tacho_high_v if after_timed == (self.tacho.edge is Edge.RISING) else self.bench.tacho_low_v

    def _jitter(self, numbers: NDArray[np.int64]) -> FloatArray:
        """Return the jitter of consecutive edges, s."""
        blocks = range(int(numbers[0]) // JITTER_BLOCK, int(numbers[-1]) // JITTER_BLOCK + 1)
        drawn = [
            random_stream(self.bench.seed, StreamPurpose.TACHO_JITTER, block).standard_normal(JITTER_BLOCK)
            for block in blocks
        ]
        scatter = np.concatenate(drawn)[numbers - blocks[0] * JITTER_BLOCK]
        return np.asarray(self.bench.tacho_jitter_us * MICROSECOND * scatter, dtype=np.float64)
