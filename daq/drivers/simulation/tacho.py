"""The waveform of the simulated tacho: a light mark on the shaft, seen late, with jitter and in a finite time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import Edge, Tacho
from daq.drivers.simulation.random_streams import Purpose, draws
from daq.drivers.simulation.speed import SpeedCourse

FloatArray = NDArray[np.float64]
TURN = 2.0 * np.pi
PORTION = 256  # edges drawn together


@dataclass(frozen=True, slots=True)
class TachoSignal:
    """Levels and imperfections of the tacho's output.

    Parameters
    ----------
    high, low : float
        Voltage with the mark in view and without, V.
    rise : float
        Time from one level to the other, s.
    jitter : float
        Scatter of each edge, s rms.
    """

    high: float
    low: float
    rise: float
    jitter: float


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedTacho:
    """The tacho's voltage as a function of time.

    The timed edge crosses the tacho's threshold ``delay`` after the mark passed at theta = 0, but for its jitter.

    Parameters
    ----------
    tacho : Tacho
        How it is read: mark, edge, delay, threshold.
    signal : TachoSignal
        Levels and imperfections.
    course : SpeedCourse
        Of the shaft.
    seed : int
        Of the run.
    """

    tacho: Tacho
    signal: TachoSignal
    course: SpeedCourse
    seed: int

    def volts(self, time: FloatArray) -> FloatArray:
        """Return the voltage, V, at rising times, s."""
        numbers, moments = self._edges(time[0], time[-1])
        if moments.size == 0:
            angle, _ = self.course.at(time[:1] - self.tacho.delay)
            return np.full(time.size, self._level_at(float(angle[0])))
        crossing = (self.tacho.threshold - self.signal.low) / (self.signal.high - self.signal.low)
        rising = (numbers % 2 == 0) == (self.tacho.edge is Edge.RISING)
        before = np.where(rising, crossing, 1.0 - crossing) * self.signal.rise
        corners = np.stack([moments - before, moments - before + self.signal.rise], axis=1).ravel()
        levels = np.where(rising, self.signal.high, self.signal.low)
        ends = np.stack([self.signal.high + self.signal.low - levels, levels], axis=1).ravel()
        return np.asarray(np.interp(time, np.maximum.accumulate(corners), ends), dtype=np.float64)

    def stamps(self, first: float, last: float, edge: Edge) -> FloatArray:
        """Return the moments, s, of the edges of one kind from a time on and before another, s, rising."""
        numbers, moments = self._edges(first, last)
        stamped = (numbers % 2 == 0) == (self.tacho.edge is edge)
        return np.sort(moments[stamped & (moments >= first) & (moments < last)])

    def _edges(self, first: float, last: float) -> tuple[NDArray[np.int64], FloatArray]:
        """Return numbers and moments, s, of the edges that matter between two times; even numbers are timed."""
        span = np.array([first, last]) - self.tacho.delay
        angles, _ = self.course.at(span)
        marks = np.floor(angles * self.tacho.pulses_per_revolution / TURN).astype(np.int64)
        numbers = np.arange(max(2 * (int(marks[0]) - 1), 0), 2 * (int(marks[1]) + 2), dtype=np.int64)
        in_marks = numbers // 2 + np.where(numbers % 2 == 0, 0.0, self._second_edge)
        moments = self.course.time_of(in_marks * TURN / self.tacho.pulses_per_revolution)
        moments = moments + self.tacho.delay + self._jitter(numbers)
        known = np.isfinite(moments)
        return numbers[known], moments[known]

    @property
    def _second_edge(self) -> float:
        """Where the edge that is not timed follows, as part of the distance between marks."""
        fraction = self.tacho.mark_fraction
        return fraction if self.tacho.edge is Edge.RISING else 1.0 - fraction

    def _level_at(self, angle: float) -> float:
        after_timed = angle * self.tacho.pulses_per_revolution / TURN % 1.0 < self._second_edge
        return self.signal.high if after_timed == (self.tacho.edge is Edge.RISING) else self.signal.low

    def _jitter(self, numbers: NDArray[np.int64]) -> FloatArray:
        """Return the scatter of consecutive edges, s."""
        portions = range(int(numbers[0]) // PORTION, int(numbers[-1]) // PORTION + 1)
        drawn = [draws(self.seed, Purpose.TACHO_JITTER, portion).standard_normal(PORTION) for portion in portions]
        scatter = np.concatenate(drawn)[numbers - portions[0] * PORTION]
        return np.asarray(self.signal.jitter * scatter, dtype=np.float64)
