"""Order spectra of waveforms that are sampled uniformly in shaft angle.

Conventions, written once: the window is the periodic Hann window; amplitudes are zero-to-peak; the phase is referred
to the first sample, so that x(theta) = Re[X exp(i k theta)] where the first sample lies on the tacho mark. A frame of
N whole revolutions resolves 1 / N orders, a single line on a bin is exact, and two lines must be two bins apart.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@lru_cache(maxsize=16)
def hann(n: int) -> FloatArray:
    """Return the periodic Hann window of ``n`` points, scaled to a sum of 1 (shared: read only)."""
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(n) / n)
    window /= window.sum()
    window.flags.writeable = False
    return window


def order_spectrum(waveform: FloatArray, revolutions: int) -> tuple[FloatArray, ComplexArray]:
    """Return the Hann-windowed order spectrum of whole revolutions.

    Parameters
    ----------
    waveform : ndarray of float64, shape (..., n)
        Samples uniformly in angle over ``revolutions`` whole revolutions, the first at theta = 0, any unit.
    revolutions : int
        Number of revolutions that the n samples span; at least 1, and n at least 2 a revolution.

    Returns
    -------
    orders : ndarray of float64, shape (n // 2 + 1,)
        Order axis, from 0, step ``1 / revolutions``.
    spectrum : ndarray of complex128, shape (..., n // 2 + 1)
        Complex peak amplitude in the waveform's unit, x(theta) = Re[X exp(i order theta)]; line 0 is the mean.

    Raises
    ------
    ValueError
        Where the samples are too few for the revolutions, or not finite.

    Notes
    -----
    X_k = 2 / sum(w) * sum_n w_n x_n exp(-2 pi i k n / N) (A. Brandt, Noise and Vibration Analysis, 2011, ch. 9).
    """
    waveform = np.asarray(waveform, dtype=np.float64)
    if waveform.ndim == 0 or revolutions < 1 or waveform.shape[-1] < 2 * revolutions:
        raise ValueError(
            f"waveform of shape {waveform.shape} over {revolutions} revolutions: expected at least 1 revolution and "
            "2 samples a revolution on the last axis"
        )
    if not np.isfinite(waveform).all():
        raise ValueError("waveform: holds values that are not finite")
    n = waveform.shape[-1]
    spectrum = 2.0 * np.fft.rfft(waveform * hann(n), axis=-1)
    spectrum[..., 0] *= 0.5
    if n % 2 == 0:
        spectrum[..., -1] *= 0.5  # the line at half the sampling has no mirror image either
    orders = np.arange(spectrum.shape[-1]) / revolutions
    return orders, spectrum


def order_vectors(spectrum: ComplexArray, revolutions: int, count: int) -> ComplexArray:
    """Return the vectors of the whole orders 1 to ``count``.

    Parameters
    ----------
    spectrum : ndarray of complex128, shape (..., n_orders)
        From `order_spectrum`.
    revolutions : int
        Revolutions in its frame.
    count : int
        Number of whole orders.

    Returns
    -------
    ndarray of complex128, shape (count, ...)
        ``vectors[k - 1]`` is the kX vector, peak; 0 where the spectrum ends below k.

    Notes
    -----
    Lines of the spectrum at whole orders: with whole revolutions in the frame they lie on them (A. Brandt, Noise and
    Vibration Analysis, 2011, ch. 12).
    """
    lines = revolutions * np.arange(1, count + 1)
    vectors = np.zeros((count, *spectrum.shape[:-1]), dtype=np.complex128)
    inside = lines < spectrum.shape[-1]
    vectors[inside] = np.moveaxis(spectrum[..., lines[inside]], -1, 0)
    return vectors
