"""The angle of the shaft through a whole record, with how far it is to be trusted.

Shaft angle as a smooth function of time, from pulses of which each is a little off.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.linalg import cho_solve_banded, cholesky_banded

from analysis.signals.errors import RecordTooShortError, TachoRefusedError
from analysis.tacho.pulse_record import PulseRecord

FloatArray = NDArray[np.float64]

DEGREE = 3
MAX_KNOT_TURNS = 8.0  # at most: pulses averaged by one piece of the spline
MIN_KNOT_TURNS = 3.0
KNOT_TIME = 0.08  # s: slower fluctuations of speed are followed
MAD_TO_SIGMA = 1.4826  # of a normal distribution
OUTLIER_SIGMAS, OUTLIER_TURNS = 6.0, 0.01  # times the scatter, and part of a revolution: further off is another edge


@dataclass(frozen=True, slots=True, eq=False)
class SmoothAngle:
    """Time against revolutions.

    Parameters
    ----------
    time : BSpline
        Time, s, of a revolution count.
    jitter : float
        Robust scatter of the pulses about it, 1.4826 MAD, s.
    """

    time: BSpline
    jitter: float


def smooth_angle(turns: NDArray[np.int64], times: FloatArray) -> SmoothAngle:
    """Fit a cubic spline, time against revolutions, to the times of the marks by least squares.

    The pulses lie uniformly in angle, so that time is fitted against the count and the instants of an angular grid
    come straight out. The knots lie 8 revolutions apart, closer at low speed (80 ms, at least 3 revolutions), where
    the air changes the speed within 8 revolutions and the scatter of the edges is small beside a revolution. Marks
    that lie far off are left out and the rest is fitted again.

    Parameters
    ----------
    turns : ndarray of int64, shape (n,)
        Revolution counts, rising; n at least 2.
    times : ndarray of float64, shape (n,)
        Their times, s.

    Returns
    -------
    SmoothAngle
        Good between the first and the last mark.

    Notes
    -----
    K. Fyfe and E. Munck, Analysis of computed order tracking, MSSP 11(2), 1997: the angle's errors limit everything;
    least squares in B-splines as C. de Boor, A Practical Guide to Splines, 1978.
    """
    if turns.size < 2 or turns.shape != times.shape:
        raise ValueError(f"turns, times: shapes {turns.shape} and {times.shape}, expected the same, 2 marks at least")
    time, residual = _fit_spline(turns, times)
    scatter = MAD_TO_SIGMA * float(np.median(np.abs(residual - np.median(residual))))
    allowed = max(OUTLIER_SIGMAS * scatter, OUTLIER_TURNS * float(times[-1] - times[0]) / float(turns[-1] - turns[0]))
    good = np.abs(residual) <= allowed
    good[[0, -1]] = True  # they carry the ends
    if not good.all() and np.count_nonzero(good) > 2 * DEGREE:
        time, residual = _fit_spline(turns[good], times[good])
        scatter = MAD_TO_SIGMA * float(np.median(np.abs(residual - np.median(residual))))
    return SmoothAngle(time, scatter)


def _fit_spline(turns: NDArray[np.int64], times: FloatArray) -> tuple[BSpline, FloatArray]:
    """Return the spline and what it leaves of each mark, s."""
    span = float(turns[-1] - turns[0])
    apart = min(max(KNOT_TIME * span / float(times[-1] - times[0]), MIN_KNOT_TURNS), MAX_KNOT_TURNS)
    pieces = max(1, round(span / apart))
    inner = turns[0] + span * np.arange(pieces + 1) / pieces
    knots = np.concatenate([np.full(DEGREE, inner[0]), inner, np.full(DEGREE, inner[-1])])
    # Fitted beside the straight line through the ends, whose coefficients are its values at the knots' averages: where
    # there are few marks the spline stays near the line.
    averages = np.convolve(knots[1:-1], np.full(DEGREE, 1.0 / DEGREE), mode="valid")
    line = times[0] + (times[-1] - times[0]) / span * (averages - inner[0])
    basis = BSpline.design_matrix(turns.astype(np.float64), knots, DEGREE).toarray()
    correction = np.linalg.lstsq(basis, times - basis @ line, rcond=1e-9)[0]
    coefficients = line + correction
    residual = times - basis @ coefficients
    return BSpline(knots, coefficients, DEGREE), residual


MAX_SPLINE_ERROR = 3e-6  # revolutions that the spline may miss a steady rise of speed by: 0.001 degrees
MIN_TURNS = 4
MAX_SUCCESSIVE_OUTLIERS = 3  # pulses in a row that may be false
MAX_REFITS = 3  # after the first: a false pulse bends what it lies in, and false ones hide behind worse


@dataclass(frozen=True, slots=True, eq=False)
class ShaftAngle:
    """Time against revolutions, through a record.

    Parameters
    ----------
    time : BSpline
        Time, s, of a count of revolutions; theta = 0 where the count is whole.
    first, last : float
        Revolutions between which it holds.
    jitter : float
        Robust scatter of the pulses about it (1.4826 MAD), s.
    outliers : int
        Pulses that were left out because they lay far off.
    mark_angles : ndarray of float64, shape (pulses_per_revolution,)
        Where the marks were found on the shaft, rad from the first; 0 for the first.
    covariance : ndarray of float64, shape (4, n_coefficients)
        Of the spline's coefficients where the pulses scatter by 1 s: its diagonals, the main one first, s².
    is_measured : bool
        True where a tacho told; False where it was read from the vibration itself (`analysis.spectra.tacholess_speed`).
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
        """Return the shaft's speed, rad/s, at counts of revolutions."""
        return np.asarray(2.0 * np.pi / self.time(turns, nu=1), dtype=np.float64)

    def cubics(self, turns: NDArray[np.int64]) -> FloatArray:
        """Return time within whole revolutions as cubics of the part of the turn, coefficients (4, n), s, rising."""
        factorials = (1.0, 1.0, 2.0, 6.0)
        return np.stack([self.time(turns, nu=power) / factorial for power, factorial in enumerate(factorials)])

    def turns(self, times: FloatArray) -> FloatArray:
        """Return the count of revolutions at times, s; NaN outside the record."""
        grid = np.linspace(self.first, self.last, max(int(2 * (self.last - self.first)), 2))
        turns = np.interp(times, self.time(grid), grid, left=np.nan, right=np.nan)
        inside = np.isfinite(turns)
        for _ in range(3):  # Newton: converges to rounding from half a revolution
            held = np.clip(turns[inside], self.first, self.last)
            turns[inside] = held - (self.time(held) - times[inside]) / self.time(held, nu=1)
        return np.asarray(turns, dtype=np.float64)

    def time_sigma(self, turns: FloatArray) -> FloatArray:
        """Return the standard deviation of time at counts of revolutions, s, where pulses scatter independently.

        Smaller than the jitter, as the spline averages the pulses about, and larger at its ends; a common error of all
        pulses, as of the configured delay, is not in it. NaN where no tacho told.
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
    """Fit a least-squares cubic spline, time against revolutions, through a record of pulses.

    Knots lie 8 revolutions apart, closer at low speed (80 ms, at least 3 revolutions), where the speed changes within
    8 revolutions. Pulses that lie far off are left out and the rest is fitted again. With several marks on the shaft
    their places are found first, from where each lies on average between the revolutions of the first.

    Parameters
    ----------
    record : PulseRecord
        Numbered pulses.

    Raises
    ------
    RecordTooShortError
        With fewer than 4 whole revolutions.
    TachoRefusedError
        Where several pulses in a row lie off the smooth angle: the speed jumps.

    Notes
    -----
    K. Fyfe and E. Munck, Analysis of computed order tracking, MSSP 11(2), 1997: the angle's errors limit everything;
    time is fitted against angle because the pulses lie uniformly in it.
    """
    marks = record.pulses_per_revolution
    whole = np.count_nonzero(record.numbers % marks == 0) - 1
    if whole < MIN_TURNS:
        raise RecordTooShortError(f"the tacho's pulses span {whole} revolutions, expected at least {MIN_TURNS}")
    offsets = _mark_offsets(record)
    turns = record.numbers / marks + offsets[record.numbers % marks]
    allowed = OUTLIER_TURNS * np.gradient(record.times, turns) / marks
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
    """Return by how much of a turn each mark lies off its even place, the first by none."""
    marks = record.pulses_per_revolution
    mark = record.numbers % marks
    turns = record.numbers / marks
    offsets = np.zeros(marks)
    if marks > 1:
        time = _fit(turns[mark == 0], record.times[mark == 0]).time
        lowest, highest = turns[mark == 0][[0, -1]]
        inside = (turns > lowest) & (turns < highest)
        for _ in range(2):  # Newton, from the even places
            there = np.clip(turns[inside] + offsets[mark[inside]], lowest, highest)
            off = (record.times[inside] - time(there)) / time(there, nu=1)
            for other in range(1, marks):
                offsets[other] += float(np.median(off[mark[inside] == other]))
    return offsets


def _refuse_jumps(good: NDArray[np.bool_], times: FloatArray) -> None:
    """Raise where several pulses in a row lie off: no false edges, but a speed that changes as no shaft's does."""
    bad = np.concatenate([[False], ~good, [False]]).astype(np.int8)
    begins, ends = np.flatnonzero(np.diff(bad) == 1), np.flatnonzero(np.diff(bad) == -1)
    long = np.flatnonzero(ends - begins > MAX_SUCCESSIVE_OUTLIERS)
    if long.size:
        raise TachoRefusedError(
            f"tacho: {ends[long[0]] - begins[long[0]]} pulses in a row from {times[begins[long[0]]]:.4f} s on lie off "
            "the smooth angle: the speed jumps there; analyse the record in parts"
        )


