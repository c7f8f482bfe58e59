"""Full spectrum: forward and backward circles of each order, and the probe mismatch that can mimic backward ones."""

from dataclasses import dataclass

import numpy as np

from analysis.resampling.angular_record import AngularRecord
from analysis.signals import BoolArray, ComplexArray, FloatArray
from analysis.signals.probes import ProbePair
from analysis.signals.uncertainty import noise_floor_sigma
from analysis.spectra.order_map import OrderMap

MIN_LINE_TO_FLOOR = 10.0  # of lines from which the mismatch is determined
PROBE_TOLERANCE = 0.05  # of a probe's sensitivity, as quoted from API 670: a mismatch that cannot be excluded
MAX_REDUCED_CHI_SQUARE = 4.0  # of the lines about one common mismatch
LINE_UNCERTAINTY = 5e-4  # of a line, from leakage and probe nonlinearity, in addition to noise


@dataclass(frozen=True, slots=True)
class ProbeMismatch:
    """Mismatch of two probes in sensitivity and direction, from the strong components of a record.

    Parameters
    ----------
    gain : float
        Sensitivity of probe y over probe x, minus 1; 0 where not determined.
    skew : float
        Error of the configured angle between the probes, or of their relative sampling time, as an angle, rad.
    sigma : float
        Standard deviation of both, from the noise floor.
    is_determined : bool
        Whether several components of different order agree on it. A single component, or components with different
        ellipses, determine nothing: an ellipse and a mismatch look the same.
    components : int
        Number of strong components used.
    """

    gain: float
    skew: float
    sigma: float
    is_determined: bool
    components: int

    def corrected(self, vectors: ComplexArray) -> ComplexArray:
        """Return vectors at the probes, shape (2, ...), with probe y corrected; unchanged if not determined."""
        if not self.is_determined:
            return vectors
        right = vectors.copy()
        right[1] = (vectors[1] - self.skew * vectors[0]) / (1.0 + self.gain)
        return right

    def correct_record(self, record: AngularRecord) -> AngularRecord:
        """Return a record with probe y corrected, for orbits and Poincaré sections; unchanged if not determined."""
        if not self.is_determined:
            return record
        x, y = record.waveform
        return record.with_waveform(np.stack([x, (y - self.skew * x) / (1.0 + self.gain)]))


@dataclass(frozen=True, slots=True, eq=False)
class FullSpectrum:
    """Forward and backward circles of each order.

    Parameters
    ----------
    orders : ndarray of float64, shape (n_orders,)
        From 0.
    forward, backward : ndarray of complex128, shape (..., n_orders)
        X + iY = forward exp(i order theta) + backward exp(-i order theta), m peak.
    uncertain : ndarray of bool, shape (..., n_orders)
        Circles so small relative to their counterpart that a probe mismatch within tolerance could cause them: do not
        conclude a backward (or forward) whirl from these.
    mismatch : ProbeMismatch
        Mismatch of the probes; the circles are corrected for it where it is determined.
    """

    orders: FloatArray
    forward: ComplexArray
    backward: ComplexArray
    uncertain: BoolArray
    mismatch: ProbeMismatch

    @property
    def axis(self) -> FloatArray:
        """Order axis from the highest backward order, negative, through 0 to the highest forward order."""
        return np.concatenate([-self.orders[:0:-1], self.orders])

    @property
    def amplitudes(self) -> FloatArray:
        """Amplitudes on that axis, shape (..., 2 n_orders - 1), m peak; at order 0 the distance of the mean from 0."""
        return np.concatenate([np.abs(self.backward[..., :0:-1]), np.abs(self.forward)], axis=-1)


def full_spectrum(
    orders: FloatArray, spectrum: ComplexArray, pair: ProbePair, mismatch: ProbeMismatch | None = None
) -> FullSpectrum:
    """Return the full spectrum of two probes.

    Parameters
    ----------
    orders : ndarray of float64, shape (n_orders,)
        From 0.
    spectrum : ndarray of complex128, shape (2, ..., n_orders)
        At the probes x and y, m peak, x = Re[X exp(i order theta)].
    pair : ProbePair
        Directions of the probes.
    mismatch : ProbeMismatch or None
        From `probe_mismatch`; None applies no correction.

    Notes
    -----
    forward = (X + iY) / 2, backward = conj(X - iY) / 2 in the bench axes (P. Goldman and A. Muszynska,
    Application of full spectrum to rotating machinery diagnostics, Orbit 20, 1999; C.-W. Lee, Vibration Analysis of
    Rotors, 1993). The real line at order 0 has no circles: there forward is X + iY, backward 0.
    """
    found = mismatch or ProbeMismatch(0.0, 0.0, np.nan, is_determined=False, components=0)
    X, Y = pair.vectors_to_bench(found.corrected(spectrum))
    forward, backward = 0.5 * (X + 1j * Y), 0.5 * np.conj(X - 1j * Y)
    forward[..., 0] *= 2.0
    backward[..., 0] = 0.0
    possible = 3.0 * found.sigma if found.is_determined else 0.5 * PROBE_TOLERANCE
    smaller = np.minimum(np.abs(forward), np.abs(backward))
    uncertain = smaller < possible * np.maximum(np.abs(forward), np.abs(backward))
    uncertain[..., 0] = False
    return FullSpectrum(orders, forward, backward, uncertain, found)


