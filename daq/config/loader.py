"""Load rig.toml with the calibration and rotor files that it names, and report all errors together."""

import copy
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from analysis.signals.header import Calibration, Role
from daq.config.calibration import load_calibration
from daq.config.consistency import card_faults, cross_field_faults, trigger_faults
from daq.config.rig import Rig, default_rotor, read_rotor
from daq.config.schema import ChannelSection, RigConfig, TriggerSection
from daq.config.toml_files import (
    Fault,
    KeyPath,
    plain_json,
    read_tables,
    read_text,
    to_toml,
    toml_literal,
    validation_faults,
)
from daq.errors import ConfigError

ROTOR_KEY = "model.rotor"
MODEL_SECTIONS = ("channel", "model", "rotor")  # the model of a run depends on these sections
MAX_ROUNDS = 4  # of removing wrong values and validating what is left

RENAMED_KEYS: Final[dict[KeyPath, str]] = {
    ("tacho", "counter", "agreement_us"): "max_difference_us",
    ("preflight", "mark_tolerance_fraction"): "tacho_mark_tolerance_fraction",
    ("preflight", "disk_h"): "disk_duration_h",
    ("runout", "orbit"): "correct_orbit",
    ("storage", "split_min"): "split_minutes",
}
"""Former keys and their present names: refused in a rig.toml, translated in the configuration of a recording."""

# Values for required keys that are missing or wrong, so that the rest of their table can still be checked.
PLACEHOLDERS: Final[dict[int | str, object]] = {
    "name": "nameless",
    "role": Role.TACHO.value,
    "physical": "ai15",
    "time_s": 0.0,
    "speed_rpm": 0.0,
    "order": 0.5,
    "onset_rpm": 1.0,
    "end_rpm": 2.0,
    "amplitude_um": 1.0,
}


def load_rig(path: Path | str) -> Rig:
    """Return the rig that a file describes.

    Parameters
    ----------
    path : Path or str
        rig.toml; the calibration and rotor files that it names are relative to it.

    Raises
    ------
    ConfigError
        rig.toml or a file that it names is missing or wrong; lists all errors in all files.
    """
    path = Path(path)
    data = read_tables(read_text(path), str(path))
    rotor_faults = _embed_rotor(data, path.parent)
    return _rig(path, data, rotor_faults, lambda _, file: load_calibration(path.parent / file))


def parse_rig(text: str, calibrations: Mapping[str, Calibration], file: str) -> Rig:
    """Return the rig that a TOML text describes, without reading any file.

    Parameters
    ----------
    text : str
        The content of a rig.toml. A rotor other than the GJ90C is part of it, as ``[rotor]``.
    calibrations : mapping of str to Calibration
        Used instead of the files that the probes name, by channel.
    file : str
        Name of the text in error messages.

    Raises
    ------
    ConfigError
        The text is wrong, or a calibration is missing; lists all errors.
    """
    data = read_tables(text, file)

    def given(channel: str, _file: str) -> Calibration:
        if channel not in calibrations:
            raise ConfigError(file, [f"no file is read here: expected the calibration of {channel!r} with the text"])
        return calibrations[channel]

    return _rig(Path(file), data, _embed_rotor(data, None), given)


def _rig(
    path: Path, data: dict[str, object], rotor_faults: list[Fault], calibration_of: Callable[[str, str], Calibration]
) -> Rig:
    """Return the rig in parsed tables; `calibration_of` returns the calibration for a channel and file name."""
    config, faults = _validate(data, _all_faults)
    faults += rotor_faults
    calibrations: dict[str, Calibration] = {}
    for number, channel in _probes(data):
        key, name = f"channel[{number}]", str(channel.get("name"))
        try:
            calibration = calibration_of(name, str(channel["calibration"]))
        except ConfigError as error:
            entry = f'{key}.calibration = "{channel["calibration"]}"'
            faults += [Fault((f"{key}.calibration",), f"{entry}: {fault}") for fault in error.faults]
        else:
            calibrations[name] = calibration
            if config is not None:
                faults += _gap_window_faults(config.channel[number], calibration, key)
    if faults or config is None:
        raise ConfigError(str(path), [fault.text for fault in faults])
    return Rig(
        path=path,
        config=config,
        calibrations=calibrations,
        toml=to_toml(config.model_dump(mode="json", exclude_none=True)),
    )


