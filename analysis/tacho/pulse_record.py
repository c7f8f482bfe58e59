"""The pulses of a whole record: counted forward and backward in time, and refused where the two counts differ.

Takes times of pulses, whether found in a waveform (`analysis.tacho.edges`) or stamped by a counter.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.signals.errors import TachoRefusedError
from analysis.signals.header import Tacho
from analysis.tacho.mark_spacing import MAX_INTERVAL_RATIO, interval_ratios, reference_mark
from analysis.tacho.pulse_train import HISTORY, MAX_REPAIRED, PulseTrain

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MIN_PULSES = 8
MIN_GAPS = 3
MAX_PERIODIC_GAPS = (
    0.5  # part of the places at one distance from one another where pulses are missing: no chance made these
)
MIN_TRAIN_FRACTION = 0.9  # part of the pulses that one train must hold: less is a shaft that stood still between


@dataclass(frozen=True, slots=True, eq=False)
class PulseRecord:
    """The pulses of one uninterrupted train.

    Parameters
    ----------
    numbers : ndarray of int64, shape (n,)
        Number of each pulse, rising; where pulses were missing it skips.
    times : ndarray of float64, shape (n,)
        Their times, s, rising, the sensor's delay taken off.
    pulses_per_revolution : int
        Marks on the shaft; pulses whose number divides by it lie at theta = 0: those after the longest interval where
        it is clearly the longest, else those of the first mark seen.
    edges : int
        Edges given in the train's span.
    filled : int
        Pulses that were missing and counted as passed.
    rejected : int
        Edges that were doubles or noise.
    too_fast : bool
        Whether light or dark lasted less than the sensor's response anywhere: pulses may be missing unnoticed.
    mark_is_arbitrary : bool
        Whether theta = 0 is the first mark seen of several that cannot be told apart: phases hold in this record only.
    """

    numbers: IntArray
    times: FloatArray
    pulses_per_revolution: int
    edges: int
    filled: int
    rejected: int
    too_fast: bool
    phase_reference_is_arbitrary: bool = False

    @property
    def repaired_fraction(self) -> float:
        """Pulses filled or rejected over pulses counted, the quality of the record: 0 is best."""
        return (self.filled + self.rejected) / max(int(self.numbers[-1] - self.numbers[0]), 1)


def pulse_record(times: FloatArray, tacho: Tacho) -> PulseRecord:
    """Return the longest train of pulses in a record, each numbered.

    Where every interval is like that of the same mark a revolution before, the marks may lie anywhere on the shaft.
    Else something is missing or double, and the marks must be about evenly spaced for that to be told: the
    predictive gate of `PulseTrain` runs over the pulses forward and, with time reversed, backward: a pulse counts
    where both accept it. Where the two come to different counts between two pulses, a repair would be guessing.

    Parameters
    ----------
    times : ndarray of float64, shape (n,)
        Times of the edges, s, rising; of a counter's stamps or of `EdgeDetector.edges` over the rate.
    tacho : Tacho
        Marks, response time and delay; the delay is taken off.

    Raises
    ------
    TachoRefusedError
        Too few pulses, no regular train, a count that differs forward and backward, or too many repairs.
    ValueError
        Times that are not finite or do not rise.

    Notes
    -----
    The counts forward and backward, and the refusal where they differ, are this program's own; what missing and false
    pulses do otherwise is told by K. Fyfe and E. Munck, MSSP 11(2), 1997.
    """
    times = np.asarray(times, dtype=np.float64)
    if times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
        raise ValueError(f"times: shape {times.shape}, expected (n,) finite and rising, s")
    if times.size < MIN_PULSES:
        raise TachoRefusedError(f"{times.size} tacho pulses in the record, expected at least {MIN_PULSES}")
    if _is_clean(np.diff(times), tacho.pulses_per_revolution):
        return _record(np.arange(times.size), times, times.size, tacho)
    single = replace(tacho, pulses_per_revolution=1)
    forward = max(_trains(times, single), key=lambda train: train[0].size, default=None)
    backward = max(_trains(-times[::-1], single), key=lambda train: train[0].size, default=None)
    if forward is None or backward is None:
        raise TachoRefusedError(f"none of {times.size} tacho edges make a regular train: noise, or no shaft")
    back_numbers, back_times = -backward[0][::-1], -backward[1][::-1]
    numbers, kept = _merge_counts(forward, (back_numbers, back_times))
    begin, end = np.searchsorted(times, [kept[0], kept[-1]])
    seen = int(end - begin) + 1
    if seen < MIN_TRAIN_FRACTION * times.size and forward[0].size < MIN_TRAIN_FRACTION * times.size - MIN_PULSES:
        raise TachoRefusedError(
            f"the longest regular train holds {seen} of {times.size} tacho edges, from {kept[0]:.3f} to "
            f"{kept[-1]:.3f} s: analyse the record in parts between the breaks"
        )
    numbers = numbers - numbers[0]
    _refuse_many_repairs(numbers, kept, times[begin : end + 1], tacho.pulses_per_revolution)
    return _record(numbers, kept, seen, tacho)


def _is_clean(intervals: FloatArray, marks: int) -> bool:
    """Return whether nothing is missing or double: each interval is like that of the same mark a revolution before."""
    if intervals.size < 2 * marks + 1:
        return False
    ratios = intervals[marks:] / intervals[:-marks]
    return bool(ratios.max() < MAX_INTERVAL_RATIO and ratios.min() > 1.0 / MAX_INTERVAL_RATIO)


def _record(numbers: IntArray, times: FloatArray, seen: int, tacho: Tacho) -> PulseRecord:
    period = np.diff(times) / np.diff(numbers)
    shortest = float(period.min()) * min(tacho.mark_fraction, 1.0 - tacho.mark_fraction)
    marks = tacho.pulses_per_revolution
    parts = interval_ratios(numbers, times, marks) if marks > 1 else np.ones(1)
    mark = None if parts is None else reference_mark(parts)
    return PulseRecord(
        numbers=numbers if mark is None else numbers + (-mark) % marks,
        times=times - tacho.delay,
        pulses_per_revolution=marks,
        edges=seen,
        filled=int(numbers[-1]) + 1 - numbers.size,
        rejected=seen - numbers.size,
        too_fast=shortest < tacho.response_time,
        phase_reference_is_arbitrary=mark is None,
    )


def _trains(times: FloatArray, tacho: Tacho) -> Iterator[tuple[IntArray, FloatArray]]:
    ended: list[tuple[tuple[int, float], ...]] = []
    train = PulseTrain(tacho, times.size, ended.append)
    train.advance(times, float(times[-1]), float(times[-1] - times[0]), np.inf)
    train.restart()  # ends the last one
    for marks in ended:
        yield np.array([mark[0] for mark in marks], dtype=np.int64), np.array([mark[1] for mark in marks])


def _merge_counts(
    forward: tuple[IntArray, FloatArray], backward: tuple[IntArray, FloatArray]
) -> tuple[IntArray, FloatArray]:
    """Return numbers and times of the pulses of both trains, and of the one where the other has not begun."""
    common, in_forward, in_backward = np.intersect1d(forward[1], backward[1], return_indices=True)
    if common.size < MIN_PULSES:
        raise TachoRefusedError(
            "the tacho's pulses make several trains: analyse the record in parts between the breaks"
        )
    offset = forward[0][in_forward] - backward[0][in_backward]
    if (offset != offset[0]).any():
        slips = np.flatnonzero(np.diff(offset))
        raise TachoRefusedError(
            f"tacho: the pulses counted forward and backward differ by {abs(int(offset[-1] - offset[0]))}, in "
            f"{slips.size} places from {float(common[slips[0] + 1]):.4f} s on: too many are missing or double there to "
            "know the angle"
        )
    before = backward[1] < forward[1][0]
    after = forward[1] > backward[1][-1]
    numbers = np.concatenate([backward[0][before] + offset[0], forward[0][in_forward], forward[0][after]])
    times = np.concatenate([backward[1][before], common, forward[1][after]])
    return numbers, times


def _refuse_many_repairs(numbers: IntArray, times: FloatArray, edges: FloatArray, marks: int) -> None:
    """Raise where more than the live tracker would bear needed a repair, or the same did again and again."""
    repaired = int(numbers[-1] - numbers[0]) + 1 - numbers.size + edges.size - times.size
    allowed = MAX_REPAIRED / HISTORY * numbers.size
    if repaired > allowed:
        raise TachoRefusedError(
            f"tacho: {repaired} of {numbers.size} pulses are missing or double, expected at most {int(allowed)}"
        )
    is_gap = np.zeros(int(numbers[-1]), dtype=np.bool_)
    is_gap[numbers[:-1][np.diff(numbers) > 1]] = True
    for distance in range(2, min(2 * marks, is_gap.size // MIN_GAPS) + 1):
        again = np.count_nonzero(is_gap[distance:] & is_gap[:-distance])
        if distance % marks and again > max(MAX_PERIODIC_GAPS * is_gap.size / distance, MIN_GAPS):
            raise TachoRefusedError(
                f"tacho: a pulse is missing every {distance}: expected a pattern that repeats with the {marks} marks "
                "of a revolution"
            )
