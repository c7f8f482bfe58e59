"""Speed where the tacho fails: from the ridge that 1X makes in the spectrum, with how sure it is.

A ridge gives speed, not angle: amplitudes of orders can be read by it, phases cannot.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator, make_interp_spline

from analysis.resampling.angular_record import AngularRecord, angular_record_from_codes, probe_displacement
from analysis.resampling.decimation import DecimationPyramid
from analysis.signals.errors import RecordTooShortError, TachoRefusedError
from analysis.signals.header import Acquisition
from analysis.signals.probes import require_displacement
from analysis.signals.uncertainty import order_sigma
from analysis.spectra.order_spectrum import hann
from analysis.tacho.shaft_angle import DEGREE, ShaftAngle

FloatArray = NDArray[np.float64]

SAMPLES_PER_TURN = 5.0  # samples a turn at the highest speed searched: the ridge needs no more
FRAME_TURNS = 16.0  # at the lowest speed searched
STEP_FRACTION = 0.25  # of a frame
SLOPE_COST = 0.5  # of log amplitude for a change of a line from frame to frame
MAX_LINE_CHANGE = 12  # by which the ridge may move from frame to frame
MIN_SIGMA = 1e-4  # lines: what a speed that changes within a frame leaves
TWO_PROBES_MEDIAN = 1.832  # of the root of two probes' squared noise over the standard deviation of one part of one
RATIO_AT_HALF_CONFIDENCE = 3.0  # ratio of the ridge to the strongest line beside it at confidence 0.5


@dataclass(frozen=True, slots=True, eq=False)
class RidgeSpeed:
    """Speed read from the vibration itself: estimated, not measured.

    Parameters
    ----------
    times : ndarray of float64, shape (n,)
        Middle of each frame, s.
    speeds : ndarray of float64, shape (n,)
        rad/s.
    sigma : ndarray of float64, shape (n,)
        Standard deviation of each, rad/s, from the noise about the ridge. That it is 1X at all is not in it.
    confidence : ndarray of float64, shape (n,)
        0 to 1: how far the ridge stands above what else could be one, r² / (r² + 9) with r the ratio of amplitudes;
        0.5 is three times.
    """

    times: FloatArray
    speeds: FloatArray
    sigma: FloatArray
    confidence: FloatArray

    def angle(self, least: float = 0.5) -> ShaftAngle:
        """Return an angle by integration, from 0 at the first frame: marked as not measured, for amplitudes only.

        Raises
        ------
        TachoRefusedError
            Where the confidence is below ``least`` in more than a tenth of the frames.
        """
        doubtful = float(np.mean(self.confidence < least))
        if doubtful > 0.1:
            raise TachoRefusedError(
                f"speed from 1X: {100 * doubtful:.0f} % of the frames have a confidence below {least}, expected at "
                "most 10 %"
            )
        turns = PchipInterpolator(self.times, self.speeds / (2.0 * np.pi)).antiderivative()
        times = np.linspace(self.times[0], self.times[-1], 4 * self.times.size)
        counts = np.asarray(turns(times), dtype=np.float64)
        from_turns = make_interp_spline(counts, times, DEGREE)
        jitter = float(np.median(self.sigma / self.speeds) * np.median(np.diff(self.times)))
        covariance = np.full((DEGREE + 1, from_turns.c.size), np.nan)
        return ShaftAngle(from_turns, 0.0, float(counts[-1]), jitter, 0, np.zeros(1), covariance, is_measured=False)


def speed_from_ridge(displacement: FloatArray, rate: float, lowest: float, highest: float) -> RidgeSpeed:
    """Return the speed of the strongest steady ridge between two speeds.

    Parameters
    ----------
    displacement : ndarray of float64, shape (2, n)
        Of two probes, m; at a rate not far above what the highest speed needs (`analysis.resampling.decimation`).
    rate : float
        Sample rate, Hz.
    lowest, highest : float
        Speeds searched, rad/s: close enough that neither 2X nor whirl lies within unless 1X is the strongest.

    Raises
    ------
    RecordTooShortError
        With fewer than four frames of 16 turns at the lowest speed.
    ValueError
        Shapes or speeds out of range.

    Notes
    -----
    Of all paths through the frames' spectra the one with the largest sum of log amplitudes, less a cost for each line
    by which it moves (Viterbi); then interpolated between the lines. Q. Leclère, S. Andre and J. Antoni, A
    multi-order probabilistic approach for instantaneous angular speed tracking, MSSP 81, 2016, compares such methods.
    """
    require_displacement(displacement, rate)
    if not 0.0 < lowest < highest < np.pi * rate * 0.9:
        raise ValueError(f"lowest, highest: {lowest} and {highest} rad/s, expected rising, to {0.9 * np.pi * rate:.0f}")
    n = 2 * round(0.5 * FRAME_TURNS * 2.0 * np.pi / lowest * rate)
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
        lines = 2.0 * np.fft.rfft(frame * hann(n))[:, first - 1 : last + 2]
        size[row] = np.sqrt(np.sum(np.abs(lines[:, 1:-1]) ** 2, axis=0))
    path = _ridge(np.log(np.maximum(size, 1e-300)))
    return _read(size, path, first, starts, n, rate)


def angular_record_without_tacho(
    acquisition: Acquisition, codes: NDArray[np.int16], lowest: float, highest: float, *, points: int = 64
) -> tuple[AngularRecord, RidgeSpeed]:
    """Return the angular record of a segment whose tacho failed, by the ridge of 1X, and that ridge.

    The record is marked as not measured: its amplitudes hold, its phases mean nothing.

    Parameters
    ----------
    acquisition : Acquisition
        What the codes mean.
    codes : ndarray of int16, shape (n_channels, n)
        Consecutive samples.
    lowest, highest : float
        Speeds searched, rad/s, as for `speed_from_ridge`.
    points : int
        Angular samples a revolution.

    Raises
    ------
    TachoRefusedError
        Where the ridge is not sure either.
    RecordTooShortError, AnalysisError, ValueError
        As for `speed_from_ridge` and `record_of_codes`.
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


