"""Detection and repair of glitches, by comparison with the same shaft angle in neighbouring revolutions."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d

from analysis.signals import BoolArray, FloatArray
from analysis.signals.probes import require_displacement
from analysis.signals.uncertainty import MAD_TO_SIGMA
from analysis.tacho.shaft_angle import ShaftAngle

LAGS = (-4, -3, -2, -1, 1, 2, 3, 4)  # revolutions with which a sample is compared
THRESHOLD = 6.0  # times the scatter of these revolutions at that angle
MAX_REPAIRED = 3  # successive samples; longer glitches are counted but not repaired
GLITCH_TIME = 2e-4  # s: longest glitch that is found during whirl
MIN_ECHO_RATIO = 1.4  # of a glitch to its echo in a second difference; 2 without noise
EDGE_SAMPLES = 5  # with the largest scatter of so many: the edge of a scratch moves between samples on a ramp
CHUNK = 200_000  # samples


@dataclass(frozen=True, slots=True, eq=False)
class Glitches:
    """Glitches found, and the samples with the short ones repaired.

    Parameters
    ----------
    displacement : ndarray of float64, shape (2, n)
        The samples, m; interpolated where ``repaired``.
    flagged : ndarray of bool, shape (2, n)
        Samples that are glitches.
    repaired : ndarray of bool, shape (2, n)
        Glitches of at most 3 samples, interpolated linearly.
    count : tuple of int
        Number of glitches at each probe.
    unrepaired : tuple of int
        Runs too long to bridge at each probe: still in the samples.
    smallest : ndarray of float64, shape (2,)
        Size from which a glitch of a few samples is found at each probe, m: the median threshold; infinite where no
        sample could be judged.
    """

    displacement: FloatArray
    flagged: BoolArray
    repaired: BoolArray
    count: tuple[int, int]
    unrepaired: tuple[int, int]
    smallest: FloatArray


def find_glitches(displacement: FloatArray, rate: float, angle: ShaftAngle, threshold: float = THRESHOLD) -> Glitches:
    """Return the glitches in the samples of two probes.

    Each sample is compared with the median of the samples at the same shaft angle in the four revolutions before and
    after: a Hampel filter across revolutions, not along time. Surface marks and motion common to these revolutions
    stay. The threshold is based on the scatter of these revolutions at that angle, at least that of the whole record.
    Motion of other orders, as whirl, is scatter there: the same comparison is therefore made of second differences over
    4 samples and over 0.2 ms as well, from which slow motion vanishes.

    Parameters
    ----------
    displacement : ndarray of float64, shape (2, n)
        As sampled, m.
    rate : float
        Sample rate, Hz.
    angle : ShaftAngle
        Time against revolutions.
    threshold : float
        In standard deviations.

    Notes
    -----
    F. Hampel, J. Am. Stat. Assoc. 69, 1974. In the first and last four revolutions fewer revolutions are compared, at
    least three; samples outside the range of the angle are not judged.
    """
    require_displacement(displacement, rate)
    if not threshold > 0.0:
        raise ValueError(f"threshold: {threshold} standard deviations, expected above 0")
    n = displacement.shape[1]
    first, last = max(int(np.ceil(angle.time(angle.first) * rate)), 0), min(int(angle.time(angle.last) * rate), n - 1)
    flagged, smallest = np.zeros((2, n), dtype=np.bool_), np.full(2, np.inf)
    for lag in {0, MAX_REPAIRED + 1, max(round(GLITCH_TIME * rate), MAX_REPAIRED + 1)}:
        values = _second_difference(displacement, lag) if lag else displacement
        off, scatter = np.zeros((2, n)), np.full((2, n), np.inf)
        for begin in range(first, last + 1, CHUNK):
            end = min(begin + CHUNK, last + 1)
            off[:, begin:end], scatter[:, begin:end] = _compared(values, rate, angle, begin, end)
        off[:, :lag] = off[:, n - lag :] = 0.0  # without a second difference
        scatter = maximum_filter1d(scatter, EDGE_SAMPLES, axis=1, mode="nearest")
        for probe in range(2):
            known = np.isfinite(scatter[probe])
            if known.any():
                usual = float(np.median(np.abs(off[probe, known])))
                bar = np.maximum(threshold * MAD_TO_SIGMA * np.maximum(scatter[probe], usual), 1e-12)
                flagged[probe] |= (np.abs(off[probe]) > bar) & ~_echoes(off[probe], lag)
                smallest[probe] = min(smallest[probe], float(np.median(bar[known])))
    clean, repaired = displacement.copy(), np.zeros((2, n), dtype=np.bool_)
    counts = [_bridge(clean[probe], flagged[probe], repaired[probe]) for probe in range(2)]
    return Glitches(clean, flagged, repaired, (counts[0][0], counts[1][0]), (counts[0][1], counts[1][1]), smallest)


def _second_difference(values: FloatArray, lag: int) -> FloatArray:
    """Return each sample minus the mean of those ``lag`` before and after, shape (2, n); 0 at the ends."""
    difference = np.zeros(values.shape)
    difference[:, lag:-lag] = values[:, lag:-lag] - 0.5 * (values[:, : -2 * lag] + values[:, 2 * lag :])
    return difference


def _echoes(off: FloatArray, lag: int) -> BoolArray:
    """Return which deviations of a second difference are half of an opposite one ``lag`` samples before or after."""
    echoes = np.zeros(off.size, dtype=np.bool_)
    if lag:
        echoes[lag:] |= off[:-lag] * np.sign(off[lag:]) < -MIN_ECHO_RATIO * np.abs(off[lag:])
        echoes[:-lag] |= off[lag:] * np.sign(off[:-lag]) < -MIN_ECHO_RATIO * np.abs(off[:-lag])
    return echoes


def _compared(
    displacement: FloatArray, rate: float, angle: ShaftAngle, begin: int, end: int
) -> tuple[FloatArray, FloatArray]:
    """Return the deviations from the median of the other revolutions, and their median absolute deviation."""
    turns = angle.turns(np.arange(begin, end) / rate)
    others = np.full((2, len(LAGS), end - begin), np.nan)
    for row, lag in enumerate(LAGS):
        there = turns + lag
        inside = (there >= angle.first) & (there <= angle.last)
        at = np.asarray(angle.time(there[inside])) * rate
        low = np.floor(at).astype(np.int64)
        fits = (low >= 0) & (low + 1 < displacement.shape[1])
        where = np.flatnonzero(inside)[fits]
        low, part = low[fits], at[fits] - low[fits]
        others[:, row, where] = displacement[:, low] * (1.0 - part) + displacement[:, low + 1] * part
    compared = np.count_nonzero(np.isfinite(others[0]), axis=0) >= 3
    middle = np.zeros((2, end - begin))
    scatter = np.full((2, end - begin), np.inf)
    middle[:, compared] = np.nanmedian(others[:, :, compared], axis=1)
    scatter[:, compared] = np.nanmedian(np.abs(others[:, :, compared] - middle[:, None, compared]), axis=1)
    off = np.where(compared, displacement[:, begin:end] - middle, 0.0)
    return off, scatter


def _bridge(samples: FloatArray, flagged: BoolArray, repaired: BoolArray) -> tuple[int, int]:
    """Interpolate short glitches in place; return the number of glitches and of those not repaired."""
    edges = np.diff(np.concatenate([[False], flagged, [False]]).astype(np.int8))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    left = 0
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        if end - begin > MAX_REPAIRED or begin == 0 or end == samples.size:
            left += 1
            continue
        samples[begin:end] = np.interp(np.arange(begin, end), [begin - 1, end], [samples[begin - 1], samples[end]])
        repaired[begin:end] = True
    return begins.size, left
