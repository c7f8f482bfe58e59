"""Conversion of a run's header to JSON and back, bit for bit: SI values, the unit in every key."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Self, TypeVar

from analysis.signals.header import (
    Acquisition,
    AnalysisSettings,
    Calibration,
    Channel,
    Device,
    Edge,
    Limits,
    Role,
    RunHeader,
    RunOutSettings,
    Tacho,
    TachoCounter,
    WindowName,
)
from recordings.errors import DamagedError

Choice = TypeVar("Choice", bound=StrEnum)


@dataclass(frozen=True, slots=True)
class Section:
    """A JSON object and its path; a missing key or a value of another type raises a DamagedError that names it.

    Parameters
    ----------
    where : str
        Path of the object, as "header.acquisition".
    values : mapping of str to object
        Its values.
    """

    where: str
    values: Any

    def __post_init__(self) -> None:
        if not isinstance(self.values, Mapping):
            raise DamagedError(f"{self.where}: {self.values!r}, expected an object")

    def has(self, key: str) -> bool:
        """Return whether the key exists."""
        return key in self.values

    def is_null(self, key: str) -> bool:
        """Return whether the value is null."""
        return self._get(key) is None

    def section(self, key: str) -> Self:
        """Return the object of this key."""
        return type(self)(f"{self.where}.{key}", self._get(key))

    def sections(self, key: str) -> list[Self]:
        """Return the objects of a list."""
        return [type(self)(f"{self.where}.{key}[{k}]", value) for k, value in enumerate(self._list(key))]

    def text(self, key: str) -> str:
        """Return a string."""
        value = self._get(key)
        if not isinstance(value, str):
            raise self._wrong(key, value, "a string")
        return value

    def boolean(self, key: str) -> bool:
        """Return a boolean."""
        value = self._get(key)
        if not isinstance(value, bool):
            raise self._wrong(key, value, "true or false")
        return value

    def integer(self, key: str) -> int:
        """Return an integer."""
        value = self._get(key)
        if not isinstance(value, int) or isinstance(value, bool):
            raise self._wrong(key, value, "an integer")
        return value

    def number(self, key: str) -> float:
        """Return a number."""
        return self._number(key, self._get(key))

    def numbers(self, key: str) -> tuple[float, ...]:
        """Return a list of numbers."""
        return tuple(self._number(key, value) for value in self._list(key))

    def choice(self, key: str, choices: type[Choice]) -> Choice:
        """Return a member of an enumeration."""
        value = self.text(key)
        try:
            return choices(value)
        except ValueError:
            raise self._wrong(key, value, "one of " + ", ".join(choices)) from None

    def _get(self, key: str) -> Any:
        if key not in self.values:
            raise DamagedError(f"{self.where}: {key} is missing")
        return self.values[key]

    def _list(self, key: str) -> list[Any]:
        value = self._get(key)
        if not isinstance(value, list):
            raise self._wrong(key, value, "a list")
        return value

    def _number(self, key: str, value: Any) -> float:
        if not isinstance(value, int | float) or isinstance(value, bool):
            raise self._wrong(key, value, "a number")
        return float(value)

    def _wrong(self, key: str, value: Any, expected: str) -> DamagedError:
        return DamagedError(f"{self.where}.{key}: {value!r}, expected {expected}")


Json = dict[str, Any]

_OPTIONAL_LIMITS = {  # missing if not monitored
    "order_1x_peak_alarm_m": "order_1x_alarm",
    "order_1x_peak_danger_m": "order_1x_danger",
    "below_1x_peak_alarm_m": "below_1x_alarm",
    "below_1x_peak_danger_m": "below_1x_danger",
    "speed_alarm_rad_per_s": "speed_alarm",
    "speed_danger_rad_per_s": "speed_danger",
}


def header_to_json(header: RunHeader) -> Json:
    """Return a header as a JSON object."""
    return {
        "run": header.run,
        "rig": header.rig,
        "started_ns": header.started_ns,
        "program": header.program,
        "note": header.note,
        "acquisition": _acquisition_to_json(header.acquisition),
        "analysis": {
            "update_interval_s": header.settings.update_interval,
            "revolutions": header.settings.revolutions,
            "points_per_revolution": header.settings.points_per_revolution,
            "highest_order": header.settings.highest_order,
            "orbit_revolutions": header.settings.orbit_revolutions,
            "runout": _runout_to_json(header.settings.runout),
        }
        | ({} if header.settings.window is WindowName.HANN else {"window": header.settings.window.value}),
        "limits": {
            "peak_to_peak_alarm_m": header.limits.peak_to_peak_alarm,
            "peak_to_peak_danger_m": header.limits.peak_to_peak_danger,
            "clearance_m": header.limits.clearance,
            "speed_rad_per_s": header.limits.speed,
            "hysteresis_fraction": header.limits.hysteresis,
            "hold_s": header.limits.hold,
            "latch": header.limits.latch,
            **{
                key: limit
                for key, name in _OPTIONAL_LIMITS.items()
                if math.isfinite(limit := getattr(header.limits, name))
            },
        },
        "config_toml": header.config_toml,
    }


def calibration_to_json(calibration: Calibration) -> Json:
    """Return a probe's calibration as a JSON object: gap in metres = sum of gap_m_per_v_to_k[k] * volts**k."""
    return {
        "gap_m_per_v_to_k": list(calibration.coefficients),
        "volts_low_v": calibration.volts_low,
        "volts_high_v": calibration.volts_high,
        "residual_m": calibration.residual,
        "sensor": calibration.sensor,
        "conditioner": calibration.conditioner,
        "date": calibration.date,
        "target": calibration.target,
        "operator": calibration.operator,
    }


