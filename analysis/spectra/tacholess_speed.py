"""Speed without a tacho: from the ridge of 1X in the time-frequency spectrum, with its confidence.

A ridge gives speed, not angle: the amplitudes of orders are valid, their phases are not.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator, make_interp_spline

from analysis.resampling.angular_record import AngularRecord, angular_record_from_codes, probe_displacement
from analysis.resampling.rate_conversion import DecimationPyramid
from analysis.signals import CodeArray, FloatArray, IntArray
from analysis.signals.errors import AmbiguousTachoError, RecordTooShortError
from analysis.signals.header import Acquisition
from analysis.signals.probes import require_displacement
from analysis.spectra.windows import HANN
from analysis.tacho.shaft_angle import DEGREE, ShaftAngle

SAMPLES_PER_TURN = 5.0  # at the highest speed searched, after decimation
FRAME_REVOLUTIONS = 16.0  # revolutions in a frame at the lowest speed searched
STEP_FRACTION = 0.25  # of a frame
SLOPE_COST = 0.5  # log amplitude per line of change from frame to frame
MAX_LINE_CHANGE = 12  # of the ridge from frame to frame
MIN_SIGMA = 1e-4  # lines: from the change of speed within a frame
TWO_PROBES_MEDIAN = 1.832  # of the root sum of squares of two noise lines, over the sigma of a real or imaginary part
RATIO_AT_HALF_CONFIDENCE = 3.0  # of the ridge to the strongest other line


@dataclass(frozen=True, slots=True, eq=False)
class RidgeSpeed:
    """Speed estimated from the vibration, not measured by a tacho.

    Parameters
    ----------
    times : ndarray of float64, shape (n,)
        Middle of each frame, s.
    speeds : ndarray of float64, shape (n,)
        rad/s.
    sigma : ndarray of float64, shape (n,)
        Standard deviation of each, rad/s, from the noise beside the ridge, on the assumption that the ridge is 1X.
    confidence : ndarray of float64, shape (n,)
        r² / (r² + 9), 0 to 1, with r the ratio of the ridge to the strongest other line; 0.5 at a ratio of 3.
    """

    times: FloatArray
    speeds: FloatArray
    sigma: FloatArray
    confidence: FloatArray

    def angle(self, min_confidence: float = 0.5) -> ShaftAngle:
        """Return the angle by integration, from 0 at the first frame; marked as not measured, for amplitudes only.

        Raises
        ------
        AmbiguousTachoError
            The confidence is below ``min_confidence`` in more than a tenth of the frames.
        """
        doubtful = float(np.mean(self.confidence < min_confidence))
        if doubtful > 0.1:
            raise AmbiguousTachoError(
                f"speed from 1X: {100 * doubtful:.0f} % of the frames have a confidence below {min_confidence}, "
                "expected at most 10 %"
            )
        turns = PchipInterpolator(self.times, self.speeds / (2.0 * np.pi)).antiderivative()
        times = np.linspace(self.times[0], self.times[-1], 4 * self.times.size)
        counts = np.asarray(turns(times), dtype=np.float64)
        from_turns = make_interp_spline(counts, times, DEGREE)
        jitter = float(np.median(self.sigma / self.speeds) * np.median(np.diff(self.times)))
        covariance = np.full((DEGREE + 1, from_turns.c.size), np.nan)
        return ShaftAngle(from_turns, 0.0, float(counts[-1]), jitter, 0, np.zeros(1), covariance, is_measured=False)


def speed_from_ridge(displacement: FloatArray, rate: float, lowest: float, highest: float) -> RidgeSpeed:
    """Return the speed of the strongest continuous ridge between two speeds.

    Parameters
    ----------
    displacement : ndarray of float64, shape (2, n)
        Of two probes, m; decimated to about the rate that the highest speed needs.
    rate : float
        Sample rate, Hz.
    lowest, highest : float
        Speeds searched, rad/s. The range must exclude 2X and whirl unless 1X is the strongest.

    Raises
    ------
    RecordTooShortError
        Fewer than four frames of 16 revolutions at the lowest speed.
    ValueError
        Shapes or speeds out of range.

    Notes
    -----
    The ridge is the path through the spectra with the largest sum of log amplitudes minus a cost for each line of
    change (Viterbi), interpolated between the lines. Q. Leclère, S. Andre and J. Antoni, A multi-order probabilistic
    approach for instantaneous angular speed tracking, MSSP 81, 2016, compares such methods.
    """
    require_displacement(displacement, rate)
    if not 0.0 < lowest < highest < np.pi * rate * 0.9:
        raise ValueError(f"lowest, highest: {lowest} and {highest} rad/s, expected rising, to {0.9 * np.pi * rate:.0f}")
    n = 2 * round(0.5 * FRAME_REVOLUTIONS * 2.0 * np.pi / lowest * rate)
    step = max(round(n * STEP_FRACTION), 1)
    starts = np.arange(0, displacement.shape[1] - n + 1, step)
    if starts.size < 4:
        raise RecordTooShortError(f"{displacement.shape[1]} samples, expected at least {n + 3 * step}")
    first = max(int(np.floor(lowest / (2.0 * np.pi) * n / rate)), 2)
    last = int(np.ceil(highest / (2.0 * np.pi) * n / rate)) + 1
    size = np.empty((starts.size, last - first + 1))
    for row, start in enumerate(starts):
        frame = displacement[:, start : start + n]
        frame = frame - frame.mean(axis=1, keepdims=True)
        lines = 2.0 * np.fft.rfft(frame * HANN.weights(n))[:, first - 1 : last + 2]
        size[row] = np.sqrt(np.sum(np.abs(lines[:, 1:-1]) ** 2, axis=0))
    path = _ridge(np.log(np.maximum(size, 1e-300)))
    return _read(size, path, first, starts, n, rate)


def angular_record_without_tacho(
    acquisition: Acquisition, codes: CodeArray, lowest: float, highest: float, *, points: int = 64
) -> tuple[AngularRecord, RidgeSpeed]:
    """Return the angular record of a segment without a usable tacho, and the 1X ridge it is based on.

    The record is marked as not measured: its amplitudes are valid, its phases are not.

    Parameters
    ----------
    acquisition : Acquisition
        Channels, rates and calibrations.
    codes : ndarray of int16, shape (n_channels, n)
        Consecutive samples.
    lowest, highest : float
        Speeds searched, rad/s, as for `speed_from_ridge`.
    points : int
        Angular samples per revolution.

    Raises
    ------
    AmbiguousTachoError
        The confidence of the ridge is too low.
    RecordTooShortError, AnalysisError, ValueError
        As for `speed_from_ridge` and `angular_record_from_codes`.
    """
    if not highest > 0.0:
        raise ValueError(f"highest: {highest} rad/s, expected more than 0")
    needed = SAMPLES_PER_TURN * highest / (2.0 * np.pi)
    level = max(int(np.floor(np.log2(acquisition.rate / needed))), 0)
    pyramid = DecimationPyramid(2, level + 1, codes.shape[-1], 0)
    pyramid.push(probe_displacement(acquisition, codes))
    samples, origin = pyramid.level(level)
    rate = acquisition.rate / 2**level
    ridge = speed_from_ridge(samples, rate, lowest, highest)
    ridge = replace(ridge, times=ridge.times + origin / rate)
    return angular_record_from_codes(acquisition, codes, points=points, angle=ridge.angle()), ridge


def _ridge(gain: FloatArray) -> IntArray:
    """Return the line of the best path in each frame, by dynamic programming (Viterbi)."""
    n, lines = gain.shape
    moves = np.arange(-MAX_LINE_CHANGE, MAX_LINE_CHANGE + 1)
    best = gain[0].copy()
    previous = np.empty((n, lines), dtype=np.int64)
    for frame in range(1, n):
        padded = np.pad(best, MAX_LINE_CHANGE, constant_values=-np.inf)
        reached = np.lib.stride_tricks.sliding_window_view(padded, moves.size) - SLOPE_COST * np.abs(moves)
        move = np.argmax(reached, axis=1)
        previous[frame] = np.arange(lines) + moves[move]
        best = reached[np.arange(lines), move] + gain[frame]
    path = np.empty(n, dtype=np.int64)
    path[-1] = int(np.argmax(best))
    for frame in range(n - 1, 0, -1):
        path[frame - 1] = previous[frame, path[frame]]
    return path


def _read(size: FloatArray, path: IntArray, first: int, starts: IntArray, n: int, rate: float) -> RidgeSpeed:
    frame = np.arange(path.size)
    at = np.clip(path, 1, size.shape[1] - 2)
    up = size[frame, at + 1] > size[frame, at - 1]
    beside = np.where(up, size[frame, at + 1], size[frame, at - 1])
    peak = np.maximum(size[frame, at], 1e-300)
    delta = np.clip(np.where(up, 1.0, -1.0) * HANN.interpolation.offset(peak, beside), -1.0, 1.0)
    away = np.abs(np.arange(size.shape[1]) - at[:, None]) > 2 * HANN.main_lobe
    other = np.where(away, size, 0.0).max(axis=1)
    floor = np.array([np.median(row[clear]) if clear.any() else 0.0 for row, clear in zip(size, away, strict=True)])
    ratio = peak / np.maximum(np.maximum(other, 3.0 * floor), 1e-300)
    line_width = 2.0 * np.pi * rate / n
    offset_sigma = HANN.interpolation.offset_sigma(peak, beside, floor / TWO_PROBES_MEDIAN)
    return RidgeSpeed(
        times=np.asarray((starts + 0.5 * n) / rate, dtype=np.float64),
        speeds=(first + at + delta) * line_width,
        sigma=line_width * np.maximum(offset_sigma, MIN_SIGMA),
        confidence=np.where(np.isfinite(ratio), ratio**2 / (ratio**2 + RATIO_AT_HALF_CONFIDENCE**2), 1.0),
    )
