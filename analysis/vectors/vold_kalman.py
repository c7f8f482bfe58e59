"""Second-generation Vold-Kalman filter: complex envelopes of several components, sample by sample."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, solveh_banded

from analysis.resampling.rate_conversion import DecimationPyramid
from analysis.signals import ComplexArray, FloatArray
from analysis.signals.errors import BandLimitError, RecordTooShortError
from analysis.signals.probes import require_displacement
from analysis.tacho.shaft_angle import ShaftAngle

MAX_ORDER_FRACTION = 0.2  # of the decimated rate: the highest order lies below it
MEAN_BANDWIDTH = 0.5  # of the lowest component's frequency: at most the bandwidth of the mean
POLES = 2  # order of the differences of the envelope that are minimised
MAX_WEIGHT = 1e13  # of the structural equation: above it the solution is ill-conditioned
HALF_POWER = np.sqrt(2.0) - 1.0
_STENCIL = np.array([1.0, -2.0, 1.0])


@dataclass(frozen=True, slots=True, eq=False)
class OrderEnvelopes:
    """Complex envelopes of several components from one joint solution.

    Parameters
    ----------
    orders : tuple of float
        Frequencies over shaft frequency.
    envelopes : ndarray of complex128, shape (n_components, n)
        In the unit of the waveform, peak: x(t) = sum Re[X exp(i phase(t))]; the orders first, then the others.
    sigma : ndarray of float64, shape (n_components, n)
        Standard deviation of each amplitude, from the residual, assumed white noise.
    phases : ndarray of float64, shape (n_components, n)
        Phase of each component, rad: order times the angle of the shaft.
    mean : ndarray of float64, shape (n,)
        Slowly varying mean.
    residual : ndarray of float64, shape (n,)
        Waveform minus mean and all components.
    """

    orders: tuple[float, ...]
    envelopes: ComplexArray
    sigma: FloatArray
    phases: FloatArray
    mean: FloatArray
    residual: FloatArray

    def waveform(self, index: int) -> FloatArray:
        """Return the waveform of one component, shape (n,), in the unit of the input."""
        return np.asarray((self.envelopes[index] * np.exp(1j * self.phases[index])).real, dtype=np.float64)


def order_envelopes(
    waveform: FloatArray,
    angle: FloatArray,
    rate: float,
    orders: tuple[float, ...],
    *,
    bandwidth: float | None = None,
    bandwidth_percent: float | None = None,
    others: tuple[FloatArray, ...] = (),
) -> OrderEnvelopes:
    """Return the envelopes of several orders of a waveform, solved together with its mean and other components.

    Decimate first (`resampling.decimation`): the computing time grows with the rate, and at a rate far above the
    bandwidth the equations are ill-conditioned, which raises ValueError.

    Parameters
    ----------
    waveform : ndarray of float64, shape (n,)
        Uniformly in time, any unit.
    angle : ndarray of float64, shape (n,)
        Angle of the shaft at the samples, rad, rising.
    rate : float
        Sample rate, Hz.
    orders : tuple of float
        Above 0, all different.
    bandwidth : float or None
        Full width at half power, Hz, the same at every speed.
    bandwidth_percent : float or None
        Full width at half power in per cent of each component's frequency. Exactly one of the two must be given.
    others : tuple of ndarray of float64, shape (n,)
        Phases of components that are no order of the shaft, rad, rising: 2 pi f t of a fixed frequency as mains hum, or
        an order of another shaft.

    Raises
    ------
    RecordTooShortError
        Fewer than 8 samples, or too few to resolve the orders at this bandwidth.
    BandLimitError
        Orders above 0.45 of the rate, or a bandwidth that is impossible at this rate.
    ValueError
        Shapes, orders or bandwidths that no record allows.

    Notes
    -----
    Minimises ``sum |r (second difference of X_k)|² + |x - X_0 - sum Re[X_k exp(i phase_k)]|²`` over all X_k
    together, with a real X_0, the mean, of the narrowest bandwidth, at most half the lowest frequency. The weight r
    follows from the bandwidth B: r² (2 sin(pi B / (2 rate)))^4 = (sqrt 2 - 1) / 2, as half the power of a real
    waveform is at positive frequencies (H. Vold and J. Leuridan, SAE 931288, 1993; J. Tuma, Setting the passband
    width in the Vold-Kalman order tracking filter, ICSV 12, 2005). The normal equations are banded: the unknowns
    are the real and imaginary parts of all components and the mean at one sample, then those at the next sample.
    """
    waveform, angle = np.asarray(waveform, dtype=np.float64), np.asarray(angle, dtype=np.float64)
    _check(waveform, angle, orders, others)
    phases = np.stack([*(order * angle for order in orders), *others])
    n, count = waveform.size, len(phases)
    frequencies = np.gradient(phases, axis=1) * rate / (2.0 * np.pi)
    highest = float(frequencies.max())
    if highest > 0.45 * rate:
        raise BandLimitError(
            f"a component reaches {highest:.0f} Hz, expected at most 0.45 of the rate, {0.45 * rate:.0f} Hz"
        )
    widths = _widths(frequencies, bandwidth, bandwidth_percent)
    weights = _weights(widths, rate)
    of_mean = _weights(np.minimum(widths.min(axis=0), MEAN_BANDWIDTH * frequencies.min(axis=0)), rate)
    turning = np.exp(1j * phases)
    rows = np.stack([turning.real, -turning.imag], axis=1).reshape(2 * count, n)  # x = rows · (Re, Im)
    rows, weights = np.vstack([rows, np.ones(n)]), np.vstack([np.repeat(weights, 2, axis=0), of_mean])
    parts = _solution(rows, weights, waveform).reshape(n, 2 * count + 1).T
    envelopes = parts[:-1:2] + 1j * parts[1:-1:2]
    rest = waveform - parts[-1] - (envelopes * turning).real.sum(axis=0)
    # sigma_A = sigma_x sqrt(2 * noise bandwidth / rate). The noise bandwidth of a filter 1 / (1 + u^4) is
    # 3 pi / (8 sqrt 2) of its corner u = 1 on either side, which is HALF_POWER^(-1/4) times the half-power point.
    noise_width = widths * 3.0 * np.pi / (8.0 * np.sqrt(2.0)) * HALF_POWER**-0.25
    sigma = float(np.std(rest)) * np.sqrt(2.0 * noise_width / rate)
    return OrderEnvelopes(tuple(orders), envelopes, sigma, phases, parts[-1], rest)


def probe_envelopes(
    displacement: FloatArray,
    rate: float,
    angle: ShaftAngle,
    orders: tuple[float, ...],
    *,
    bandwidth: float | None = None,
    bandwidth_percent: float | None = None,
    others: tuple[FloatArray, ...] = (),
) -> tuple[FloatArray, tuple[OrderEnvelopes, OrderEnvelopes]]:
    """Return the envelopes of several orders at both probes of a record, decimated as far as the orders allow.

    Parameters
    ----------
    displacement : ndarray of float64, shape (2, n)
        Towards the probes x and y, uniformly in time, m.
    rate : float
        Sample rate, Hz.
    angle : ShaftAngle
        Time against revolutions, where time 0 is the first sample.
    orders : tuple of float
        Above 0, all different.
    bandwidth, bandwidth_percent, others
        As for `order_envelopes`; the phases of other components at the samples of the displacement.

    Returns
    -------
    times : ndarray of float64, shape (m,)
        Times of the envelopes, s.
    envelopes : tuple of OrderEnvelopes
        Envelopes at the probes x and y, m peak.

    Raises
    ------
    RecordTooShortError, BandLimitError, ValueError
        As for `order_envelopes`.

    Notes
    -----
    As `order_envelopes`, after decimation: H. Vold and J. Leuridan, SAE 931288, 1993.
    """
    require_displacement(displacement, rate)
    if not orders:
        raise ValueError("orders: none, expected one at least")
    fastest = float(angle.speed(np.linspace(angle.first, angle.last, 1_000)).max()) / (2.0 * np.pi)
    highest = max([max(orders) * fastest, *(float(np.diff(phase).max()) * rate / (2.0 * np.pi) for phase in others)])
    level = max(int(np.floor(np.log2(MAX_ORDER_FRACTION * rate / highest))), 0)
    pyramid = DecimationPyramid(2, level + 1, displacement.shape[1], 0)
    pyramid.push(displacement)
    samples, origin = pyramid.level(level)
    thinned = rate / 2**level
    times = (origin + np.arange(samples.shape[1])) / thinned
    turns = angle.turns(times)
    known = np.isfinite(turns)
    times, turns, samples = times[known], turns[known], samples[:, known]
    positions = np.arange(displacement.shape[1]) / rate
    rest = tuple(np.interp(times, positions, phase) for phase in others)
    x, y = (
        order_envelopes(
            row,
            2.0 * np.pi * turns,
            thinned,
            orders,
            bandwidth=bandwidth,
            bandwidth_percent=bandwidth_percent,
            others=rest,
        )
        for row in samples
    )
    return times, (x, y)


def _widths(frequencies: FloatArray, bandwidth: float | None, bandwidth_percent: float | None) -> FloatArray:
    """Return the bandwidth of each component at each sample, Hz, for components at these frequencies, Hz."""
    if bandwidth is not None and bandwidth_percent is None:
        return np.full(frequencies.shape, bandwidth)
    if bandwidth is None and bandwidth_percent is not None:
        return 0.01 * bandwidth_percent * frequencies
    raise ValueError("bandwidth, bandwidth_percent: expected one of the two, Hz or per cent of the order")


def _solution(rows: FloatArray, weights: FloatArray, waveform: FloatArray) -> FloatArray:
    """Return real and imaginary parts of the envelopes and the mean, sample by sample."""
    equations = _equations(rows, weights)
    try:
        solution = solveh_banded(equations, (rows * waveform).T.ravel(), lower=True, check_finite=False)
    except LinAlgError:
        raise RecordTooShortError(
            f"{waveform.size} samples do not resolve these orders at this bandwidth: expected a longer record, or a "
            "wider band"
        ) from None
    return np.asarray(solution, dtype=np.float64)


def _check(waveform: FloatArray, angle: FloatArray, orders: tuple[float, ...], others: tuple[FloatArray, ...]) -> None:
    if waveform.ndim != 1 or any(waveform.shape != phase.shape for phase in (angle, *others)):
        shapes = ", ".join(str(phase.shape) for phase in (waveform, angle, *others))
        raise ValueError(f"waveform, angle, others: shapes {shapes}, expected all (n,)")
    if waveform.size < 8:
        raise RecordTooShortError(f"{waveform.size} samples, expected at least 8")
    rises = all(np.isfinite(phase).all() and (np.diff(phase) > 0.0).all() for phase in (angle, *others))
    if not (np.isfinite(waveform).all() and rises):
        raise ValueError("waveform, angle, others: expected finite values and phases that rise")
    if not orders or min(orders) <= 0.0 or len(set(orders)) != len(orders):
        raise ValueError(f"orders: {orders}, expected at least one, above 0, all different")


def _weights(widths: FloatArray, rate: float) -> FloatArray:
    """Return r² of each order at each sample."""
    narrowest, widest = float(widths.min()), float(widths.max())
    if not narrowest > 0.0:
        raise ValueError(f"bandwidth: {narrowest} Hz, expected above 0")
    if not widest < 0.5 * rate:
        raise BandLimitError(f"bandwidth: {narrowest} to {widest} Hz, expected above 0 to below {0.5 * rate} Hz")
    weights = 0.5 * HALF_POWER / (2.0 * np.sin(0.5 * np.pi * widths / rate)) ** (2 * POLES)
    if float(weights.max()) > MAX_WEIGHT:
        lowest = rate * 2.0 / np.pi * 0.5 * (0.5 * HALF_POWER / MAX_WEIGHT) ** (0.5 / POLES)
        raise BandLimitError(
            f"bandwidth: {narrowest:.3g} Hz at {rate:.0f} samples a second, expected at least {lowest:.3g} Hz: "
            "decimate the waveform"
        )
    return np.asarray(weights, dtype=np.float64)


def _equations(rows: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the lower diagonals of the normal equations, shape (POLES * m + 1, n * m), of m unknowns a sample."""
    m, n = rows.shape
    bands = np.zeros((POLES * m + 1, n, m))
    for lag in range(m):  # unknown i + lag against i, at one sample
        for i in range(m - lag):
            bands[lag, :, i] = rows[i] * rows[i + lag]
    for i in range(m):
        middle = weights[i, 1:-1]
        for first in range(POLES + 1):
            for second in range(first, POLES + 1):
                begin = first
                bands[(second - first) * m, begin : begin + middle.size, i] += (
                    middle * _STENCIL[first] * _STENCIL[second]
                )
    return bands.reshape(POLES * m + 1, n * m)