def header_from_json(document: Mapping[str, Any]) -> RunHeader:
    """Return the header of a JSON object; DamagedError names the key that is missing or wrong."""
    top = Section("header", document)
    analysis, limits = top.section("analysis"), top.section("limits")
    return RunHeader(
        run=top.text("run"),
        rig=top.text("rig"),
        started_ns=top.integer("started_ns"),
        acquisition=_acquisition(top.section("acquisition")),
        settings=AnalysisSettings(
            update_interval=analysis.number("update_interval_s"),
            revolutions=analysis.integer("revolutions"),
            points_per_revolution=analysis.integer("points_per_revolution"),
            highest_order=analysis.number("highest_order"),
            orbit_revolutions=analysis.integer("orbit_revolutions"),
            runout=_runout(analysis.section("runout")) if analysis.has("runout") else RunOutSettings(),
            window=analysis.choice("window", WindowName) if analysis.has("window") else WindowName.HANN,
        ),
        limits=_limits(limits),
        config_toml=top.text("config_toml"),
        program=top.text("program"),
        note=top.text("note"),
    )


def _runout_to_json(runout: RunOutSettings) -> Json:
    return {
        "slow_roll_speed_rad_per_s": runout.slow_roll_speed,
        "vectors": [
            {"order": order, "x_real_m": x.real, "x_imag_m": x.imag, "y_real_m": y.real, "y_imag_m": y.imag}
            for order, x, y in runout.vectors
        ],
        "sigma_m": list(runout.sigma),
        "source": runout.source,
        "from_orbit": runout.from_orbit,
    }


def _runout(section: Section) -> RunOutSettings:
    sigma_1x, sigma_2x = section.numbers("sigma_m")
    return RunOutSettings(
        slow_roll_speed=section.number("slow_roll_speed_rad_per_s"),
        vectors=tuple(
            (
                vector.integer("order"),
                complex(vector.number("x_real_m"), vector.number("x_imag_m")),
                complex(vector.number("y_real_m"), vector.number("y_imag_m")),
            )
            for vector in section.sections("vectors")
        ),
        sigma=(sigma_1x, sigma_2x),
        source=section.text("source"),
        from_orbit=section.boolean("from_orbit"),
    )


def _limits(section: Section) -> Limits:
    known = Limits(
        peak_to_peak_alarm=section.number("peak_to_peak_alarm_m"),
        peak_to_peak_danger=section.number("peak_to_peak_danger_m"),
        clearance=section.number("clearance_m"),
        speed=section.number("speed_rad_per_s"),
    )
    if not section.has("hold_s"):  # an older file: the defaults of alarms
        return known
    return replace(
        known,
        hysteresis=section.number("hysteresis_fraction"),
        hold=section.number("hold_s"),
        latch=section.boolean("latch"),
        **{name: section.number(key) for key, name in _OPTIONAL_LIMITS.items() if section.has(key)},
    )