def read_recorded_config(text: str, file: str) -> RigConfig:
    """Return the configuration stored in a recording's header; the files that it names are not read.

    The configuration was valid when the run was recorded, so it is not checked against the card. Keys that were renamed
    since are translated. Values that the present schema refuses (a removed key, a narrower range) get their defaults,
    except in the sections on which the model depends. So every recording stays readable.

    Parameters
    ----------
    text : str
        Configuration as TOML.
    file : str
        Name of the text in error messages.

    Raises
    ------
    ConfigError
        The text is no configuration, or its channels or model are wrong; lists all errors.
    """
    data = read_tables(text, file)
    _translate_renamed_keys(data)
    config, faults = _validate(data, cross_field_faults)
    if config is None or any(fault.keys[0].startswith(MODEL_SECTIONS) for fault in faults):
        raise ConfigError(file, [fault.text for fault in faults])
    return config


def _translate_renamed_keys(data: dict[str, object]) -> None:
    """Give renamed keys in parsed tables their present names."""
    for (*sections, old), new in RENAMED_KEYS.items():
        table: object = data
        for section in sections:
            table = table.get(section) if isinstance(table, dict) else None
        if isinstance(table, dict) and old in table:
            table.setdefault(new, table.pop(old))


def _embed_rotor(data: dict[str, object], folder: Path | None) -> list[Fault]:
    """Put the content of the rotor file into the tables, so that a recording holds it; return errors.

    `folder` is the folder of the rotor file; with None no file may be named.
    """
    section = data.get("model")
    name = section.get("rotor", "") if isinstance(section, Mapping) else ""
    if not isinstance(name, str):
        return []  # reported by the schema
    if "rotor" in data:
        text = f"{ROTOR_KEY} = {toml_literal(name)}: expected none beside the file's own [rotor]"
        return [Fault((ROTOR_KEY,), text)] if name else []
    if not name:
        data["rotor"] = default_rotor()
        return []
    if folder is None:
        text = f"{ROTOR_KEY} = {toml_literal(name)}: no file is read here, expected its content as [rotor]"
        return [Fault((ROTOR_KEY,), text)]
    try:
        data["rotor"] = read_rotor(folder / name)
    except ConfigError as error:
        return [Fault((ROTOR_KEY,), f"{ROTOR_KEY} = {toml_literal(name)}: {fault}") for fault in error.faults]
    return []


def _all_faults(config: RigConfig) -> Iterator[Fault]:
    yield from cross_field_faults(config)
    yield from card_faults(config)


def _validate(
    data: dict[str, object], contradictions: Callable[[RigConfig], Iterator[Fault]]
) -> tuple[RigConfig | None, list[Fault]]:
    """Return the configuration in parsed tables and all errors in it; None where required parts are missing.

    Pydantic stops at the errors of single keys. To check also how the other keys fit together, wrong values are removed
    so that their defaults apply, required ones are replaced by placeholders, and the rest is validated again, then
    passed to `contradictions`.
    """
    faults: list[Fault] = []
    sound: dict[str, object] = data
    complete = True
    for _ in range(MAX_ROUNDS):
        try:
            config = RigConfig.model_validate_json(plain_json(sound), strict=True)
        except ValidationError as error:
            if not faults:
                faults = list(validation_faults(error, RigConfig, data, RENAMED_KEYS))
            missing = [details["loc"] for details in error.errors() if details["type"] == "missing"]
            incomplete = [path[:-1] for path in missing if path[-1] not in PLACEHOLDERS]  # tables to leave out
            if () in incomplete:
                return None, faults
            wrong_paths = [details["loc"] for details in error.errors() if details["type"] != "missing"]
            complete = complete and not missing and not any(isinstance(path[-1], int) for path in wrong_paths)
            filled = _with_placeholders(sound, [path for path in missing if path[-1] in PLACEHOLDERS])
            sound = _without(filled, wrong_paths + incomplete)
        else:
            wrong = {fault.keys[0] for fault in faults}
            faults += [fault for fault in contradictions(config) if not _follows_from(fault, wrong)]
            return config if complete else None, faults
    return None, faults


