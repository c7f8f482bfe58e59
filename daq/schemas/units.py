"""Base class of the schemas, and their numbers: in the units of `analysis.signals.units`, rounded.

Numbers are rounded to four decimals, far below the resolution of the probes; NaN and infinity become None.
"""

import math
from dataclasses import is_dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic.fields import FieldInfo

from analysis.signals.units import ANGLE, LENGTH, SPEED, phase_lag_degrees, readings

Number = float | None
"""A number; null where it is unknown."""
Count = Annotated[int, Field(ge=0)]

DECIMALS = 4


class Schema(BaseModel):
    """Base class of the JSON schemas: frozen, no extra fields, null for unknown values.

    A schema made ``of`` classes of results takes its fields' descriptions, with units, from their quantities, and is
    validated from such a result: values are converted to the unit of their quantity and rounded; values without a
    quantity are those of the attribute of the same name.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
    described: ClassVar[tuple[str, ...]] = ()  # names of the fields with a quantity

    def __init_subclass__(cls, of: tuple[type, ...] = (), **config: Any) -> None:
        """Describe the fields that have a quantity; TypeError for one that has a description of its own too."""
        super().__init_subclass__(**config)
        known = {name: reading.quantity for result in of for name, reading in readings(result).items()}
        fields = {name: field for name, field in vars(cls).items() if isinstance(field, FieldInfo) and name in known}
        cls.described = (*cls.described, *fields)
        for name, field in fields.items():
            if field.description is not None:
                raise TypeError(f"{cls.__name__}.{name}: has a description, expected only that of its quantity")
            setattr(cls, name, Field(description=known[name].sentence, examples=field.examples))

    @classmethod
    def of(cls, *results: object, **others: object) -> Self:
        """Return the schema of results; fields of a result that is None are null, ``others`` are all other fields."""
        values = {name: value for result in results for name, value in cls._values(result)}
        return cls.model_validate(dict.fromkeys(cls.described) | values | others)

    @model_validator(mode="before")
    @classmethod
    def _from_result(cls, value: object) -> object:
        return dict(cls._values(value)) if is_dataclass(value) else value

    @classmethod
    def _values(cls, result: Any) -> list[tuple[str, object]]:
        """Return the fields that a result has."""
        known = readings(result.__class__)
        return [
            (name, _plain(known[name].shown(result) if name in known else getattr(result, name)))
            for name in cls.model_fields
            if name in known or hasattr(result, name)
        ]


def _plain(value: Any) -> object:
    """Return a value as JSON may hold it: finite numbers rounded, others None; arrays as tuples, paths as text."""
    if isinstance(value, float):
        return finite(value)
    if isinstance(value, np.ndarray):
        return tuple(map(_plain, value.tolist()))
    return str(value) if isinstance(value, Path) else value


def finite(value: float) -> float | None:
    """Return ``value`` (any unit) rounded to `DECIMALS`, None where it is not finite."""
    return round(float(value), DECIMALS) if math.isfinite(value) else None


def micrometres(value: float) -> float | None:
    """Return a length in m as µm."""
    return finite(LENGTH.shown(value))


def rpm(speed: float) -> float | None:
    """Return a speed in rad/s as r/min (an acceleration in rad/s² as r/min per s)."""
    return finite(SPEED.shown(speed))


def degrees(angle: float) -> float | None:
    """Return an angle in rad as degrees."""
    return finite(ANGLE.shown(angle))


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