def _inner_knots(turns: FloatArray, times: FloatArray) -> list[float]:
    """Return the knots, in revolutions: whole but for the ends, so that the spline is one cubic in each revolution.

    Where the speed n rises by a in every unit of time, n t'' = -a / n², and so on: the cubic misses by about
    h^4 15 a³ / (384 n^6) revolutions where knots lie h apart.
    """
    per_turn = (turns.size - 1) / float(turns[-1] - turns[0])  # pulses a revolution
    span, last = int(max(MAX_KNOT_TURNS * per_turn, DEGREE + 1)), turns.size - 1
    at, knots = 0, [float(turns[0])]
    while True:
        middle = min(max(at, span), max(last - span, 0))
        low, high = max(middle - span, 0), min(middle + span, last)
        before = (turns[middle] - turns[low]) / (times[middle] - times[low]) if middle > low else np.nan
        after = (turns[high] - turns[middle]) / (times[high] - times[middle])
        rise = 2.0 * abs(after - before) / (times[high] - times[low]) if middle > low else 0.0
        bend = 15.0 * rise**3 / (384.0 * after**6)
        straight = (MAX_SPLINE_ERROR / bend) ** 0.25 if bend > 0.0 else MAX_KNOT_TURNS
        apart = max(min(KNOT_TIME * after, straight, MAX_KNOT_TURNS), MIN_KNOT_TURNS)
        step = max(round(apart * per_turn), DEGREE)
        at += step
        if at > last - step:
            return [*knots, float(turns[-1])]
        knots.append(float(round(turns[at])))


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """A spline through pulses: what it leaves of each, s, and the Cholesky factor of its normal equations, banded."""

    time: BSpline
    residual: FloatArray
    factor: FloatArray

    @property
    def scatter(self) -> float:
        """Of the pulses, s: of what is left of them, and of what the fit has taken with it."""
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
    """Return the diagonals of the inverse of a matrix, the main one first, from its banded lower Cholesky factor L.

    Z = (L L')⁻¹ has L' Z = L⁻¹, which is lower triangular, so that its bands follow from the last row upwards
    (K. Takahashi, J. Fagan and M. Chin, PICA conference, 1973).
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
