"""Units as their value in SI, and the phase lag of a vector in degrees.

``value / UNIT`` converts from SI to the unit, ``value * UNIT`` from the unit to SI: ``speed / RPM`` is in r/min.
"""

from typing import overload

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
RPM = 2.0 * np.pi / 60.0  # rad/s in 1 r/min; also rad/s² in 1 r/min per s
MILLIMETRE = 1e-3  # m
MICROMETRE = 1e-6  # m
MILLISECOND = 1e-3  # s
MICROSECOND = 1e-6  # s
MILLIVOLT = 1e-3  # V


@overload
def phase_lag_degrees(vectors: complex) -> float: ...


@overload
def phase_lag_degrees(vectors: ComplexArray) -> FloatArray: ...


def phase_lag_degrees(vectors: complex | ComplexArray) -> float | FloatArray:
    """Return the phase lag -arg X of vectors X in degrees, from 0 up to, but not including, 360.

    Parameters
    ----------
    vectors : complex or (...) complex array
        X in x(t) = Re[X exp(i k theta)], any unit.

    Returns
    -------
    float or (...) array
        NaN where a vector has no direction: where it is 0 or not finite.
    """
    values = np.asarray(vectors, dtype=np.complex128)
    lag = np.mod(-np.degrees(np.angle(values)), 360.0)
    lag = np.where(lag == 360.0, 0.0, lag)  # the remainder of a tiny negative angle rounds to 360
    lag = np.where(np.isfinite(values) & (values != 0.0), lag, np.nan)
    return float(lag) if lag.ndim == 0 else np.asarray(lag, dtype=np.float64)
