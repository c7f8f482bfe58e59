"""The simulated sensors: a probe with its conditioner, and the tacho with its waveform."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from analysis.signals.header import Calibration, Edge, Tacho
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
    standing_gap : float
        Gap with the shaft in the bearing's centre, m.
    noise : float
        Noise of the conditioner, m rms.
    bandwidth : float
        Bandwidth of the conditioner, Hz.
    glitches : tuple of float
        Glitches per second, and the rms of their heights, m.
    rate : float
        Sample rate, Hz.
    key : tuple of int
        Seed of the run and number of the probe.
    """

    def __init__(
        self,
        calibration: Calibration,
        *,
        standing_gap: float,
        noise: float,
        bandwidth: float,
        glitches: tuple[float, float],
        rate: float,
        key: tuple[int, int],
    ) -> None:
        self._gap_to_volts = GapToVolts(calibration)
        self._standing_gap = standing_gap
        self._noise = noise * abs(self._gap_to_volts.slope(standing_gap))
        self._low_pass = FirstOrderLowPass(bandwidth, rate)
        self._glitches = glitches
        self._rate = rate
        self._seed, self._number = key

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
        rng = random_stream(self._seed, StreamPurpose.PROBE_NOISE, self._number, portion)
        return volts + self._noise * rng.standard_normal(displacement.size)

    def _glitch(self, portion: int, n: int) -> FloatArray | float:
        """Return the glitches of a portion, m: half sine waves too short to be shaft motion."""
        per_second, height = self._glitches
        rng = random_stream(self._seed, StreamPurpose.GLITCHES, self._number, portion)
        count = int(rng.poisson(per_second * n / self._rate))
        length = min(max(int(GLITCH_LENGTH * self._rate), 1), n)
        if count == 0:
            return 0.0
        glitches = np.zeros(n)
        shape = np.sin(np.pi * (np.arange(length) + 0.5) / length)
        for start in rng.integers(0, n - length + 1, size=count):
            glitches[start : start + length] += height * rng.standard_normal() * shape
        return glitches


TURN = 2.0 * np.pi
JITTER_BLOCK = 256  # edges whose jitter is drawn together


@dataclass(frozen=True, slots=True)
class TachoSignal:
    """Levels and imperfections of the tacho's output.

    Parameters
    ----------
    high, low : float
        Voltage with and without the mark in view, V.
    rise : float
        Time from one level to the other, s.
    jitter : float
        Jitter of each edge, s rms.
    """

    high: float
    low: float
    rise: float
    jitter: float


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedTacho:
    """The tacho's voltage as a function of time.

    Apart from jitter, the timed edge crosses the threshold ``delay`` after the mark passes at theta = 0.

    Parameters
    ----------
    tacho : Tacho
        Mark fraction, timed edge, delay and threshold.
    signal : TachoSignal
        Levels and imperfections.
    speed_profile : SpeedProfile
        Speed of the shaft.
    seed : int
        Seed of the run.
    """

    tacho: Tacho
    signal: TachoSignal
    speed_profile: SpeedProfile
    seed: int

    def volts(self, time: FloatArray) -> FloatArray:
        """Return the voltage, V, at rising times, s."""
        numbers, times = self._edges(time[0], time[-1])
        if times.size == 0:
            angle, _ = self.speed_profile.angle_and_speed(time[:1] - self.tacho.delay)
            return np.full(time.size, self._level_at(float(angle[0])))
        crossing = (self.tacho.threshold - self.signal.low) / (self.signal.high - self.signal.low)
        rising = (numbers % 2 == 0) == (self.tacho.edge is Edge.RISING)
        before = np.where(rising, crossing, 1.0 - crossing) * self.signal.rise
        corners = np.stack([times - before, times - before + self.signal.rise], axis=1).ravel()
        levels = np.where(rising, self.signal.high, self.signal.low)
        ends = np.stack([self.signal.high + self.signal.low - levels, levels], axis=1).ravel()
        return np.asarray(np.interp(time, np.maximum.accumulate(corners), ends), dtype=np.float64)

    def stamps(self, first: float, last: float, edge: Edge) -> FloatArray:
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
        return self.signal.high if after_timed == (self.tacho.edge is Edge.RISING) else self.signal.low

    def _jitter(self, numbers: NDArray[np.int64]) -> FloatArray:
        """Return the jitter of consecutive edges, s."""
        blocks = range(int(numbers[0]) // JITTER_BLOCK, int(numbers[-1]) // JITTER_BLOCK + 1)
        drawn = [
            random_stream(self.seed, StreamPurpose.TACHO_JITTER, block).standard_normal(JITTER_BLOCK)
            for block in blocks
        ]
        scatter = np.concatenate(drawn)[numbers - blocks[0] * JITTER_BLOCK]
        return np.asarray(self.signal.jitter * scatter, dtype=np.float64)
