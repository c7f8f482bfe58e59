"""Pulse train of the tacho: assigns edges to pulses, counts missing and rejected ones, and derives speed and state."""

from collections import deque
from collections.abc import Callable

import numpy as np

from analysis.signals import FloatArray, IntArray
from analysis.signals.header import Tacho
from analysis.signals.snapshot import TachoReport, TachoState
from analysis.tacho.mark_spacing import MarkSpacing

GATE = 0.3  # of the predicted period: largest distance of an edge from its prediction
GATE_AFTER_GAP = 0.25  # the same after missing pulses
MAX_MISSING_PULSES = 2  # successive missing pulses that are counted
SEED_INTERVALS = 4  # similar intervals that start a train
MAX_SEED_RATIO = 1.25  # of successive intervals
MIN_TRAIN_PULSES = SEED_INTERVALS + 1  # pulses of a train before its speed is reported
MIN_TRAIN_REVOLUTIONS, MIN_MULTI_MARK_PULSES = 6, 64  # the same with several marks of unknown spacing
MAX_REJECTED_EDGES = 20  # without a train; each requires one more pulse before the speed is reported
MAX_INTERVAL_CHANGE = 0.05  # relative change from one interval to the next of pulses accepted without the gate
MAX_SUCCESSIVE_REPAIRS = 4  # then the train is assigned wrongly and is dropped
MAX_REJECTED_AT_START = 2  # with more edges without a train the state is irregular, with fewer no pulses
MAX_REJECTED_BETWEEN_PULSES = 10  # edges between two pulses
HISTORY, MAX_REPAIRED = 64, 8  # of the last pulses
MAX_JITTER = 0.05  # of the pulses' period
NO_PULSE_TIMEOUT = 2.0  # s without an edge
MIN_SAMPLES_PER_PULSE = 20  # with more edges than that the signal is noise