def _ridge(gain: FloatArray) -> NDArray[np.int64]:
    """Return the line of the best path in each frame."""
    n, lines = gain.shape
    moves = np.arange(-MAX_LINE_CHANGE, MAX_LINE_CHANGE + 1)
    best = gain[0].copy()
    came = np.empty((n, lines), dtype=np.int64)
    for frame in range(1, n):
        padded = np.pad(best, MAX_LINE_CHANGE, constant_values=-np.inf)
        reached = np.lib.stride_tricks.sliding_window_view(padded, moves.size) - SLOPE_COST * np.abs(moves)
        move = np.argmax(reached, axis=1)
        came[frame] = np.arange(lines) + moves[move]
        best = reached[np.arange(lines), move] + gain[frame]
    path = np.empty(n, dtype=np.int64)
    path[-1] = int(np.argmax(best))
    for frame in range(n - 1, 0, -1):
        path[frame - 1] = came[frame, path[frame]]
    return path


def _read(
    size: FloatArray, path: NDArray[np.int64], first: int, starts: NDArray[np.int64], n: int, rate: float
) -> RidgeSpeed:
    frame = np.arange(path.size)
    at = np.clip(path, 1, size.shape[1] - 2)
    up = size[frame, at + 1] > size[frame, at - 1]
    beside = np.where(up, size[frame, at + 1], size[frame, at - 1])
    peak = np.maximum(size[frame, at], 1e-300)
    delta = np.clip(np.where(up, 1.0, -1.0) * (2.0 * beside - peak) / (peak + beside), -1.0, 1.0)
    away = np.abs(np.arange(size.shape[1]) - at[:, None]) > 4
    other = np.where(away, size, 0.0).max(axis=1)
    floor = np.array([np.median(row[kept]) if kept.any() else 0.0 for row, kept in zip(size, away, strict=True)])
    ratio = peak / np.maximum(np.maximum(other, 3.0 * floor), 1e-300)
    line_width = 2.0 * np.pi * rate / n
    return RidgeSpeed(
        times=np.asarray((starts + 0.5 * n) / rate, dtype=np.float64),
        speeds=(first + at + delta) * line_width,
        sigma=line_width * np.maximum(order_sigma(peak, beside, floor / TWO_PROBES_MEDIAN, 1), MIN_SIGMA),
        confidence=np.where(np.isfinite(ratio), ratio**2 / (ratio**2 + RATIO_AT_HALF_CONFIDENCE**2), 1.0),
    )