def _acquisition_to_json(acquisition: Acquisition) -> Json:
    device, tacho = acquisition.device, acquisition.tacho
    return {
        "device": {
            "backend": device.backend,
            "product": device.product,
            "serial": device.serial,
            "driver": device.driver,
            "simulated": device.simulated,
        },
        "rate_hz": acquisition.rate,
        "convert_rate_hz": acquisition.convert_rate,
        "buffer_samples": acquisition.buffer,
        "channels": [_channel_to_json(channel) for channel in acquisition.channels],
        "tacho": {
            "threshold_v": tacho.threshold,
            "hysteresis_v": tacho.hysteresis,
            "edge": tacho.edge.value,
            "pulses_per_revolution": tacho.pulses_per_revolution,
            "mark_fraction": tacho.mark_fraction,
            "response_time_s": tacho.response_time,
            "delay_s": tacho.delay,
        }
        | ({} if tacho.counter is None else {"counter": _counter_to_json(tacho.counter)}),
    }


def _counter_to_json(counter: TachoCounter) -> Json:
    return {
        "counter": counter.counter,
        "terminal": counter.terminal,
        "edge": counter.edge.value,
        "timebase_hz": counter.timebase,
        "is_reference": counter.is_reference,
        "agreement_s": counter.max_difference,
    }


def _channel_to_json(channel: Channel) -> Json:
    return {
        "name": channel.name,
        "role": channel.role.value,
        "physical": channel.physical,
        "range_low_v": channel.range_low,
        "range_high_v": channel.range_high,
        "scaling_v_per_code_to_k": list(channel.scaling),
        "calibration": None if channel.calibration is None else calibration_to_json(channel.calibration),
        "angle_rad": channel.angle,
        "gap_low_v": _finite(channel.gap_low),
        "gap_high_v": _finite(channel.gap_high),
    }


def _acquisition(section: Section) -> Acquisition:
    device, tacho = section.section("device"), section.section("tacho")
    return Acquisition(
        device=Device(
            backend=device.text("backend"),
            product=device.text("product"),
            serial=device.text("serial"),
            driver=device.text("driver"),
            simulated=device.boolean("simulated"),
        ),
        rate=section.number("rate_hz"),
        convert_rate=section.number("convert_rate_hz"),
        channels=tuple(_channel(channel) for channel in section.sections("channels")),
        tacho=Tacho(
            threshold=tacho.number("threshold_v"),
            hysteresis=tacho.number("hysteresis_v"),
            edge=tacho.choice("edge", Edge),
            pulses_per_revolution=tacho.integer("pulses_per_revolution"),
            mark_fraction=tacho.number("mark_fraction"),
            response_time=tacho.number("response_time_s"),
            delay=tacho.number("delay_s"),
            counter=_counter(tacho.section("counter")) if tacho.has("counter") else None,
        ),
        buffer=section.integer("buffer_samples") if section.has("buffer_samples") else 0,  # missing in older files
    )


def _counter(section: Section) -> TachoCounter:
    return TachoCounter(
        counter=section.text("counter"),
        terminal=section.text("terminal"),
        edge=section.choice("edge", Edge),
        timebase=section.number("timebase_hz"),
        is_reference=section.boolean("is_reference"),
        max_difference=section.number("agreement_s"),
    )


def _channel(section: Section) -> Channel:
    calibration = None if section.is_null("calibration") else _calibration(section.section("calibration"))
    return Channel(
        name=section.text("name"),
        role=section.choice("role", Role),
        physical=section.text("physical"),
        range_low=section.number("range_low_v"),
        range_high=section.number("range_high_v"),
        scaling=section.numbers("scaling_v_per_code_to_k"),
        calibration=calibration,
        angle=section.number("angle_rad"),
        gap_low=-math.inf if section.is_null("gap_low_v") else section.number("gap_low_v"),
        gap_high=math.inf if section.is_null("gap_high_v") else section.number("gap_high_v"),
    )


def _calibration(section: Section) -> Calibration:
    return Calibration(
        coefficients=section.numbers("gap_m_per_v_to_k"),
        volts_low=section.number("volts_low_v"),
        volts_high=section.number("volts_high_v"),
        residual=section.number("residual_m"),
        sensor=section.text("sensor"),
        conditioner=section.text("conditioner"),
        date=section.text("date"),
        target=section.text("target") if section.has("target") else "",  # older files have neither
        operator=section.text("operator") if section.has("operator") else "",
    )


def _finite(value: float) -> float | None:
    """Return the value, or None for infinity, which JSON cannot represent."""
    return value if math.isfinite(value) else None