class PulseTrain:
    """Tracks the tacho pulses with a predictive gate.

    Four similar intervals start a train. Each further edge is compared with the time extrapolated from the last eight
    intervals (medians of the older and the newer half, so that a wrongly accepted edge has little effect):

    - near the prediction it is the next pulse;
    - too early it is rejected as a double, unless it lies nearer to the prediction than the accepted one;
    - one or two periods too late, the pulses between were missing and are counted;
    - anything else ends the train, and a new one is sought.

    Where every second or third pulse begins to be missing, the sensor response is exceeded: the state of the slower
    train that follows is `TachoState.TOO_FAST`.

    Several marks may lie anywhere on the shaft: their spacing is learned from the first revolutions without a fault
    (`tacho.mark_spacing`), and intervals are then divided by their ratio to the mean. Where one interval is clearly
    the longest, theta = 0 is the mark at its end; else it is the first mark seen of every train.

    Parameters
    ----------
    tacho : Tacho
        Marks on the shaft and response time of the sensor.
    revolutions : int
        Number of once-per-turn marks to store.
    on_end : callable or None
        Called with the stored marks, number and time, s, of every train that ends.
    """

    def __init__(
        self,
        tacho: Tacho,
        revolutions: int,
        on_end: Callable[[tuple[tuple[int, float], ...]], None] | None = None,
    ) -> None:
        self._tacho = tacho
        self._on_end = on_end
        self._spacing = MarkSpacing(tacho.pulses_per_revolution)
        self._marks: deque[tuple[int, float]] = deque(maxlen=revolutions)
        self._seed: deque[float] = deque(maxlen=SEED_INTERVALS + 1)  # or a whole revolution of uneven marks
        self._intervals: deque[float] = deque(maxlen=2 * SEED_INTERVALS)
        self._repaired: deque[bool] = deque(maxlen=HISTORY)
        self._recently_skipped: deque[int] = deque(maxlen=MAX_SUCCESSIVE_REPAIRS)
        self._pulses = self._filled = self._rejected = 0
        self.restart()

    def restart(self) -> None:
        """Drop the train but not the counts: the next edge does not follow the last."""
        self._last_edge = -np.inf
        self._unexplained_edges = 0  # edges that started no train
        self._is_flooded = False
        self._repaired.clear()
        self._spacing.forget_edges()
        self._drop_train()

    def _drop_train(self) -> None:
        if self._on_end is not None and self._marks:
            self._on_end(tuple(self._marks))
        self._locked = False
        self._number = 0  # of the last pulse in its train
        self._time = self._before = self._predicted = 0.0
        self._skipped = 1  # periods between the last pulse and the one before,
        self._span = 1.0  # and their length in mean intervals
        self._repairs_in_a_row = self._rejected_since = 0
        self._has_periodic_missing_pulses = False  # whether every nth pulse was missing in the train before
        self._seed.clear()
        self._intervals.clear()
        self._marks.clear()

    def advance(self, edges: FloatArray, now: float, elapsed: float, rate: float) -> None:
        """Add the edges of the next stretch of time.

        Parameters
        ----------
        edges : ndarray of float64, shape (n,)
            Times of the edges, s, rising.
        now : float
            End of the stretch, s.
        elapsed : float
            Length of the stretch, s.
        rate : float
            Sample rate, Hz.
        """
        self._is_flooded = edges.size > 8 + elapsed * rate / MIN_SAMPLES_PER_PULSE
        if self._is_flooded:
            self._rejected += edges.size
            self._last_edge = now
            self._unexplained_edges = MAX_REJECTED_EDGES
            self._spacing.forget_edges()
            self._drop_train()
            return
        if self._spacing.add_edges(edges) and not self._spacing.is_evenly_spaced:
            self._unexplained_edges = 0
            self._drop_train()
            self._seed = deque(maxlen=max(SEED_INTERVALS, self._tacho.pulses_per_revolution) + 1)
        for time in edges[self._accept_clean(edges) :].tolist():
            self._add_edge(time)
            self._last_edge = time
        if self._locked and now - self._time > self._expected(MAX_MISSING_PULSES + 1) + GATE * self._expected(1):
            self._drop_train()
        if now - self._last_edge > NO_PULSE_TIMEOUT:
            self._unexplained_edges = 0
            self._drop_train()

    def _accept_clean(self, edges: FloatArray) -> int:
        """Accept a stretch of regular pulses at once, except the last few; return how many.

        The gate would accept the same pulses one by one, as each interval is similar to the one before.
        """
        n = edges.size - (self._intervals.maxlen or 0) - 1
        if n < 1 or not self._locked or self._repairs_in_a_row or self._rejected_since:
            return 0
        times = np.concatenate([[self._time], edges[:n]])
        numbers = self._number + np.arange(1, n + 1)
        turns, rests = np.divmod(numbers, self._tacho.pulses_per_revolution)
        intervals = np.diff(times) / self._spacing.ratios[rests]
        before = np.concatenate([[sum(self._trend())], intervals[:-1]])
        if (np.abs(intervals - before) > MAX_INTERVAL_CHANGE * before).any():
            return 0
        marked = np.flatnonzero(rests == 0)[-(self._marks.maxlen or n) :]
        self._marks.extend(zip(turns[marked].tolist(), edges[marked].tolist(), strict=True))
        self._repaired.extend([False] * min(n, HISTORY))
        self._recently_skipped.extend([1] * min(n, MAX_SUCCESSIVE_REPAIRS))
        self._intervals.extend(intervals.tolist())
        self._pulses += n
        self._number += n
        self._before, self._time = float(times[-2]), float(times[-1])
        self._skipped, self._predicted = 1, self._time
        self._span = float(self._spacing.ratios[rests[-1]])
        self._unexplained_edges = max(self._unexplained_edges - n, 0)
        return n

    def _expected(self, periods: int) -> float:
        """Return the predicted time from the last pulse to the one ``periods`` later, s."""
        return self._time_ahead(periods, *self._trend())

    def _time_ahead(self, periods: int, last: float, slope: float) -> float:
        return self._mean_intervals(periods) * last + slope * 0.5 * periods * (periods + 1)

    def _mean_intervals(self, periods: int) -> float:
        """Return the length of the next periods in mean intervals."""
        if self._spacing.is_evenly_spaced:
            return periods
        marks = (self._number + np.arange(1, periods + 1)) % self._tacho.pulses_per_revolution
        return float(self._spacing.ratios[marks].sum())

    def _trend(self) -> tuple[float, float]:
        """Return the smoothed last interval, as a mean interval, and its change per interval.

        Uses medians of the older and the newer intervals, so that one of each may be wrong.
        """
        intervals = list(self._intervals)
        n, half = len(intervals), len(intervals) // 2
        older, newer = _median(intervals[:half]), _median(intervals[half:])
        slope = min(max((newer - older) / (0.5 * n), -0.2 * newer), 0.2 * newer)
        return newer + 0.5 * (n - half - 1) * slope, slope

    def _add_edge(self, time: float) -> None:
        if not self._locked:
            self._seek_train(time)
            return
        since = time - self._time
        last, slope = self._trend()
        period = (last + slope) * self._spacing.shortest_ratio
        if since < self._time_ahead(1, last, slope) - GATE * period:
            self._double(time)
            return
        for periods in range(1, MAX_MISSING_PULSES + 2):
            gate = GATE if periods == 1 else GATE_AFTER_GAP
            expected = self._time_ahead(periods, last, slope)
            if abs(since - expected) <= gate * period:
                self._accept(time, periods, self._time + expected)
                return
        if since < self._expected(MAX_MISSING_PULSES + 1):
            self._reject()
        else:
            self._unexplained_edges = min(self._unexplained_edges + SEED_INTERVALS, MAX_REJECTED_EDGES)
            self._drop_train()
            self._seek_train(time)

    def _seek_train(self, time: float) -> None:
        if len(self._seed) == self._seed.maxlen:
            self._rejected += 1
            self._unexplained_edges = min(self._unexplained_edges + 1, MAX_REJECTED_EDGES)
        self._seed.append(time)
        intervals = np.diff(self._seed)
        if intervals.size < (self._seed.maxlen or 0) - 1 or intervals.min() <= 0.0:
            return
        ends_first = self._spacing.first_mark(intervals, MAX_SEED_RATIO)
        if ends_first is None:
            return
        marks = self._tacho.pulses_per_revolution
        begin = (ends_first - 1) % marks if not self._spacing.is_evenly_spaced else 0
        numbers = begin + np.arange(len(self._seed))
        parts = self._spacing.ratios[numbers % marks]
        self._locked = True
        self._intervals.extend((intervals / parts[1:]).tolist())
        self._pulses += len(self._seed)
        self._number, self._span = int(numbers[-1]), float(parts[-1])
        self._before, self._time = self._seed[-2], self._seed[-1]
        self._predicted = self._time
        for number, seed in zip(numbers.tolist(), self._seed, strict=True):
            self._add_mark(number, seed)

    def _add_mark(self, number: int, time: float) -> None:
        turn, rest = divmod(number, self._tacho.pulses_per_revolution)
        if rest == 0:
            self._marks.append((turn, time))

    def _accept(self, time: float, periods: int, predicted: float) -> None:
        is_repair = periods > 1 or self._rejected_since > 0
        self._repairs_in_a_row = self._repairs_in_a_row + 1 if is_repair else 0
        self._repaired.append(is_repair)
        self._pulses += 1
        self._filled += periods - 1
        self._rejected_since = 0
        self._span = self._mean_intervals(periods)
        self._intervals.extend([(time - self._time) / self._span] * periods)
        self._number += periods
        self._before, self._time = self._time, time
        self._skipped, self._predicted = periods, predicted
        self._recently_skipped.append(periods)
        self._add_mark(self._number, time)
        if not is_repair:
            self._unexplained_edges = max(self._unexplained_edges - 1, 0)
        if self._repairs_in_a_row >= MAX_SUCCESSIVE_REPAIRS:
            has_periodic_missing_pulses = len(set(self._recently_skipped)) == 1 and periods > 1
            self._unexplained_edges = 0 if has_periodic_missing_pulses else MAX_REJECTED_EDGES
            self._drop_train()
            self._has_periodic_missing_pulses = has_periodic_missing_pulses

    def _double(self, time: float) -> None:
        is_better = abs(time - self._predicted) < abs(self._time - self._predicted)
        if is_better:
            was_mark = self._number % self._tacho.pulses_per_revolution == 0
            for _ in range(self._skipped):
                self._intervals.pop()
            self._time = time
            interval = (time - self._before) / self._span
            self._intervals.extend([interval] * self._skipped)
            if was_mark:
                self._marks.pop()
                self._add_mark(self._number, time)
            self._rejected += 1
            self._repaired.append(True)
            return
        self._reject()

    def _reject(self) -> None:
        self._rejected += 1
        self._rejected_since += 1
        if self._rejected_since > MAX_REJECTED_BETWEEN_PULSES:
            self._unexplained_edges = MAX_REJECTED_EDGES
            self._drop_train()

    @property
    def marks(self) -> tuple[IntArray, FloatArray]:
        """Revolution number and time, s, of the last once-per-turn marks of the train, without the missing ones."""
        turns = np.array([turn for turn, _ in self._marks], dtype=np.int64)
        return turns, np.array([time for _, time in self._marks], dtype=np.float64)

    @property
    def is_settled(self) -> bool:
        """Whether the train is long enough to report its speed."""
        marks = self._tacho.pulses_per_revolution
        needed = (
            MIN_TRAIN_PULSES if self._spacing.is_known else max(MIN_TRAIN_REVOLUTIONS * marks, MIN_MULTI_MARK_PULSES)
        )
        return self._locked and self._number + 1 >= needed + self._unexplained_edges

    def speed(self, interval: float) -> float:
        """Return the mean speed, rad/s, over the last whole revolutions that fill ``interval`` seconds, at least one.

        NaN without a settled train.
        """
        if not self.is_settled or len(self._marks) < 2:
            return np.nan
        turns, times = self.marks
        first = max(int(np.searchsorted(times, times[-1] - interval, side="right")) - 1, 0)
        first = min(first, times.size - 2)
        return float(2.0 * np.pi * (turns[-1] - turns[first]) / (times[-1] - times[first]))

    def state(self, now: float, speed: float, jitter: float) -> TachoState:
        """Return the state of the tacho.

        Parameters
        ----------
        now : float
            End of the samples, s.
        speed : float
            From `speed`, rad/s.
        jitter : float
            Scatter of the edges about the smooth angle, s; NaN where unknown.
        """
        if now - self._last_edge > NO_PULSE_TIMEOUT:
            return TachoState.NO_PULSES
        if self._is_flooded or not self.is_settled or np.isnan(speed):
            return TachoState.IRREGULAR if self._unexplained_edges > MAX_REJECTED_AT_START else TachoState.NO_PULSES
        period = 2.0 * np.pi / (speed * self._tacho.pulses_per_revolution)
        if sum(self._repaired) > MAX_REPAIRED or jitter > MAX_JITTER * period:
            return TachoState.IRREGULAR
        fraction = min(self._tacho.mark_fraction, 1.0 - self._tacho.mark_fraction)
        if self._has_periodic_missing_pulses or fraction * period < self._tacho.response_time:
            return TachoState.TOO_FAST
        return TachoState.GOOD

    def report(self, state: TachoState, jitter: float) -> TachoReport:
        """Return the state with the counts since the start of the run and the scatter, s."""
        arbitrary = not self._spacing.has_reference
        return TachoReport(
            state, self._pulses, self._filled, self._rejected, jitter, phase_reference_is_arbitrary=arbitrary
        )


def _median(values: list[float]) -> float:
    ordered = sorted(values)
    middle = len(ordered) // 2
    return ordered[middle] if len(ordered) % 2 else 0.5 * (ordered[middle - 1] + ordered[middle])
