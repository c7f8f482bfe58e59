"""Pulse numbers of a whole record, from edge times of a waveform (`analysis.tacho.edges`) or of a counter.

Pulses are counted forward and backward in time; a record whose two counts differ is refused.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from analysis.signals import FloatArray, IntArray
from analysis.signals.errors import AmbiguousTachoError
from analysis.signals.header import Tacho
from analysis.tacho.mark_spacing import MAX_INTERVAL_RATIO, interval_ratios, reference_mark
from analysis.tacho.pulse_train import HISTORY, MAX_REPAIRED, PulseTrain

MIN_PULSES = 8
MIN_MISSING_PULSES = 3  # at the same distance, to count as periodic
MAX_PERIODIC_MISSING_FRACTION = 0.5  # fraction of every nth pulse that may be missing: more is no coincidence
MIN_TRAIN_FRACTION = 0.9  # of all edges that one train must contain: with less the shaft stood still in between


@dataclass(frozen=True, slots=True, eq=False)
class PulseRecord:
    """Numbered pulses of one uninterrupted train.

    Parameters
    ----------
    numbers : ndarray of int64, shape (n,)
        Number of each pulse, rising; missing pulses are skipped.
    times : ndarray of float64, shape (n,)
        Their times, s, rising, corrected for the sensor delay.
    pulses_per_revolution : int
        Keyphasor marks on the shaft. Pulses whose number is a multiple of it lie at theta = 0: those after the longest
        interval where one is clearly the longest, else those of the first mark seen.
    edges : int
        Edges within the span of the train.
    filled : int
        Missing pulses that were counted.
    rejected : int
        Edges rejected as doubles or noise.
    too_fast : bool
        Whether light or dark was shorter than the sensor response anywhere: pulses may be missing unnoticed.
    phase_reference_is_arbitrary : bool
        Whether theta = 0 is the first mark seen of several indistinguishable ones: phases hold in this record only.
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
        """Filled and rejected pulses over counted pulses: 0 is best."""
        return (self.filled + self.rejected) / max(int(self.numbers[-1] - self.numbers[0]), 1)


def pulse_record(times: FloatArray, tacho: Tacho) -> PulseRecord:
    """Return the longest train of pulses in a record, numbered.

    Where the intervals repeat from revolution to revolution, nothing is missing and the keyphasor marks may lie
    anywhere on the shaft. Otherwise pulses are missing or double, and the marks must be about evenly spaced to find
    out which: the predictive gate of `PulseTrain` runs over the pulses forward and, with time reversed, backward.
    Pulses that both accept are counted. Where the two counts between two pulses differ, a repair would be guessing.

    Parameters
    ----------
    times : ndarray of float64, shape (n,)
        Times of the edges, s, in order: counter timestamps, or those of `edge_detector` over the sample rate.
    tacho : Tacho
        Marks, response time and delay; the delay is subtracted.

    Raises
    ------
    AmbiguousTachoError
        Times that fall, too few pulses, no regular train, different counts forward and backward, or too many
        repairs.
    ValueError
        Times that are not finite.

    Notes
    -----
    The comparison of the two counts is a method of this program. For the effect of missing and false pulses see
    K. Fyfe and E. Munck, MSSP 11(2), 1997.
    """
    times = np.asarray(times, dtype=np.float64)
    if times.ndim != 1 or not np.isfinite(times).all():
        raise ValueError(f"times: shape {times.shape}, expected (n,) finite, s")
    falls = np.flatnonzero(np.diff(times) < 0.0)
    if falls.size:
        raise AmbiguousTachoError(
            f"tacho: pulse {falls[0] + 1} at {times[falls[0] + 1]:.6f} s, expected after {times[falls[0]]:.6f} s, the "
            "time of the pulse before"
        )
    edges, times = times, np.unique(times)  # a counter may deliver one timestamp twice: the second edge is rejected
    if times.size < MIN_PULSES:
        raise AmbiguousTachoError(f"{times.size} tacho pulses in the record, expected at least {MIN_PULSES}")
    if _is_clean(np.diff(times), tacho.pulses_per_revolution):
        return _record(np.arange(times.size), times, edges.size, tacho)
    single = replace(tacho, pulses_per_revolution=1)
    forward = max(_trains(times, single), key=lambda train: train[0].size, default=None)
    backward = max(_trains(-times[::-1], single), key=lambda train: train[0].size, default=None)
    if forward is None or backward is None:
        raise AmbiguousTachoError(f"{times.size} tacho edges contain no regular pulse train, expected one: noise?")
    back_numbers, back_times = -backward[0][::-1], -backward[1][::-1]
    numbers, pulse_times = _merge_counts(forward, (back_numbers, back_times))
    begin, end = np.searchsorted(times, [pulse_times[0], pulse_times[-1]])
    n_edges = int(end - begin) + 1
    if n_edges < MIN_TRAIN_FRACTION * times.size and forward[0].size < MIN_TRAIN_FRACTION * times.size - MIN_PULSES:
        raise AmbiguousTachoError(
            f"the longest regular train holds {n_edges} of {times.size} tacho edges, from {pulse_times[0]:.3f} to "
            f"{pulse_times[-1]:.3f} s: analyse the record in parts between the breaks"
        )
    numbers = numbers - numbers[0]
    _refuse_many_repairs(numbers, pulse_times, times[begin : end + 1], tacho.pulses_per_revolution)
    n_repeated = np.diff(np.searchsorted(edges, [pulse_times[0], pulse_times[-1]])).item() + 1 - n_edges
    return _record(numbers, pulse_times, n_edges + n_repeated, tacho)


