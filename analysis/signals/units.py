"""Units as their value in SI, quantities as interfaces show them, and the phase lag of a vector in degrees.

``value / UNIT`` converts from SI to the unit, ``value * UNIT`` from the unit to SI: ``speed / RPM`` is in r/min.

A result is a dataclass in SI whose fields, and properties, are annotated with a `Quantity`:
``speed: Annotated[float, SPEED.of("Mean shaft speed")]``. Schemas, tables, axis labels and docs take name, unit,
conversion and description from there (`readings`).
"""

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, get_type_hints, overload

import numpy as np

from analysis.signals import ComplexArray, FloatArray

RPM = 2.0 * np.pi / 60.0  # rad/s in 1 r/min; also rad/s² in 1 r/min per s
MILLIMETRE = 1e-3  # m
MICROMETRE = 1e-6  # m
MILLISECOND = 1e-3  # s
MICROSECOND = 1e-6  # s
MILLIVOLT = 1e-3  # V
PPM = 1e-6
DEGREE = math.pi / 180.0  # rad


@dataclass(frozen=True, slots=True)
class Quantity:
    """A quantity as interfaces show it.

    Parameters
    ----------
    unit : str
        Displayed unit; empty for dimensionless quantities, counts and texts.
    suffix : str
        Suffix of its names, such as "um"; empty: none.
    scale : float
        Value of the unit in SI.
    description : str
        What it is, for operators: "unknown" stands for NaN and None.
    name : str
        Name without suffix; empty: that of the field.
    at_probes : bool
        Whether the values are those at the probes x and y, shown under two names.
    """

    unit: str = ""
    suffix: str = ""
    scale: float = 1.0
    description: str = ""
    name: str = ""
    at_probes: bool = False

    def of(self, description: str, name: str = "", *, at_probes: bool = False) -> "Quantity":
        """Return the quantity with a description and a name."""
        return replace(self, description=description, name=name, at_probes=at_probes)

    @property
    def text(self) -> str:
        """Unit and description, separated by a colon."""
        return f"{self.unit}: {self.description}" if self.unit else self.description

    @property
    def sentence(self) -> str:
        """Description with the unit."""
        text = self.extended(f", {self.unit}" if self.unit else "").description
        return text[:1].upper() + text[1:]

    def extended(self, text: str) -> "Quantity":
        """Return the quantity with a text at the end of the first clause of its description."""
        head, separator, rest = self.description.partition(";")
        return replace(self, description=f"{head}{text}{separator}{rest}")

    @property
    def full_name(self) -> str:
        """Name with the suffix."""
        return f"{self.name}_{self.suffix}" if self.suffix else self.name

    def shown(self, value: Any) -> Any:
        """Return a value, or an array, in SI in the displayed unit."""
        return value if self.scale == 1.0 or value is None else value / self.scale


SPEED = Quantity("r/min", "rpm", RPM)
ACCELERATION = Quantity("r/min per s", "rpm_per_s", RPM)
LENGTH = Quantity("µm", "um", MICROMETRE)
PEAK = Quantity("µm zero-to-peak", "um", MICROMETRE)
PEAK_TO_PEAK = Quantity("µm peak-to-peak", "um", MICROMETRE)
RMS = Quantity("µm RMS", "um", MICROMETRE)
ANGLE = Quantity("degrees", "deg", DEGREE)
LAG = Quantity("degrees", "deg")  # values of `phase_lag_degrees`
TIME = Quantity("s", "s")
SHORT_TIME = Quantity("µs", "us", MICROSECOND)
FREQUENCY = Quantity("Hz", "hz")
RATE = Quantity("1/s", "per_s")
VOLTAGE = Quantity("V", "v")
CLOCK_ERROR = Quantity("ppm", "ppm", PPM)
NUMBER = Quantity()  # dimensionless, a count or a text


@dataclass(frozen=True, slots=True)
class Measures:
    """Quantities that are the rows of one array or tuple.

    Parameters
    ----------
    rows : tuple of Quantity
        With names.
    at_probes : bool
        Whether each row has the values at the probes x and y.
    """

    rows: tuple[Quantity, ...]
    at_probes: bool = False

    def called(self, prefix: str, *, at_probes: bool = False) -> "Measures":
        """Return the measures with a prefix of their names and descriptions, such as "largest"."""
        rows = tuple(
            replace(row, name=f"{prefix}_{row.name}", description=f"{prefix.capitalize()} {row.description}")
            for row in self.rows
        )
        return Measures(rows, at_probes)


@dataclass(frozen=True, slots=True)
class Reading:
    """How to read a value of a result.

    Parameters
    ----------
    attribute : str
        Field or property of the result.
    indices : tuple of int
        Indices of a measure, of a probe, or of both; empty: the whole value.
    quantity : Quantity
        Its quantity.
    """

    attribute: str
    indices: tuple[int, ...]
    quantity: Quantity

    def shown(self, result: object) -> Any:
        """Return the value in the displayed unit; None where the result has none."""
        value = getattr(result, self.attribute)
        for index in self.indices:
            value = None if value is None else value[index]
        return self.quantity.shown(value)


@cache
def readings(result: type) -> dict[str, Reading]:
    """Return how to read the annotated fields and properties of a class of results, by their names at interfaces."""
    hints = get_type_hints(result, include_extras=True)
    for name in dir(result):
        getter = getattr(getattr(result, name), "fget", None)
        if getter is not None:
            hints[name] = get_type_hints(getter, include_extras=True).get("return")
    found: dict[str, Reading] = {}
    for attribute, hint in hints.items():
        for shown in getattr(hint, "__metadata__", ()):
            if isinstance(shown, Quantity):
                found |= _named(attribute, (), shown, at_probes=shown.at_probes)
            elif isinstance(shown, Measures):
                for row, quantity in enumerate(shown.rows):
                    found |= _named(attribute, (row,), quantity, at_probes=shown.at_probes)
    return found


def _named(attribute: str, indices: tuple[int, ...], quantity: Quantity, *, at_probes: bool) -> dict[str, Reading]:
    named = replace(quantity, name=quantity.name or attribute)
    if not at_probes:
        return {named.full_name: Reading(attribute, indices, named)}
    at = [replace(named.extended(f" at probe {probe}"), name=f"{named.name}_{probe}") for probe in "xy"]
    return {one.full_name: Reading(attribute, (*indices, probe), one) for probe, one in enumerate(at)}


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
