"""Conversion of a run's header to JSON and back, bit for bit: SI values, the unit in every key."""

from collections.abc import Mapping
from dataclasses import MISSING, dataclass
from enum import StrEnum
from functools import cache
from types import UnionType
from typing import Any, Self, get_args, get_origin, get_type_hints

from analysis.signals.header import (
    Acquisition,
    AnalysisSettings,
    Calibration,
    Channel,
    Device,
    Limits,
    RunHeader,
    RunOutSettings,
    Tacho,
    TachoCounter,
)
from recordings.errors import DamagedError

Json = dict[str, Any]


@dataclass(frozen=True, slots=True)
class _RunOutVector:
    """Run-out of an order at the probes x and y, m peak."""

    order: int
    x_real: float
    x_imag: float
    y_real: float
    y_imag: float

    @classmethod
    def from_vectors(cls, order: int, x: complex, y: complex) -> Self:
        return cls(order, x.real, x.imag, y.real, y.imag)

    def vectors(self) -> tuple[int, complex, complex]:
        return self.order, complex(self.x_real, self.x_imag), complex(self.y_real, self.y_imag)


_KEYS: dict[type, dict[str, str]] = {
    RunHeader: {
        "run": "run",
        "rig": "rig",
        "started_ns": "started_ns",
        "program": "program",
        "note": "note",
        "acquisition": "acquisition",
        "analysis": "settings",
        "limits": "limits",
        "config_toml": "config_toml",
    },
    Acquisition: {
        "device": "device",
        "rate_hz": "rate",
        "convert_rate_hz": "convert_rate",
        "buffer_samples": "buffer",
        "channels": "channels",
        "tacho": "tacho",
    },
    Device: {
        "backend": "backend",
        "product": "product",
        "serial": "serial",
        "driver": "driver",
        "simulated": "simulated",
    },
    Channel: {
        "name": "name",
        "role": "role",
        "physical": "physical",
        "range_low_v": "range_low",
        "range_high_v": "range_high",
        "scaling_v_per_code_to_k": "scaling",
        "calibration": "calibration",
        "angle_rad": "angle",
        "gap_low_v": "gap_low",
        "gap_high_v": "gap_high",
    },
    Calibration: {  # gap in metres = sum of gap_m_per_v_to_k[k] * volts**k
        "gap_m_per_v_to_k": "coefficients",
        "volts_low_v": "volts_low",
        "volts_high_v": "volts_high",
        "residual_m": "residual",
        "sensor": "sensor",
        "conditioner": "conditioner",
        "date": "date",
        "target": "target",
        "operator": "operator",
    },
    Tacho: {
        "threshold_v": "threshold",
        "hysteresis_v": "hysteresis",
        "edge": "edge",
        "pulses_per_revolution": "pulses_per_revolution",
        "mark_fraction": "mark_fraction",
        "response_time_s": "response_time",
        "delay_s": "delay",
        "counter": "counter",
    },
    TachoCounter: {
        "counter": "counter",
        "terminal": "terminal",
        "edge": "edge",
        "timebase_hz": "timebase",
        "is_reference": "is_reference",
        "agreement_s": "max_difference",
    },
    AnalysisSettings: {
        "update_interval_s": "update_interval",
        "revolutions": "revolutions",
        "points_per_revolution": "points_per_revolution",
        "highest_order": "highest_order",
        "orbit_revolutions": "orbit_revolutions",
        "runout": "runout",
        "window": "window",
    },
    RunOutSettings: {
        "slow_roll_speed_rad_per_s": "slow_roll_speed",
        "vectors": "vectors",
        "sigma_m": "sigma",
        "source": "source",
        "from_orbit": "from_orbit",
    },
    _RunOutVector: {
        "order": "order",
        "x_real_m": "x_real",
        "x_imag_m": "x_imag",
        "y_real_m": "y_real",
        "y_imag_m": "y_imag",
    },
    Limits: {
        "peak_to_peak_alarm_m": "peak_to_peak_alarm",
        "peak_to_peak_danger_m": "peak_to_peak_danger",
        "clearance_m": "clearance",
        "speed_rad_per_s": "speed",
        "hysteresis_fraction": "hysteresis",
        "hold_s": "hold",
        "latch": "latch",
        "order_1x_peak_alarm_m": "order_1x_alarm",
        "order_1x_peak_danger_m": "order_1x_danger",
        "below_1x_peak_alarm_m": "below_1x_alarm",
        "below_1x_peak_danger_m": "below_1x_danger",
        "speed_alarm_rad_per_s": "speed_alarm",
        "speed_danger_rad_per_s": "speed_danger",
    },
}
"""The JSON keys of each dataclass and the fields that they hold, in the order of writing."""

