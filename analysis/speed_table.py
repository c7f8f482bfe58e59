"""Amplitude and phase against speed: a table of bounded size however long the run."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class SpeedRow:
    """What the frames in one bin of speed said.

    Parameters
    ----------
    speed : float
        Mean speed of the frames in the bin, rad/s.
    frames : int
        Number of frames.
    vectors : ndarray of complex128, shape (2, 2)
        ``vectors[k - 1, probe]``: complex mean of the kX vectors at x and y, m peak, x(t) = Re[X exp(i k theta)].
    scatter : ndarray of float64, shape (2, 2)
        Standard deviation of those vectors about their mean (modulus of the complex deviation), m peak.
    peak_to_peak : ndarray of float64, shape (2,)
        Mean overall peak-to-peak at x and y, m.
    largest_peak_to_peak : ndarray of float64, shape (2,)
        Largest overall peak-to-peak at x and y, m.
    noise : float
        Mean noise floor of the order spectra, m peak.
    whirl_amplitude : float
        Largest sub-synchronous amplitude, m peak; 0 where there was none.
    whirl_order : float
        Its order; NaN where there was none.
    """

    speed: float
    frames: int
    vectors: ComplexArray
    scatter: FloatArray
    peak_to_peak: FloatArray
    largest_peak_to_peak: FloatArray
    noise: float
    whirl_amplitude: float
    whirl_order: float
