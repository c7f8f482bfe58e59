"""Reading rig.toml and every file that it names, with all that is wrong said in one go."""

import re
from collections.abc import Mapping
from pathlib import Path

from pydantic import ValidationError

from analysis.run import Calibration, Role
from daq.config.calibration import load_calibration
from daq.config.checks import cross_faults
from daq.config.faults import Fault, plain_json, read_tables, read_text, validation_faults
from daq.config.rig import Rig
from daq.config.schema import ChannelSection, RigConfig
from daq.config.write import to_toml
from daq.errors import ConfigError

ROUNDS = 3  # of taking out what is wrong, until the rest can be checked


def load_rig(path: Path | str) -> Rig:
    """Return the rig that a file describes.

    Parameters
    ----------
    path : Path or str
        rig.toml; the calibration files that it names are relative to it.

    Raises
    ------
    ConfigError
        The file or a calibration is missing or wrong; names every fault found in all of them.
    """
    path = Path(path)
    data = read_tables(read_text(path), str(path))
    config, faults, wrong = _validated(data)
    calibrations: dict[str, Calibration] = {}
    if config is not None:
        faults += [fault for fault in cross_faults(config) if not _rests_on(fault, wrong)]
        for number, channel in enumerate(config.channel):
            key = f"channel[{number}].calibration"
            if channel.role is not Role.TACHO and channel.calibration and key not in wrong:
                found, calibration_faults = _calibration(path.parent / channel.calibration, channel, key)
                faults += calibration_faults
                if found is not None:
                    calibrations[channel.name] = found
    if faults or config is None:
        raise ConfigError(str(path), [fault.text for fault in faults])
    return Rig(path=path, config=config, calibrations=calibrations, toml=to_toml(config.model_dump(mode="json")))


def read_config(text: str, file: str) -> RigConfig:
    """Return the configuration in a TOML text, as a recording carries it; the files that it names are not read.

    Parameters
    ----------
    text : str
        The content of a rig.toml.
    file : str
        What to call it.

    Raises
    ------
    ConfigError
        It is wrong; names every fault.
    """
    config, faults, wrong = _validated(read_tables(text, file))
    if config is not None:
        faults += [fault for fault in cross_faults(config) if not _rests_on(fault, wrong)]
    if faults or config is None:
        raise ConfigError(file, [fault.text for fault in faults])
    return config


def _validated(data: dict[str, object]) -> tuple[RigConfig | None, list[Fault], set[str]]:
    """Return the configuration without what is wrong in it, the faults, and the keys that were wrong.

    What is wrong is taken out, so that its default stands in for it, and the rest can still be checked. There is no
    configuration where a key that has no default is wrong.
    """
    faults: list[Fault] = []
    pruned: Mapping[str, object] = data
    for _ in range(ROUNDS):
        try:
            config = RigConfig.model_validate_json(plain_json(pruned), strict=True)
        except ValidationError as error:
            if not faults:
                faults = list(validation_faults(error, RigConfig, data))
            pruned = _without(pruned, [details["loc"] for details in error.errors()])
        else:
            return config, faults, {key for fault in faults for key in fault.keys}
    return None, faults, {key for fault in faults for key in fault.keys}


def _without(data: Mapping[str, object], places: list[tuple[int | str, ...]]) -> dict[str, object]:
    """Return nested tables without the keys at places; a place in a list takes the whole list's key out."""
    kept: dict[str, object] = {}
    for key, value in data.items():
        inner = [place[1:] for place in places if place and place[0] == key]
        if not inner:
            kept[key] = value
        elif isinstance(value, Mapping) and all(inner):
            kept[key] = _without(value, inner)
        elif isinstance(value, list) and all(len(place) > 1 for place in inner):
            kept[key] = [
                _without(item, [place[1:] for place in inner if place[0] == number])
                if isinstance(item, Mapping)
                else item
                for number, item in enumerate(value)
            ]
    return kept


def _rests_on(fault: Fault, wrong: set[str]) -> bool:
    """Return whether a contradiction involves a key that is wrong in itself, and so says nothing new."""
    bare = {_bare(key) for key in wrong}
    return any(key in wrong or _bare(key) in bare for key in fault.keys)


def _bare(key: str) -> str:
    return re.sub(r"\[\d+\]", "", key)


def _calibration(path: Path, channel: ChannelSection, key: str) -> tuple[Calibration | None, list[Fault]]:
    """Return the calibration in a file, with the faults of the file and of the channel that uses it."""
    try:
        calibration = load_calibration(path)
    except ConfigError as error:
        return None, [Fault((key,), f'{key} = "{channel.calibration}": {fault}') for fault in error.faults]
    low, high = channel.gap_window_v
    if low < calibration.volts_low or high > calibration.volts_high:
        span = f"{calibration.volts_low:g} to {calibration.volts_high:g} V"
        window = f"{key.removesuffix('calibration')}gap_window_v"
        text = f"{window} = [{low:g}, {high:g}]: expected voltages that were calibrated, {span} ({channel.calibration})"
        return calibration, [Fault((window,), text)]
    return calibration, []
