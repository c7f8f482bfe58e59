"""Shaft angle as a smooth function of time, from pulses of which each is a little off."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

FloatArray = NDArray[np.float64]

DEGREE = 3
KNOT_TURNS = 8.0  # at most: pulses averaged by one piece of the spline
FEWEST_KNOT_TURNS = 3.0
KNOT_TIME = 0.08  # s: slower fluctuations of speed are followed
MAD_TO_SIGMA = 1.4826  # of a normal distribution
OUTLIER, OUTLIER_PART = 6.0, 0.01  # times the scatter, and part of a revolution: further off is another edge


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
    time, residual = _fit(turns, times)
    scatter = MAD_TO_SIGMA * float(np.median(np.abs(residual - np.median(residual))))
    allowed = max(OUTLIER * scatter, OUTLIER_PART * float(times[-1] - times[0]) / float(turns[-1] - turns[0]))
    good = np.abs(residual) <= allowed
    good[[0, -1]] = True  # they carry the ends
    if not good.all() and np.count_nonzero(good) > 2 * DEGREE:
        time, residual = _fit(turns[good], times[good])
        scatter = MAD_TO_SIGMA * float(np.median(np.abs(residual - np.median(residual))))
    return SmoothAngle(time, scatter)


def _fit(turns: NDArray[np.int64], times: FloatArray) -> tuple[BSpline, FloatArray]:
    """Return the spline and what it leaves of each mark, s."""
    span = float(turns[-1] - turns[0])
    apart = min(max(KNOT_TIME * span / float(times[-1] - times[0]), FEWEST_KNOT_TURNS), KNOT_TURNS)
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
