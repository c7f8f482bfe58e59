"""The trigger of a rig, changed for one recording.

Reading rig.toml and every file that it names, with all that is wrong said in one go.
"""

import copy
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from analysis.signals.header import Calibration, Role
from daq.config.calibration import load_calibration
from daq.config.checks import cross_faults, trigger_faults
from daq.config.rig import Rig
from daq.config.rotor import default_rotor, read_rotor
from daq.config.schema import ChannelSection, RigConfig, TriggerSection
from daq.config.toml_files import Fault, plain_json, read_tables, read_text, shown, to_toml, validation_faults
from daq.errors import ConfigError

Place = tuple[int | str, ...]

ROTOR_KEY = "model.rotor"
OF_THE_MODEL = ("channel", "model", "rotor")  # sections on which the model of a run rests
ROUNDS = 4  # of taking out what is wrong

# For what has no default, so that the rest of its table can be checked where it is missing or wrong.
STAND_INS: Final[dict[int | str, object]] = {
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
        The file or a calibration is missing or wrong; names every fault found in all of them.
    """
    path = Path(path)
    data = read_tables(read_text(path), str(path))
    rotor_faults = _take_in_rotor(data, path.parent)
    return _rig(path, data, rotor_faults, lambda _, file: load_calibration(path.parent / file))


def parse_rig(text: str, calibrations: Mapping[str, Calibration], file: str) -> Rig:
    """Return the rig that a TOML text describes; nothing that it names is read from the disk.

    Parameters
    ----------
    text : str
        The content of a rig.toml; its rotor, where it is not the GJ90C, is in it as ``[rotor]``.
    calibrations : mapping of str to Calibration
        In place of the files that its probes name, by channel.
    file : str
        What to call the text.

    Raises
    ------
    ConfigError
        The text is wrong, or a calibration is missing; names every fault.
    """
    data = read_tables(text, file)

    def given(channel: str, _file: str) -> Calibration:
        if channel not in calibrations:
            raise ConfigError(file, [f"no file is read here: expected the calibration of {channel!r} beside the text"])
        return calibrations[channel]

    return _rig(Path(file), data, _take_in_rotor(data, None), given)


def _rig(
    path: Path, data: dict[str, object], rotor_faults: list[Fault], calibration_of: Callable[[str, str], Calibration]
) -> Rig:
    """Return the rig in tables, with a calibration for each probe's channel and file; ConfigError with all faults."""
    config, faults = _checked(data)
    faults += rotor_faults
    calibrations: dict[str, Calibration] = {}
    for number, channel in _probes(data):
        key, name = f"channel[{number}]", str(channel.get("name"))
        try:
            calibration = calibration_of(name, str(channel["calibration"]))
        except ConfigError as error:
            said = f'{key}.calibration = "{channel["calibration"]}"'
            faults += [Fault((f"{key}.calibration",), f"{said}: {fault}") for fault in error.faults]
        else:
            calibrations[name] = calibration
            if config is not None:
                faults += _window_faults(config.channel[number], calibration, key)
    if faults or config is None:
        raise ConfigError(str(path), [fault.text for fault in faults])
    return Rig(
        path=path,
        config=config,
        calibrations=calibrations,
        toml=to_toml(config.model_dump(mode="json", exclude_none=True)),
    )


def read_recorded_config(text: str, file: str) -> RigConfig:
    """Return the configuration in a TOML text, as a recording carries it; the files that it names are not read.

    It was good when the run was recorded. What this program refuses since (a key that is no more, a narrower range) has
    its default, but where the model rests on it: a recording stays readable.

    Parameters
    ----------
    text : str
        The content of a rig.toml.
    file : str
        What to call it.

    Raises
    ------
    ConfigError
        It is no configuration, or its probes or its model are wrong; names every fault.
    """
    config, faults = _checked(read_tables(text, file))
    if config is None or any(fault.keys[0].startswith(OF_THE_MODEL) for fault in faults):
        raise ConfigError(file, [fault.text for fault in faults])
    return config


def _take_in_rotor(data: dict[str, object], folder: Path | None) -> list[Fault]:
    """Put the content of the rotor's file into the tables, so that a recording of them is whole; None reads none."""
    section = data.get("model")
    name = section.get("rotor", "") if isinstance(section, Mapping) else ""
    if not isinstance(name, str):
        return []  # the schema says so
    if "rotor" in data:
        text = f"{ROTOR_KEY} = {shown(name)}: expected none beside the file's own [rotor]"
        return [Fault((ROTOR_KEY,), text)] if name else []
    if not name:
        data["rotor"] = default_rotor()
        return []
    if folder is None:
        text = f"{ROTOR_KEY} = {shown(name)}: no file is read here, expected its content as [rotor]"
        return [Fault((ROTOR_KEY,), text)]
    try:
        data["rotor"] = read_rotor(folder / name)
    except ConfigError as error:
        return [Fault((ROTOR_KEY,), f"{ROTOR_KEY} = {shown(name)}: {fault}") for fault in error.faults]
    return []


def _checked(data: dict[str, object]) -> tuple[RigConfig | None, list[Fault]]:
    """Return the configuration in tables with every fault in it; None where it is not even whole.

    What is wrong is taken out, so that its default, or a stand-in for what has none, lets the rest be checked.
    """
    faults: list[Fault] = []
    sound: dict[str, object] = data
    whole = True
    for _ in range(ROUNDS):
        try:
            config = RigConfig.model_validate_json(plain_json(sound), strict=True)
        except ValidationError as error:
            if not faults:
                faults = list(validation_faults(error, RigConfig, data))
            missing = [details["loc"] for details in error.errors() if details["type"] == "missing"]
            gone = [place[:-1] for place in missing if place[-1] not in STAND_INS]
            if () in gone:
                return None, faults
            present = [details["loc"] for details in error.errors() if details["type"] != "missing"]
            whole = whole and not missing and not any(isinstance(place[-1], int) for place in present)
            filled = _completed(sound, [place for place in missing if place[-1] in STAND_INS])
            sound = _without(filled, present + gone)
        else:
            wrong = {fault.keys[0] for fault in faults}
            faults += [fault for fault in cross_faults(config) if not _rests_on(fault, wrong)]
            return config if whole else None, faults
    return None, faults


def _without(data: Mapping[str, object], places: Sequence[Place]) -> dict[str, object]:
    """Return nested tables without what is at places."""
    kept: dict[str, object] = {}
    for key, value in data.items():
        inner = [place[1:] for place in places if place[0] == key]
        if () in inner:
            continue
        kept[key] = value
        if isinstance(value, Mapping):
            kept[key] = _without(value, inner)
        elif isinstance(value, list):
            kept[key] = _items_without(value, inner)
    return kept


def _items_without(items: list[object], places: Sequence[Place]) -> list[object]:
    """Return a list without what is at places in it."""
    kept: list[object] = []
    for number, item in enumerate(items):
        inner = [place[1:] for place in places if place[0] == number]
        if () not in inner:
            kept.append(_without(item, inner) if isinstance(item, Mapping) else item)
    return kept


def _completed(data: dict[str, object], places: Sequence[Place]) -> dict[str, object]:
    """Return nested tables with stand-ins at places."""
    completed = copy.deepcopy(data)
    for place in places:
        table: Any = completed
        for part in place[:-1]:
            table = table[part]
        table[place[-1]] = STAND_INS[place[-1]]
    return completed


def _rests_on(fault: Fault, wrong: set[str]) -> bool:
    """Return whether a contradiction involves what is wrong in itself, and so says nothing new."""
    known = wrong | {re.sub(r"\[\d+\]", "", key) for key in wrong}
    return any(
        key == bad or key.startswith(f"{bad}.") or bad.startswith(f"{key}[") for key in fault.keys for bad in known
    )


def _probes(data: Mapping[str, object]) -> Iterator[tuple[int, Mapping[str, object]]]:
    """Yield number and table of each channel that names a calibration and is no tacho, whatever else is wrong."""
    channels = data.get("channel")
    for number, channel in enumerate(channels if isinstance(channels, list) else ()):
        if isinstance(channel, Mapping) and channel.get("role") != Role.TACHO.value:
            calibration = channel.get("calibration")
            if isinstance(calibration, str) and calibration:
                yield number, channel


def _window_faults(channel: ChannelSection, calibration: Calibration, key: str) -> list[Fault]:
    """Return a fault where the gap window goes beyond what was calibrated."""
    low, high = channel.gap_window_v
    if low >= calibration.volts_low and high <= calibration.volts_high:
        return []
    span = f"{calibration.volts_low:g} to {calibration.volts_high:g} V"
    name = f"{key}.gap_window_v"
    text = f"{name} = [{low:g}, {high:g}]: expected voltages that were calibrated, {span} ({channel.calibration})"
    return [Fault((name,), text)]


def with_trigger(rig: Rig, **asked: str | float | None) -> Rig:
    """Return the rig with another trigger.

    Parameters
    ----------
    rig : Rig
        The rig.
    **asked : str, float or None
        Keys of `[trigger]`; what is None stays as it is.

    Raises
    ------
    ConfigError
        A condition is none or on what does not exist, or a time or number is out of its range.
    """
    given = {key: value for key, value in asked.items() if value is not None}
    if not given:
        return rig
    try:
        trigger = TriggerSection.model_validate(rig.config.trigger.model_dump() | given)
    except ValidationError as error:
        told = [f"trigger.{each['loc'][0]} = {each['input']}: {each['msg']}" for each in error.errors()]
        raise ConfigError("the trigger that was asked for", told) from error
    config = rig.config.model_copy(update={"trigger": trigger})
    if faults := [fault.text for fault in trigger_faults(config)]:
        raise ConfigError("the trigger that was asked for", faults)
    return replace(rig, config=config, toml=to_toml(config.model_dump(mode="json", exclude_none=True)))