def _without(data: Mapping[str, object], paths: Sequence[KeyPath]) -> dict[str, object]:
    """Return nested tables without the values at the paths."""
    result: dict[str, object] = {}
    for key, value in data.items():
        inner = [path[1:] for path in paths if path[0] == key]
        if () in inner:
            continue
        result[key] = value
        if isinstance(value, Mapping):
            result[key] = _without(value, inner)
        elif isinstance(value, list):
            result[key] = _items_without(value, inner)
    return result


def _items_without(items: list[object], paths: Sequence[KeyPath]) -> list[object]:
    """Return a list without the values at the paths in it."""
    result: list[object] = []
    for number, item in enumerate(items):
        inner = [path[1:] for path in paths if path[0] == number]
        if () not in inner:
            result.append(_without(item, inner) if isinstance(item, Mapping) else item)
    return result


def _with_placeholders(data: dict[str, object], paths: Sequence[KeyPath]) -> dict[str, object]:
    """Return nested tables with placeholders at the paths."""
    filled = copy.deepcopy(data)
    for path in paths:
        table: Any = filled
        for part in path[:-1]:
            table = table[part]
        table[path[-1]] = PLACEHOLDERS[path[-1]]
    return filled


def _follows_from(fault: Fault, wrong: set[str]) -> bool:
    """Return whether a contradiction involves a key that is itself wrong, and so adds nothing."""
    known = wrong | {re.sub(r"\[\d+\]", "", key) for key in wrong}
    return any(
        key == bad or key.startswith(f"{bad}.") or bad.startswith(f"{key}[") for key in fault.keys for bad in known
    )


def _probes(data: Mapping[str, object]) -> Iterator[tuple[int, Mapping[str, object]]]:
    """Yield number and table of each channel that names a calibration and is not the tacho, even if otherwise wrong."""
    channels = data.get("channel")
    for number, channel in enumerate(channels if isinstance(channels, list) else ()):
        if isinstance(channel, Mapping) and channel.get("role") != Role.TACHO.value:
            calibration = channel.get("calibration")
            if isinstance(calibration, str) and calibration:
                yield number, channel


def _gap_window_faults(channel: ChannelSection, calibration: Calibration, key: str) -> list[Fault]:
    """Return an error if the gap window exceeds the calibrated span."""
    low, high = channel.gap_window_v
    if low >= calibration.volts_low and high <= calibration.volts_high:
        return []
    span = f"{calibration.volts_low:g} to {calibration.volts_high:g} V"
    name = f"{key}.gap_window_v"
    text = f"{name} = [{low:g}, {high:g}]: expected voltages in the calibrated span, {span} ({channel.calibration})"
    return [Fault((name,), text)]


def with_trigger(rig: Rig, **changes: str | float | None) -> Rig:
    """Return the rig with a changed trigger.

    Parameters
    ----------
    rig : Rig
        The rig.
    **changes : str, float or None
        New values for keys of `[trigger]`; None leaves a key unchanged.

    Raises
    ------
    ConfigError
        A condition cannot be parsed or names an unknown quantity, or a number is out of range.
    """
    values = {key: value for key, value in changes.items() if value is not None}
    if not values:
        return rig
    try:
        trigger = TriggerSection.model_validate(rig.config.trigger.model_dump() | values)
    except ValidationError as error:
        faults = [f"trigger.{each['loc'][0]} = {each['input']}: {each['msg']}" for each in error.errors()]
        raise ConfigError("requested trigger", faults) from error
    config = rig.config.model_copy(update={"trigger": trigger})
    if faults := [fault.text for fault in trigger_faults(config)]:
        raise ConfigError("requested trigger", faults)
    return replace(rig, config=config, toml=to_toml(config.model_dump(mode="json", exclude_none=True)))
