"""Order spectra of waveforms sampled uniformly in shaft angle.

Conventions: zero-to-peak amplitudes; phases referred to the first sample, so that
x(theta) = Re[X exp(i k theta)] where the first sample lies at theta = 0. A frame of N whole revolutions has lines 1 / N
of an order apart. A component on a line is exact; two components must be a main lobe of the window apart.
"""

import numpy as np
from numpy.typing import NDArray

from analysis.spectra.windows import HANN, Window

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def order_spectrum(waveform: FloatArray, revolutions: int, window: Window = HANN) -> tuple[FloatArray, ComplexArray]:
    """Return the order spectrum of whole revolutions.

    Parameters
    ----------
    waveform : ndarray of float64, shape (..., n)
        Samples uniformly in angle over ``revolutions`` whole revolutions, the first at theta = 0, any unit.
    revolutions : int
        Number of revolutions of the n samples; at least 1, with at least 2 samples per revolution.
    window : Window
        Weighting.

    Returns
    -------
    orders : ndarray of float64, shape (n // 2 + 1,)
        Order axis, from 0, step ``1 / revolutions``.
    spectrum : ndarray of complex128, shape (..., n // 2 + 1)
        Complex peak amplitude in the unit of the waveform, x(theta) = Re[X exp(i order theta)]; line 0 is the mean.

    Raises
    ------
    ValueError
        Too few samples for the revolutions, or samples not finite.

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
    spectrum = 2.0 * np.fft.rfft(waveform * window.weights(n), axis=-1)
    spectrum[..., 0] *= 0.5
    if n % 2 == 0:
        spectrum[..., -1] *= 0.5  # the Nyquist line has no mirror image either
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
    A frame of whole revolutions has lines at all whole orders (A. Brandt, Noise and Vibration Analysis, 2011, ch. 12).
    """
    lines = revolutions * np.arange(1, count + 1)
    vectors = np.zeros((count, *spectrum.shape[:-1]), dtype=np.complex128)
    inside = lines < spectrum.shape[-1]
    vectors[inside] = np.moveaxis(spectrum[..., lines[inside]], -1, 0)
    return vectors