def _is_clean(intervals: FloatArray, marks: int) -> bool:
    """Return whether no pulse is missing or double: the intervals repeat from revolution to revolution."""
    if intervals.size < 2 * marks + 1:
        return False
    ratios = intervals[marks:] / intervals[:-marks]
    return bool(ratios.max() < MAX_INTERVAL_RATIO and ratios.min() > 1.0 / MAX_INTERVAL_RATIO)


def _record(numbers: IntArray, times: FloatArray, n_edges: int, tacho: Tacho) -> PulseRecord:
    period = np.diff(times) / np.diff(numbers)
    shortest = float(period.min()) * min(tacho.mark_fraction, 1.0 - tacho.mark_fraction)
    marks = tacho.pulses_per_revolution
    parts = interval_ratios(numbers, times, marks) if marks > 1 else np.ones(1)
    mark = None if parts is None else reference_mark(parts)
    return PulseRecord(
        numbers=numbers if mark is None else numbers + (-mark) % marks,
        times=times - tacho.delay,
        pulses_per_revolution=marks,
        edges=n_edges,
        filled=int(numbers[-1]) + 1 - numbers.size,
        rejected=n_edges - numbers.size,
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
    """Return numbers and times of the pulses common to both trains, and of one train where the other has none yet."""
    common, in_forward, in_backward = np.intersect1d(forward[1], backward[1], return_indices=True)
    if common.size < MIN_PULSES:
        raise AmbiguousTachoError(
            "the tacho's pulses make several trains: analyse the record in parts between the breaks"
        )
    offset = forward[0][in_forward] - backward[0][in_backward]
    if (offset != offset[0]).any():
        slips = np.flatnonzero(np.diff(offset))
        raise AmbiguousTachoError(
            f"tacho: the pulses counted forward and backward differ by {abs(int(offset[-1] - offset[0]))}, in "
            f"{slips.size} places from {float(common[slips[0] + 1]):.4f} s on: too many are missing or double there to "
            "determine the angle"
        )
    before = backward[1] < forward[1][0]
    after = forward[1] > backward[1][-1]
    numbers = np.concatenate([backward[0][before] + offset[0], forward[0][in_forward], forward[0][after]])
    times = np.concatenate([backward[1][before], common, forward[1][after]])
    return numbers, times


def _refuse_many_repairs(numbers: IntArray, times: FloatArray, edges: FloatArray, marks: int) -> None:
    """Raise where more pulses were repaired than the live analysis allows, or every nth pulse is missing."""
    repaired = int(numbers[-1] - numbers[0]) + 1 - numbers.size + edges.size - times.size
    allowed = MAX_REPAIRED / HISTORY * numbers.size
    if repaired > allowed:
        raise AmbiguousTachoError(
            f"tacho: {repaired} of {numbers.size} pulses are missing or double, expected at most {int(allowed)}"
        )
    is_missing = np.zeros(int(numbers[-1]), dtype=np.bool_)
    is_missing[numbers[:-1][np.diff(numbers) > 1]] = True
    for distance in range(2, min(2 * marks, is_missing.size // MIN_MISSING_PULSES) + 1):
        recurring = np.count_nonzero(is_missing[distance:] & is_missing[:-distance])
        if distance % marks and recurring > max(
            MAX_PERIODIC_MISSING_FRACTION * is_missing.size / distance, MIN_MISSING_PULSES
        ):
            raise AmbiguousTachoError(
                f"tacho: a pulse is missing every {distance}: expected a pattern that repeats with the {marks} marks "
                "of a revolution"
            )