_ABSENT_AT_DEFAULT = {(Tacho, "counter"), (AnalysisSettings, "window")} | {
    (Limits, f"{name}_{level}") for name in ("order_1x", "below_1x", "speed") for level in ("alarm", "danger")
}
_NULL_AT_DEFAULT = {(Channel, "calibration"), (Channel, "gap_low"), (Channel, "gap_high")}
_ABSENT_IN_OLDER_FILES = {
    (Acquisition, "buffer"),
    (Calibration, "target"),
    (Calibration, "operator"),
    (AnalysisSettings, "runout"),
    (Limits, "hysteresis"),
    (Limits, "hold"),
    (Limits, "latch"),
}
_NOT_WRITTEN = {
    part: {name for other, name in _ABSENT_AT_DEFAULT | _NULL_AT_DEFAULT if other is part} for part in _KEYS
}
_MAY_BE_ABSENT = _ABSENT_AT_DEFAULT | _ABSENT_IN_OLDER_FILES
_EXPECTED = {str: "a string", bool: "true or false", int: "an integer", float: "a number"}

_type_hints = cache(get_type_hints)


def to_json(part: RunHeader | Calibration) -> Json:
    """Return a header, or a probe's calibration, as a JSON object."""
    values: Json = _encoded(part)
    return values


def header_from_json(document: Mapping[str, Any]) -> RunHeader:
    """Return the header of a JSON object; DamagedError names the key that is missing or wrong."""
    header: RunHeader = _decoded(RunHeader, "header", document)
    return header


def _encoded(value: Any) -> Any:
    part = type(value)
    if part is tuple:
        return [_encoded(_RunOutVector.from_vectors(*each) if isinstance(each, tuple) else each) for each in value]
    if part not in _KEYS:
        return value
    values: Json = {}
    not_written = _NOT_WRITTEN[part]
    for key, name in _KEYS[part].items():
        field = getattr(value, name)
        if name in not_written and field == part.__dataclass_fields__[name].default:
            if (part, name) in _NULL_AT_DEFAULT:
                values[key] = None
        else:
            values[key] = field if type(field) in _EXPECTED else _encoded(field)
    return values


def _decoded(kind: Any, where: str, value: Any) -> Any:
    """Return the value of a type; `where` is its path, as "header.acquisition"."""
    kinds = get_args(kind)
    if isinstance(kind, UnionType):  # with None, which is handled with the object
        kind = kinds[0]
    if kind in _KEYS:
        return _decoded_part(kind, where, value)
    if get_origin(kind) is tuple:
        if not isinstance(value, list):
            raise _wrong(where, value, "a list")
        if kinds == (float, float) and len(value) != 2:
            raise _wrong(where, value, "two numbers")
        if get_origin(kinds[0]) is tuple:
            vectors = [_decoded(_RunOutVector, f"{where}[{k}]", each) for k, each in enumerate(value)]
            return tuple(vector.vectors() for vector in vectors)
        if all(type(each) is kinds[0] for each in value):  # numbers, without their paths
            return tuple(value)
        return tuple(_decoded(kinds[0], f"{where}[{k}]", each) for k, each in enumerate(value))
    is_choice = issubclass(kind, StrEnum)
    allowed = int | float if kind is float else str if is_choice else kind
    if not isinstance(value, allowed) or (isinstance(value, bool) and kind is not bool):
        raise _wrong(where, value, _EXPECTED[str if is_choice else kind])
    try:
        return kind(value)
    except ValueError:
        raise _wrong(where, value, "one of " + ", ".join(kind)) from None


def _decoded_part(part: type, where: str, values: Any) -> Any:
    """Return the dataclass of a JSON object."""
    if not isinstance(values, Mapping):
        raise _wrong(where, values, "an object")
    hints, found = _type_hints(part), {}
    for key, name in _KEYS[part].items():
        value = values.get(key, MISSING)
        if type(value) is hints[name]:
            found[name] = value
        elif value is MISSING:
            if (part, name) not in _MAY_BE_ABSENT:
                raise DamagedError(f"{where}: {key} is missing")
        elif value is not None or (part, name) not in _NULL_AT_DEFAULT:
            found[name] = _decoded(hints[name], f"{where}.{key}", value)
    return part(**found)


def _wrong(where: str, value: object, expected: str) -> DamagedError:
    return DamagedError(f"{where}: {value!r}, expected {expected}")
