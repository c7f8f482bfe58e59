"""Base class of the schemas, and their numbers: SI and radians converted to µm, r/min and degrees, then rounded.

Numbers are rounded to four decimals, far below the resolution of the probes; NaN and infinity become None.
"""

import math
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from analysis.signals.units import MICROMETRE, RPM, phase_lag_degrees


class Schema(BaseModel):
    """Base class of the JSON schemas: frozen, no extra fields, null for unknown values."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


DECIMALS = 4


def finite(value: float) -> float | None:
    """Return ``value`` (any unit) rounded to `DECIMALS`, None where it is not finite."""
    return round(float(value), DECIMALS) if math.isfinite(value) else None


def micrometres(value: float) -> float | None:
    """Return a length in m as µm."""
    return finite(value / MICROMETRE)


def rpm(speed: float) -> float | None:
    """Return a speed in rad/s as r/min (an acceleration in rad/s² as r/min per s)."""
    return finite(speed / RPM)


def degrees(angle: float) -> float | None:
    """Return an angle in rad as degrees."""
    return finite(math.degrees(angle))


def lag_degrees(vector: complex) -> float | None:
    """Return the phase lag -arg X of a vector in degrees, 0 up to 360; None where it has no direction."""
    return _rounded_lag(phase_lag_degrees(vector))


def lags_degrees(vectors: NDArray[np.complex128]) -> tuple[float | None, ...]:
    """Return the phase lags of vectors as `lag_degrees` does."""
    return tuple(map(_rounded_lag, phase_lag_degrees(vectors).tolist()))


def _rounded_lag(lag: float) -> float | None:
    rounded = finite(lag)
    return None if rounded is None else rounded % 360.0  # 359.99999 rounds to 360


def utc_time(nanoseconds: int) -> datetime:
    """Return ns since 1970 as a UTC date and time, to the microsecond."""
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    return datetime.fromtimestamp(seconds, UTC).replace(microsecond=rest // 1000)
