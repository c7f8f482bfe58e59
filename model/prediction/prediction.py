"""Predicted vibration at the probes at one speed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Predicted steady-state vibration at the probes.

    Parameters
    ----------
    speed : float
        Shaft speed, rad/s.
    orders : ndarray of float64, shape (n_orders,)
        Order axis, from 0.
    spectrum : ndarray of float64, shape (2, n_orders)
        Order spectrum at the probes x and y with the window of the settings, m peak.
    vectors : ndarray of complex128, shape (2, 2)
        ``vectors[k - 1, probe]``: the kX vector, k = 1, 2, m peak, x(t) = Re[X exp(i k theta)].
    whirl_order : float
        Order of the strongest sub-synchronous component; NaN without one.
    whirl_amplitude : float
        Semi-major axis of this component, m peak; 0 without one.
    peak_to_peak : ndarray of float64, shape (2,)
        Overall vibration at the probes, m peak-to-peak.
    orbit : ndarray of float64, shape (2, n_points)
        Motion in X and Y over a few whole revolutions from theta = 0, mean removed, m.
    growth_rate : float
        Growth rate of the least stable whirl of the synchronous motion, 1/s; positive if unstable.
    is_exact : bool
        Whether it was integrated at this speed; otherwise it is interpolated between two speeds of a map.
    """

    speed: float
    orders: FloatArray
    spectrum: FloatArray
    vectors: ComplexArray
    whirl_order: float
    whirl_amplitude: float
    peak_to_peak: FloatArray
    orbit: FloatArray
    growth_rate: float
    is_exact: bool = False
