"""Load rig.toml with the calibration and rotor files that it names, and report all errors together."""

import copy
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import reduce
from itertools import chain
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from analysis.signals.header import Calibration, Role
from daq.config.calibration import load_calibration
from daq.config.consistency import card_issues, consistency_issues, trigger_issues
from daq.config.rig import Rig, default_rotor, read_rotor
from daq.config.schema import ChannelSection, RigConfig, TriggerSection
from daq.config.toml_files import (
    ConfigIssue,
    KeyPath,
    read_tables,
    read_text,
    toml_literal,
    validate,
    validated,
    validation_issues,
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
    rotor_issues = _embed_rotor(data, path.parent)
    return _rig(path, data, rotor_issues, lambda _, file: load_calibration(path.parent / file))


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

    def given(channel: str, _file: str) -> Calibration:
        if channel not in calibrations:
            raise ConfigError(file, [f"no file is read here: expected the calibration of {channel!r} with the text"])
        return calibrations[channel]

    data = read_tables(text, file)
    return _rig(Path(file), data, _embed_rotor(data, None), given)


def _rig(
    path: Path,
    data: dict[str, object],
    rotor_issues: list[ConfigIssue],
    calibration_of: Callable[[str, str], Calibration],
) -> Rig:
    """Return the rig in parsed tables; `calibration_of` returns the calibration for a channel and file name."""
    config, issues = _validate(data, lambda config: chain(consistency_issues(config), card_issues(config)))
    issues += rotor_issues
    calibrations: dict[str, Calibration] = {}
    for number, channel in _probes(data):
        key, name = f"channel[{number}]", str(channel.get("name"))
        try:
            calibrations[name] = calibration_of(name, str(channel["calibration"]))
        except ConfigError as error:
            entry = f'{key}.calibration = "{channel["calibration"]}"'
            issues += [ConfigIssue((f"{key}.calibration",), f"{entry}: {fault}") for fault in error.faults]
        else:
            if config is not None:
                issues += _gap_window_issues(config.channel[number], calibrations[name], key)
    if issues or config is None:
        raise ConfigError(str(path), [issue.text for issue in issues])
    return Rig(path=path, config=config, calibrations=calibrations)


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
    config, issues = _validate(data, consistency_issues)
    if config is None or any(issue.keys[0].startswith(MODEL_SECTIONS) for issue in issues):
        raise ConfigError(file, [issue.text for issue in issues])
    return config


def _translate_renamed_keys(data: dict[str, object]) -> None:
    """Give renamed keys in parsed tables their present names."""
    for (*sections, old), new in RENAMED_KEYS.items():
        table: object = data
        for section in sections:
            table = table.get(section) if isinstance(table, dict) else None
        if isinstance(table, dict) and old in table:
            table.setdefault(new, table.pop(old))


def _embed_rotor(data: dict[str, object], folder: Path | None) -> list[ConfigIssue]:
    """Put the content of the rotor file into the tables, so that a recording holds it; return errors.

    `folder` is the folder of the rotor file; with None no file may be named.
    """
    section = data.get("model")
    name = section.get("rotor", "") if isinstance(section, Mapping) else ""
    if not isinstance(name, str):
        return []  # reported by the schema
    if "rotor" in data:
        text = f"{ROTOR_KEY} = {toml_literal(name)}: expected none beside the file's own [rotor]"
        return [ConfigIssue((ROTOR_KEY,), text)] if name else []
    if not name:
        data["rotor"] = default_rotor()
        return []
    if folder is None:
        text = f"{ROTOR_KEY} = {toml_literal(name)}: no file is read here, expected its content as [rotor]"
        return [ConfigIssue((ROTOR_KEY,), text)]
    try:
        data["rotor"] = read_rotor(folder / name)
    except ConfigError as error:
        return [ConfigIssue((ROTOR_KEY,), f"{ROTOR_KEY} = {toml_literal(name)}: {fault}") for fault in error.faults]
    return []


def _validate(
    data: dict[str, object], contradictions: Callable[[RigConfig], Iterable[ConfigIssue]]
) -> tuple[RigConfig | None, list[ConfigIssue]]:
    """Return the configuration in parsed tables and all errors in it; None where required parts are missing.

    Pydantic stops at the errors of single keys. To check also how the other keys fit together, wrong values are removed
    so that their defaults apply, required ones are replaced by placeholders, and the rest is validated again, then
    passed to `contradictions`.
    """
    issues: list[ConfigIssue] = []
    sound: Any = copy.deepcopy(data)
    complete = True
    for _ in range(MAX_ROUNDS):
        try:
            config = validate(RigConfig, sound)
        except ValidationError as error:
            issues = issues or list(validation_issues(error, RigConfig, RENAMED_KEYS))
            missing = [details["loc"] for details in error.errors() if details["type"] == "missing"]
            wrong = [details["loc"] for details in error.errors() if details["type"] != "missing"]
            complete = complete and not missing and not any(isinstance(path[-1], int) for path in wrong)
            for *above, last in missing:
                if last in PLACEHOLDERS:
                    reduce(lambda table, key: table[key], above, sound)[last] = PLACEHOLDERS[last]
                elif above:
                    wrong.append(tuple(above))  # the table is left out
                else:
                    return None, issues
            sound = _without(sound, wrong)
        else:
            keys = {issue.keys[0] for issue in issues}
            issues += [issue for issue in contradictions(config) if not _follows_from(issue, keys)]
            return config if complete else None, issues
    return None, issues


def _without(value: object, paths: Sequence[KeyPath]) -> Any:
    """Return nested tables and lists without the values at the paths."""
    if not isinstance(value, dict | list):
        return value
    kept = {}
    for key, item in value.items() if isinstance(value, dict) else enumerate(value):
        inner = [path[1:] for path in paths if path[0] == key]
        if () not in inner:
            kept[key] = _without(item, inner)
    return kept if isinstance(value, dict) else list(kept.values())


def _follows_from(issue: ConfigIssue, wrong: set[str]) -> bool:
    """Return whether a contradiction involves a key that is itself wrong, and so adds nothing."""
    known = wrong | {re.sub(r"\[\d+\]", "", key) for key in wrong}
    return any(
        key == bad or key.startswith(f"{bad}.") or bad.startswith(f"{key}[") for key in issue.keys for bad in known
    )


def _probes(data: Mapping[str, object]) -> Iterator[tuple[int, Mapping[str, object]]]:
    """Yield number and table of each channel that names a calibration and is not the tacho, even if otherwise wrong."""
    channels = data.get("channel")
    for number, channel in enumerate(channels if isinstance(channels, list) else ()):
        if isinstance(channel, Mapping) and channel.get("role") != Role.TACHO.value:
            calibration = channel.get("calibration")
            if isinstance(calibration, str) and calibration:
                yield number, channel


def _gap_window_issues(channel: ChannelSection, calibration: Calibration, key: str) -> list[ConfigIssue]:
    """Return an error if the gap window exceeds the calibrated span."""
    low, high = channel.gap_window_v
    if low >= calibration.volts_low and high <= calibration.volts_high:
        return []
    span = f"{calibration.volts_low:g} to {calibration.volts_high:g} V"
    name = f"{key}.gap_window_v"
    text = f"{name} = [{low:g}, {high:g}]: expected voltages in the calibrated span, {span} ({channel.calibration})"
    return [ConfigIssue((name,), text)]


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
    tables = rig.config.trigger.model_dump() | values
    config = rig.config.model_copy(
        update={"trigger": validated(TriggerSection, tables, "requested trigger", "trigger")}
    )
    if issues := [issue.text for issue in trigger_issues(config)]:
        raise ConfigError("requested trigger", issues)
    return replace(rig, config=config)
