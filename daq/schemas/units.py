"""Base class of the schemas, and conversion from SI and radians to their units: µm, r/min, degrees of lag.

Numbers are rounded to four decimals, far below the resolution of the probes; NaN and infinity become None.
"""

import cmath
import math
from datetime import UTC, datetime

from pydantic import BaseModel, ConfigDict


class Schema(BaseModel):
    """Base class of the JSON schemas: frozen, no extra fields, null for unknown values."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


DECIMALS = 4


def finite(value: float) -> float | None:
    """Return ``value`` (any unit) rounded to `DECIMALS`, None where it is not finite."""
    return round(float(value), DECIMALS) if math.isfinite(value) else None


def micrometres(value: float) -> float | None:
    """Return a length in m as µm."""
    return finite(value * 1e6)


def rpm(speed: float) -> float | None:
    """Return a speed in rad/s as r/min (an acceleration in rad/s² as r/min per s)."""
    return finite(speed * 30 / math.pi)


def degrees(angle: float) -> float | None:
    """Return an angle in rad as degrees."""
    return finite(math.degrees(angle))


def lag_degrees(vector: complex) -> float | None:
    """Return the phase lag -arg X of a vector in degrees, 0 up to 360; None where it has no direction."""
    if not (cmath.isfinite(vector) and vector):
        return None
    return round(math.degrees(-math.atan2(vector.imag, vector.real)) % 360.0, DECIMALS) % 360.0


def utc_time(nanoseconds: int) -> datetime:
    """Return ns since 1970 as a UTC date and time, to the microsecond."""
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    return datetime.fromtimestamp(seconds, UTC).replace(microsecond=rest // 1000)
