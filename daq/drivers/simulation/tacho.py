"""The waveform of the simulated tacho: a light keyphasor mark, seen with delay, jitter and a finite rise time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import Edge, Tacho
from daq.drivers.simulation.random_streams import StreamPurpose, random_stream
from daq.drivers.simulation.speed import SpeedProfile

FloatArray = NDArray[np.float64]
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
