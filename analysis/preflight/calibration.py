"""Fits for `rig calibrate`: the polynomial of a probe's curve, and the switching levels of a tacho."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from analysis.signals import FloatArray
from analysis.signals.errors import CalibrationFitError
from analysis.signals.uncertainty import MAD_TO_SIGMA
from analysis.signals.units import MICROMETRE

MIN_FREEDOM = 1  # points more than coefficients: a polynomial through every point has no residual
GRID_POINTS = 1001
ORDER_RANGE = (1, 7)
DEFAULT_ORDER = 3
EXTREME_PERCENTILES = (0.2, 99.8)  # samples outside are ignored
MIN_SEPARATION = 0.1  # V
MAX_BETWEEN = 0.2  # fraction of the samples in the middle half of the range; a sine has a third there
MIN_SEPARATION_SIGMAS = 6.0  # times the scatter, of levels that are not noise
MAD_TO_RMS = 1.4826  # of normal noise
HYSTERESIS_FRACTION = 0.25  # of the separation: rejects noise, and switches in the steep middle of the edges
HYSTERESIS_SIGMAS = 8.0  # times the scatter
MAX_HYSTERESIS_FRACTION = 0.6  # of the separation


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationFit:
    """A fitted polynomial: gap = sum of ``coefficients[k] * volts**k``.

    Parameters
    ----------
    coefficients : tuple of float
        In rising order, m per V**k.
    volts_low, volts_high : float
        Calibrated voltage range, V.
    residuals : ndarray of float64, shape (n,)
        Gap of the polynomial minus measured gap, m, per point.
    """

    coefficients: tuple[float, ...]
    volts_low: float
    volts_high: float
    residuals: FloatArray

    @property
    def order(self) -> int:
        """Order of the polynomial."""
        return len(self.coefficients) - 1

    @property
    def residual(self) -> float:
        """Largest deviation of a point from the polynomial, m."""
        return float(np.max(np.abs(self.residuals)))


def default_order(points: int) -> int:
    """Return the default polynomial order for a number of points: 3, lower with few points."""
    return max(ORDER_RANGE[0], min(DEFAULT_ORDER, points - 1 - MIN_FREEDOM))


def fit_calibration(gaps: FloatArray, volts: FloatArray, order: int) -> CalibrationFit:
    """Fit a polynomial of gap over voltage to points by least squares.

    Parameters
    ----------
    gaps : ndarray of float64, shape (n,)
        Micrometer settings, m, in any sequence.
    volts : ndarray of float64, shape (n,)
        Output voltages of the conditioner, V.
    order : int
        Order of the polynomial, 1 to 7.

    Raises
    ------
    ValueError
        Shapes, or an order outside 1 to 7.
    CalibrationFitError
        Too few points, points that are not finite or whose voltage does not rise with the gap, or a polynomial that
        does not rise between them.

    Notes
    -----
    API 670 requires the points of a probe's curve and the largest deviation from it; here the curve is a polynomial
    instead of a straight line, as the calibrated range exceeds the linear range.
    """
    gaps, volts = np.asarray(gaps, dtype=np.float64), np.asarray(volts, dtype=np.float64)
    if gaps.ndim != 1 or gaps.shape != volts.shape:
        raise ValueError(f"gaps, volts: shapes {gaps.shape} and {volts.shape}, expected the same, (n,)")
    if not ORDER_RANGE[0] <= order <= ORDER_RANGE[1]:
        raise ValueError(f"order {order}, expected {ORDER_RANGE[0]} to {ORDER_RANGE[1]}")
    fewest = order + 1 + MIN_FREEDOM
    if gaps.size < fewest:
        raise CalibrationFitError(f"{gaps.size} points, expected at least {fewest} for a polynomial of order {order}")
    if not (np.all(np.isfinite(gaps)) and np.all(np.isfinite(volts))):
        raise CalibrationFitError("a point is not a finite number")
    _require_rising(gaps, volts)
    low, high = float(volts.min()), float(volts.max())
    fitted = Polynomial.fit(volts, gaps, order).convert()
    coefficients = tuple(float(c) for c in np.pad(fitted.coef, (0, order + 1 - fitted.coef.size)))
    slopes = fitted.deriv()(np.linspace(low, high, GRID_POINTS))
    if np.any(slopes <= 0.0):
        at = float(np.linspace(low, high, GRID_POINTS)[int(np.argmin(slopes))])
        odd = _odd_point(gaps, volts, order)
        without = "" if odd is None else f", or leave out the point at {gaps[odd] / MICROMETRE:g} µm"
        raise CalibrationFitError(
            f"the polynomial of order {order} falls at {at:.2f} V, expected a rise: try a lower order{without}"
        )
    return CalibrationFit(coefficients, low, high, np.asarray(fitted(volts) - gaps, dtype=np.float64))


def _odd_point(gaps: FloatArray, volts: FloatArray, order: int) -> int | None:
    """Return the point whose omission gives a rising polynomial with the best fit; None if there is none."""
    best, odd = np.inf, None
    for k in range(gaps.size if gaps.size > order + 1 + MIN_FREEDOM else 0):
        others = np.delete(volts, k), np.delete(gaps, k)
        fitted = Polynomial.fit(*others, order)
        slopes = fitted.deriv()(np.linspace(others[0].min(), others[0].max(), GRID_POINTS))
        residual = float(np.max(np.abs(fitted(others[0]) - others[1])))
        if np.all(slopes > 0.0) and residual < best:
            best, odd = residual, k
    return odd


def _require_rising(gaps: FloatArray, volts: FloatArray) -> None:
    """Raise CalibrationFitError unless the voltage rises with the gap."""
    by_gap = np.argsort(gaps, kind="stable")
    gaps, volts = gaps[by_gap], volts[by_gap]
    falls = np.flatnonzero((np.diff(volts) <= 0.0) & (np.diff(gaps) > 0.0))
    if falls.size == 0 and gaps[0] < gaps[-1]:
        return
    first = int(falls[0]) if falls.size else 0
    one, other = gaps[first : first + 2] / MICROMETRE if gaps.size > 1 else (np.nan, np.nan)
    after = min(first + 1, volts.size - 1)
    raise CalibrationFitError(
        f"{volts[first]:.3f} V at {one:g} µm, {volts[after]:.3f} V at {other:g} µm: expected a voltage that rises with "
        "the gap (wires exchanged, micrometer read the other way round, or a misread step?)"
    )


@dataclass(frozen=True, slots=True)
class SignalLevels:
    """The two levels between which a voltage switches.

    Parameters
    ----------
    low, high : float
        Medians of the lower and the upper level, V.
    scatter : float
        Robust standard deviation about the levels, the larger of both, V.
    high_fraction : float
        Fraction of the samples above the middle, 0 to 1.
    """

    low: float
    high: float
    scatter: float
    high_fraction: float

    @property
    def separation(self) -> float:
        """Distance of the levels, V."""
        return self.high - self.low

    @property
    def middle(self) -> float:
        """Halfway between the levels, V."""
        return 0.5 * (self.low + self.high)

    @property
    def hysteresis(self) -> float:
        """Suitable hysteresis, V: a quarter of the separation, more with noise."""
        wanted = max(HYSTERESIS_FRACTION * self.separation, HYSTERESIS_SIGMAS * self.scatter)
        return min(wanted, MAX_HYSTERESIS_FRACTION * self.separation)


def find_state_levels(volts: FloatArray) -> SignalLevels | None:
    """Return the two levels of a voltage; None where it does not switch between two levels.

    Parameters
    ----------
    volts : ndarray of float64, shape (n,)
        Consecutive samples, V.

    Raises
    ------
    ValueError
        There are no samples, or not one dimension.

    Notes
    -----
    State levels of a pulse signal as in IEEE Std 181, but from quantiles and medians instead of a histogram.
    """
    if volts.ndim != 1 or volts.size == 0:
        raise ValueError(f"volts: shape {volts.shape}, expected (n,) with n > 0")
    bottom, top = np.percentile(volts, EXTREME_PERCENTILES)
    span = top - bottom
    if span < MIN_SEPARATION:
        return None
    between = np.mean((volts > bottom + 0.25 * span) & (volts < top - 0.25 * span))
    if between > MAX_BETWEEN:
        return None
    is_high = volts > 0.5 * (bottom + top)
    levels = [float(np.median(volts[part])) for part in (~is_high, is_high)]
    scatters = [
        MAD_TO_SIGMA * float(np.median(np.abs(volts[part] - level)))
        for part, level in zip((~is_high, is_high), levels, strict=True)
    ]
    found = SignalLevels(levels[0], levels[1], max(scatters), float(np.mean(is_high)))
    return found if found.separation >= max(MIN_SEPARATION, MIN_SEPARATION_SIGMAS * found.scatter) else None
