"""Forward and backward circles of a spectrum, and how far unequal probes may have made the backward ones."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.resampling.angular_record import AngularRecord
from analysis.signals.probes import ProbePair
from analysis.spectra.order_map import OrderMap

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

MIN_LINE_TO_FLOOR = 10.0  # times the floor: lines that tell of the probes
PROBE_TOLERANCE = 0.05  # of a probe's sensitivity, what API 670 is quoted to allow: a mismatch nobody may exclude
MAX_REDUCED_CHI_SQUARE = 4.0  # mean square of what one mismatch leaves of the lines, over their variance
LINE_UNCERTAINTY = 5e-4  # of a line: what leakage and a probe's curve leave uncertain beside the noise


@dataclass(frozen=True, slots=True)
class ProbeMismatch:
    """What all strong components have in common that no shaft would give them.

    Parameters
    ----------
    gain : float
        Sensitivity of probe y over probe x less 1, as the lines say; 0 where they do not tell.
    skew : float
        Angle by which the probes' directions or instants miss what is configured, rad.
    sigma : float
        Standard deviation of both, from the floor.
    is_told : bool
        Whether several components of different order agree on it. One component alone, or a shaft whose components
        are elliptic each in its own way, says nothing: an ellipse and a mismatch look the same there.
    components : int
        Strong components that were asked.
    """

    gain: float
    skew: float
    sigma: float
    is_determined: bool
    components: int

    def corrected(self, vectors: ComplexArray) -> ComplexArray:
        """Return vectors at the probes, shape (2, ...), with probe y brought to probe x; as they are if not told."""
        if not self.is_determined:
            return vectors
        right = vectors.copy()
        right[1] = (vectors[1] - self.skew * vectors[0]) / (1.0 + self.gain)
        return right

    def correct_record(self, record: AngularRecord) -> AngularRecord:
        """Return a record with probe y brought to probe x, before orbits and sections are made of both."""
        if not self.is_determined:
            return record
        x, y = record.waveform
        return record.with_waveform(np.stack([x, (y - self.skew * x) / (1.0 + self.gain)]))


@dataclass(frozen=True, slots=True, eq=False)
class FullSpectrum:
    """Circles that go round with the shaft and against it, per order.

    Parameters
    ----------
    orders : ndarray of float64, shape (n_orders,)
        From 0.
    forward, backward : ndarray of complex128, shape (..., n_orders)
        X + iY = forward exp(i order theta) + backward exp(-i order theta), m peak.
    uncertain : ndarray of bool, shape (..., n_orders)
        Backward (or forward) circles so small beside their counterpart that probes within their tolerance could have
        made them: no whirl may be concluded from these.
    mismatch : ProbeMismatch
        Of the probes; taken out of the circles where it is told.
    """

    orders: FloatArray
    forward: ComplexArray
    backward: ComplexArray
    uncertain: NDArray[np.bool_]
    mismatch: ProbeMismatch

    @property
    def axis(self) -> FloatArray:
        """Orders from the highest backward one, negative, through 0 to the highest forward one."""
        return np.concatenate([-self.orders[:0:-1], self.orders])

    @property
    def amplitudes(self) -> FloatArray:
        """Amplitudes on that axis, shape (..., 2 n_orders - 1), m peak; at 0 the mean's distance from its zero."""
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
        From `probe_mismatch`; None takes the probes as they are.

    Notes
    -----
    forward = (X + iY) / 2, backward = conj(X - iY) / 2 in the bench's directions (P. Goldman and A. Muszynska,
    Application of full spectrum to rotating machinery diagnostics, Orbit 20, 1999; C.-W. Lee, Vibration Analysis of
    Rotors, 1993). The real line at 0 has no circles: forward holds X + iY there, backward 0.
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
    """Return the mismatch of gain and direction that all strong components of a record share.

    A forward circle seen through a probe y that is too sensitive by g and turned by s has a backward circle of
    -(g + i s) / 2 times its conjugate, whatever its order. Lines of the mean power spectrum that stand out are asked;
    they must agree, in size and sign, and be at least two.

    Parameters
    ----------
    order_map : OrderMap
        Of a record; two probes at right angles, X and Y in the bench's sense.

    Notes
    -----
    The circles are linear in the probes' signals (C.-W. Lee, Vibration Analysis of Rotors, 1993); that several
    components must agree before a mismatch is believed is this program's own rule.
    """
    spectrum = order_map.spectrum
    size = np.sqrt(np.mean(np.abs(spectrum) ** 2, axis=(0, 1)))
    peak = np.zeros(size.size, dtype=np.bool_)
    peak[1:-1] = (size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])
    peak &= size > MIN_LINE_TO_FLOOR * max(float(np.median(order_map.noise)), 1e-300)
    lines = np.flatnonzero(peak)
    # Along the probes: x is the reference direction, y lies a quarter turn further in the turning sense.
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
    floor = order_map.noise[:, None] / np.sqrt(2.0 * np.log(2.0))
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
    """Return the largest circles of each bin of speed: a full cascade.

    Parameters
    ----------
    order_map : OrderMap
        Of a record.
    width : float
        Of a bin, rad/s.
    mismatch : ProbeMismatch or None
        As for `full_spectrum`.

    Returns
    -------
    speeds : ndarray of float64, shape (n_rows,)
        Middle of each bin that holds frames, rad/s, rising.
    spectra : FullSpectrum
        One row for each; of every line the frame with its largest circle, forward and backward apart.

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