def probe_mismatch(order_map: OrderMap) -> ProbeMismatch:
    """Return the mismatch of sensitivity and direction that all strong components of a record share.

    A forward circle measured with a probe y that is too sensitive by g and rotated by s has a backward circle of
    -(g + i s) / 2 times its conjugate, for any order. At least two strong lines of the mean power spectrum must agree
    on it in size and sign.

    Parameters
    ----------
    order_map : OrderMap
        Order map of a record with two probes at right angles.

    Notes
    -----
    The circles are linear in the probe signals (C.-W. Lee, Vibration Analysis of Rotors, 1993). That several
    components must agree is a rule of this program.
    """
    spectrum = order_map.spectrum
    size = np.sqrt(np.mean(np.abs(spectrum) ** 2, axis=(0, 1)))
    peak = np.zeros(size.size, dtype=np.bool_)
    peak[1:-1] = (size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])
    peak &= size > MIN_LINE_TO_FLOOR * max(float(np.median(order_map.noise)), 1e-300)
    lines = np.flatnonzero(peak)
    # In probe directions: y leads x by 90° in the direction of rotation, or lags it where lead = -1.
    lead = order_map.pair.lead
    x, y = spectrum[0][:, lines], spectrum[1][:, lines]
    forward, backward = 0.5 * (x + 1j * lead * y), 0.5 * (x - 1j * lead * y)
    with_shaft = np.sum(np.abs(forward) ** 2, axis=0) >= np.sum(np.abs(backward) ** 2, axis=0)
    main, other = np.where(with_shaft, forward, backward), np.where(with_shaft, backward, forward)
    energy = np.sum(np.abs(main) ** 2, axis=0)
    if lines.size < 2:
        return ProbeMismatch(0.0, 0.0, np.nan, is_determined=False, components=int(lines.size))
    ratio = np.sum(other * np.conj(main), axis=0) / energy  # -(g + i s) / 2 forward, -(g - i s) / 2 backward
    ratio = np.where(with_shaft, ratio, np.conj(ratio))
    floor = noise_floor_sigma(order_map.noise)[:, None]
    variance = np.sum((floor * np.abs(main)) ** 2, axis=0) / energy**2
    weight = 1.0 / (variance + LINE_UNCERTAINTY**2)
    mean = complex(np.sum(weight * ratio) / np.sum(weight))
    chi = float(np.sum(weight * np.abs(ratio - mean) ** 2) / (2.0 * (lines.size - 1)))
    sigma = 2.0 * float(np.sqrt(max(chi, 1.0) / np.sum(weight)))
    agrees = chi < MAX_REDUCED_CHI_SQUARE and abs(mean) < PROBE_TOLERANCE and abs(lead) == 1.0
    if not agrees:
        return ProbeMismatch(0.0, 0.0, np.nan, is_determined=False, components=int(lines.size))
    return ProbeMismatch(
        -2.0 * mean.real, -2.0 * mean.imag * lead, sigma, is_determined=True, components=int(lines.size)
    )


def full_cascade(
    order_map: OrderMap, width: float, mismatch: ProbeMismatch | None = None
) -> tuple[FloatArray, FullSpectrum]:
    """Return a full cascade: the largest circles in each bin of speed.

    Parameters
    ----------
    order_map : OrderMap
        Order map of a record.
    width : float
        Width of a bin, rad/s.
    mismatch : ProbeMismatch or None
        As for `full_spectrum`.

    Returns
    -------
    speeds : ndarray of float64, shape (n_rows,)
        Middle of each bin that contains frames, rad/s, rising.
    spectra : FullSpectrum
        One row per bin; for each line the largest circle of all frames, forward and backward separately.

    Notes
    -----
    P. Goldman and A. Muszynska, Application of full spectrum to rotating machinery diagnostics, Orbit 20, 1999.
    """
    if not width > 0.0:
        raise ValueError(f"width: {width} rad/s, expected more than 0")
    every = full_spectrum(order_map.orders, order_map.spectrum, order_map.pair, mismatch)
    number = np.round(order_map.speeds / width).astype(np.int64)
    bins = np.unique(number)
    forward = np.empty((bins.size, every.orders.size), dtype=np.complex128)
    backward = np.empty_like(forward)
    uncertain = np.empty(forward.shape, dtype=np.bool_)
    for row, one in enumerate(bins):
        frames = np.flatnonzero(number == one)
        for target, source in ((forward, every.forward), (backward, every.backward)):
            largest = np.argmax(np.abs(source[frames]), axis=0)
            target[row] = np.take_along_axis(source[frames], largest[None], axis=0)[0]
        uncertain[row] = every.uncertain[frames].all(axis=0)
    spectra = FullSpectrum(every.orders, forward, backward, uncertain, every.mismatch)
    return np.asarray(bins * width, dtype=np.float64), spectra
