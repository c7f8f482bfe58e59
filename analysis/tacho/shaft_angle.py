"""Smooth shaft angle from tacho pulses: a least-squares cubic spline of time against revolutions.

`smooth_angle` fits the last revolutions of the live analysis, `shaft_angle` a whole record with its uncertainty.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import cho_solve_banded, cholesky_banded

from analysis.signals import BoolArray, FloatArray, IntArray
from analysis.signals.errors import AmbiguousTachoError, RecordTooShortError
from analysis.signals.uncertainty import MAD_TO_SIGMA
from analysis.tacho.pulse_record import PulseRecord

DEGREE = 3
MAX_KNOT_REVOLUTIONS = 8.0  # revolutions between knots: pulses averaged by one piece of the spline
MIN_KNOT_REVOLUTIONS = 3.0
KNOT_TIME = 0.08  # s between knots at low speed, to resolve speed fluctuations
OUTLIER_SIGMAS, OUTLIER_REVOLUTIONS = 6.0, 0.01  # times the scatter, and revolutions: pulses further off are rejected
MAX_SPLINE_ERROR = 3e-6  # revolutions, of the spline at a steady acceleration: 0.001 degrees
MIN_REVOLUTIONS = 4
MAX_SUCCESSIVE_OUTLIERS = 3  # pulses in a row that are rejected; more are a jump of speed
MAX_REFITS = 3  # after the first fit: a false pulse bends the spline and can hide smaller ones


@dataclass(frozen=True, slots=True, eq=False)
class SmoothAngle:
    """Time against revolutions.

    Parameters
    ----------
    time : BSpline
        Time, s, as a function of the revolution count.
    jitter : float
        Robust scatter of the pulses about the spline, 1.4826 MAD, s.
    """

    time: BSpline
    jitter: float


def smooth_angle(turns: IntArray, times: FloatArray) -> SmoothAngle:
    """Return a cubic spline, time against revolutions, fitted to the times of the marks by least squares.

    Time is fitted against the count, because the pulses lie uniformly in angle; the spline gives the times of an
    angular grid directly. The knots lie 8 revolutions apart, closer at low speed (80 ms, at least 3 revolutions),
    where the air changes the speed within 8 revolutions and the scatter of the edges is small relative to a
    revolution. Outliers are rejected and the rest is fitted again.

    Parameters
    ----------
    turns : ndarray of int64, shape (n,)
        Revolution counts, rising; n at least 2.
    times : ndarray of float64, shape (n,)
        Their times, s.

    Returns
    -------
    SmoothAngle
        Valid between the first and the last mark.

    Notes
    -----
    K. Fyfe and E. Munck, Analysis of computed order tracking, MSSP 11(2), 1997: errors of the angle limit the accuracy
    of order tracking. Least squares in B-splines: C. de Boor, A Practical Guide to Splines, 1978.
    """
    if turns.size < 2 or turns.shape != times.shape:
        raise ValueError(f"turns, times: shapes {turns.shape} and {times.shape}, expected the same, 2 marks at least")
    time, residual = _fit_spline(turns, times)
    scatter = MAD_TO_SIGMA * float(np.median(np.abs(residual - np.median(residual))))
    allowed = max(
        OUTLIER_SIGMAS * scatter, OUTLIER_REVOLUTIONS * float(times[-1] - times[0]) / float(turns[-1] - turns[0])
    )
    good = np.abs(residual) <= allowed
    good[[0, -1]] = True  # the ends of the spline
    if not good.all() and np.count_nonzero(good) > 2 * DEGREE:
        time, residual = _fit_spline(turns[good], times[good])
        scatter = MAD_TO_SIGMA * float(np.median(np.abs(residual - np.median(residual))))
    return SmoothAngle(time, scatter)


def _fit_spline(turns: IntArray, times: FloatArray) -> tuple[BSpline, FloatArray]:
    """Return the spline and the residual of each mark, s."""
    span = float(turns[-1] - turns[0])
    apart = min(max(KNOT_TIME * span / float(times[-1] - times[0]), MIN_KNOT_REVOLUTIONS), MAX_KNOT_REVOLUTIONS)
    pieces = max(1, round(span / apart))
    inner = turns[0] + span * np.arange(pieces + 1) / pieces
    knots = np.concatenate([np.full(DEGREE, inner[0]), inner, np.full(DEGREE, inner[-1])])
    # Fitted as a correction to the straight line through the ends, whose coefficients are its values at the knot
    # averages: with few marks the spline stays near the line.
    averages = np.convolve(knots[1:-1], np.full(DEGREE, 1.0 / DEGREE), mode="valid")
    line = times[0] + (times[-1] - times[0]) / span * (averages - inner[0])
    basis = BSpline.design_matrix(turns.astype(np.float64), knots, DEGREE).toarray()
    correction = np.linalg.lstsq(basis, times - basis @ line, rcond=1e-9)[0]
    coefficients = line + correction
    residual = times - basis @ coefficients
    return BSpline(knots, coefficients, DEGREE), residual


@dataclass(frozen=True, slots=True, eq=False)
class ShaftAngle:
    """Smooth shaft angle of a record, as time against revolutions, with its uncertainty.

    Parameters
    ----------
    time : BSpline
        Time, s, as a function of the revolution count; theta = 0 at whole counts.
    first, last : float
        Range of validity, revolutions.
    jitter : float
        Robust scatter of the pulses about the spline (1.4826 MAD), s.
    outliers : int
        Number of rejected pulses.
    mark_angles : ndarray of float64, shape (pulses_per_revolution,)
        Angles of the marks on the shaft, rad from the first.
    covariance : ndarray of float64, shape (4, n_coefficients)
        Diagonals of the covariance of the spline coefficients for a pulse scatter of 1 s, the main diagonal first, s².
    is_measured : bool
        Whether the angle comes from a tacho; False if estimated from vibration (`analysis.spectra.tacholess_speed`).
    """

    time: BSpline
    first: float
    last: float
    jitter: float
    outliers: int
    mark_angles: FloatArray
    covariance: FloatArray
    is_measured: bool = True

    def speed(self, turns: FloatArray) -> FloatArray:
        """Return the shaft speed, rad/s, at revolution counts."""
        return np.asarray(2.0 * np.pi / self.time(turns, nu=1), dtype=np.float64)

    def cubics(self, turns: IntArray) -> FloatArray:
        """Return time within whole revolutions as cubics of the fraction of the revolution.

        Coefficients in rising order, shape (4, n), s.
        """
        factorials = (1.0, 1.0, 2.0, 6.0)
        return np.stack([self.time(turns, nu=power) / factorial for power, factorial in enumerate(factorials)])

    def turns(self, times: FloatArray) -> FloatArray:
        """Return the revolution count at times, s; NaN outside the record."""
        grid = np.linspace(self.first, self.last, max(int(2 * (self.last - self.first)), 2))
        turns = np.interp(times, self.time(grid), grid, left=np.nan, right=np.nan)
        inside = np.isfinite(turns)
        for _ in range(3):  # Newton: converges to rounding from half a revolution
            held = np.clip(turns[inside], self.first, self.last)
            turns[inside] = held - (self.time(held) - times[inside]) / self.time(held, nu=1)
        return np.asarray(turns, dtype=np.float64)

    def time_sigma(self, turns: FloatArray) -> FloatArray:
        """Return the standard deviation of time at revolution counts, s, for independent scatter of the pulses.

        Smaller than the jitter, because the spline averages neighbouring pulses, and larger at the ends. A common
        error of all pulses, such as the configured delay, is not included. NaN without a tacho.
        """
        if not self.is_measured:
            return np.full(np.shape(turns), np.nan)
        basis = BSpline.design_matrix(np.asarray(turns, dtype=np.float64), self.time.t, DEGREE)
        weights = basis.data.reshape(-1, DEGREE + 1)
        first = basis.indices.reshape(-1, DEGREE + 1)[:, 0]
        variance = np.zeros(first.size)
        for low in range(DEGREE + 1):
            for apart in range(DEGREE + 1 - low):
                both = weights[:, low] * weights[:, low + apart] * self.covariance[apart, first + low]
                variance += both if apart == 0 else 2.0 * both
        return np.asarray(self.jitter * np.sqrt(variance), dtype=np.float64)


def shaft_angle(record: PulseRecord) -> ShaftAngle:
    """Return the shaft angle of a record, a least-squares cubic spline of time against revolutions.

    Knots lie 8 revolutions apart, closer at low speed (80 ms, at least 3 revolutions), where the speed changes within
    8 revolutions. Outliers are rejected and the rest is fitted again. With several marks on the shaft their angles are
    found first, as the mean position of each between the revolutions of the first.

    Parameters
    ----------
    record : PulseRecord
        Numbered pulses.

    Raises
    ------
    RecordTooShortError
        Fewer than 4 whole revolutions.
    AmbiguousTachoError
        Several pulses in a row are outliers: the speed jumps.

    Notes
    -----
    K. Fyfe and E. Munck, Analysis of computed order tracking, MSSP 11(2), 1997: errors of the angle limit the accuracy
    of order tracking. Time is fitted against angle, because the pulses lie uniformly in angle.
    """
    marks = record.pulses_per_revolution
    whole = np.count_nonzero(record.numbers % marks == 0) - 1
    if whole < MIN_REVOLUTIONS:
        raise RecordTooShortError(f"the tacho's pulses span {whole} revolutions, expected at least {MIN_REVOLUTIONS}")
    offsets = _mark_offsets(record)
    turns = record.numbers / marks + offsets[record.numbers % marks]
    allowed = OUTLIER_REVOLUTIONS * np.gradient(record.times, turns) / marks
    good, fit = np.ones(turns.size, dtype=np.bool_), _fit(turns, record.times)
    for _ in range(MAX_REFITS):
        within = (turns >= turns[good][0]) & (turns <= turns[good][-1])
        off = np.abs(record.times - fit.time(turns))
        near = within & (off <= np.maximum(OUTLIER_SIGMAS * fit.scatter, allowed))
        if (near == good).all():
            break
        _refuse_jumps(near, record.times)
        good, fit = near, _fit(turns[near], record.times[near])
    return ShaftAngle(
        time=fit.time,
        first=float(turns[good][0]),
        last=float(turns[good][-1]),
        jitter=fit.scatter,
        outliers=int(np.count_nonzero(~good)),
        mark_angles=2.0 * np.pi * (np.arange(marks) / marks + offsets),
        covariance=_inverse_bands(fit.factor),
    )


def _mark_offsets(record: PulseRecord) -> FloatArray:
    """Return the offset of each mark from even spacing, revolutions; 0 for the first."""
    marks = record.pulses_per_revolution
    mark = record.numbers % marks
    turns = record.numbers / marks
    offsets = np.zeros(marks)
    if marks > 1:
        time = _fit(turns[mark == 0], record.times[mark == 0]).time
        lowest, highest = turns[mark == 0][[0, -1]]
        inside = (turns > lowest) & (turns < highest)
        for _ in range(2):  # Newton, from even spacing
            there = np.clip(turns[inside] + offsets[mark[inside]], lowest, highest)
            off = (record.times[inside] - time(there)) / time(there, nu=1)
            for other in range(1, marks):
                offsets[other] += float(np.median(off[mark[inside] == other]))
    return offsets


def _refuse_jumps(good: BoolArray, times: FloatArray) -> None:
    """Raise where several pulses in a row are outliers: not false edges, but a jump of speed."""
    bad = np.concatenate([[False], ~good, [False]]).astype(np.int8)
    begins, ends = np.flatnonzero(np.diff(bad) == 1), np.flatnonzero(np.diff(bad) == -1)
    long = np.flatnonzero(ends - begins > MAX_SUCCESSIVE_OUTLIERS)
    if long.size:
        raise AmbiguousTachoError(
            f"tacho: {ends[long[0]] - begins[long[0]]} pulses in a row from {times[begins[long[0]]]:.4f} s on deviate "
            "from the smooth angle: the speed jumps there; analyse the record in parts"
        )


def _inner_knots(turns: FloatArray, times: FloatArray) -> list[float]:
    """Return the knots, in whole revolutions except the ends, so that the spline is one cubic in each revolution.

    At a speed n with constant acceleration a, n t'' = -a / n², and so on: the error of the cubic is about
    h^4 15 a³ / (384 n^6) revolutions for a knot distance h.
    """
    per_turn = (turns.size - 1) / float(turns[-1] - turns[0])  # pulses per revolution
    span, last = int(max(MAX_KNOT_REVOLUTIONS * per_turn, DEGREE + 1)), turns.size - 1
    at, knots = 0, [float(turns[0])]
    while True:
        middle = min(max(at, span), max(last - span, 0))
        low, high = max(middle - span, 0), min(middle + span, last)
        before = (turns[middle] - turns[low]) / (times[middle] - times[low]) if middle > low else np.nan
        after = (turns[high] - turns[middle]) / (times[high] - times[middle])
        rise = 2.0 * abs(after - before) / (times[high] - times[low]) if middle > low else 0.0
        bend = 15.0 * rise**3 / (384.0 * after**6)
        straight = (MAX_SPLINE_ERROR / bend) ** 0.25 if bend > 0.0 else MAX_KNOT_REVOLUTIONS
        apart = max(min(KNOT_TIME * after, straight, MAX_KNOT_REVOLUTIONS), MIN_KNOT_REVOLUTIONS)
        step = max(round(apart * per_turn), DEGREE)
        at += step
        if at > last - step:
            return [*knots, float(turns[-1])]
        knots.append(float(round(turns[at])))


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """A spline fit: residuals of the pulses, s, and the banded Cholesky factor of the normal equations."""

    time: BSpline
    residual: FloatArray
    factor: FloatArray

    @property
    def scatter(self) -> float:
        """Robust scatter of the pulses, s, corrected for the degrees of freedom of the fit."""
        freedom = max(self.residual.size - self.factor.shape[1], 1)
        spread = float(np.median(np.abs(self.residual - np.median(self.residual))))
        return MAD_TO_SIGMA * spread * float(np.sqrt(self.residual.size / freedom))


def _fit(turns: FloatArray, times: FloatArray) -> _Fit:
    inner = _inner_knots(turns, times)
    knots = np.concatenate([np.full(DEGREE, inner[0]), inner, np.full(DEGREE, inner[-1])])
    slope = (times[-1] - times[0]) / (turns[-1] - turns[0])
    line = times[0] + slope * (turns - turns[0])
    basis = BSpline.design_matrix(turns, knots, DEGREE)
    gram = (basis.T @ basis).todia()
    banded = np.stack([np.append(gram.diagonal(-row), np.zeros(row)) for row in range(DEGREE + 1)])
    factor = cholesky_banded(banded, lower=True)
    correction = cho_solve_banded((factor, True), basis.T @ (times - line))
    averages = np.convolve(knots[1:-1], np.full(DEGREE, 1.0 / DEGREE), mode="valid")
    coefficients = correction + times[0] + slope * (averages - turns[0])
    residual = times - line - basis @ correction
    return _Fit(BSpline(knots, coefficients, DEGREE), np.asarray(residual, dtype=np.float64), factor)


def _inverse_bands(factor: FloatArray) -> FloatArray:
    """Return diagonals of the inverse of a matrix, the main one first, from its banded lower Cholesky factor L.

    Z = (L L')⁻¹ satisfies L' Z = L⁻¹, which is lower triangular, so that the bands of Z follow from the last row
    upwards (K. Takahashi, J. Fagan and M. Chin, PICA conference, 1973).
    """
    bands, size = factor.shape
    columns = factor.T.tolist()
    inverse = [[0.0] * bands for _ in range(size + bands)]  # inverse[i][d] is Z[i, i + d]
    for i in range(size - 1, -1, -1):
        column, row = columns[i], inverse[i]
        for d in range(bands - 1, -1, -1):
            known = 1.0 / column[0] if d == 0 else 0.0
            for k in range(1, bands):
                known -= column[k] * inverse[i + min(k, d)][abs(k - d)]
            row[d] = known / column[0]
    return np.array(inverse[:size]).T
