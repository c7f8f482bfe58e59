"""Reading rig.toml and every file that it names, with all that is wrong said in one go."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from pydantic import ValidationError

from analysis.run import Calibration, Role
from daq.config.calibration import load_calibration
from daq.config.checks import cross_faults
from daq.config.faults import Fault, dotted, plain_json, read_tables, read_text, validation_faults
from daq.config.rig import Rig
from daq.config.schema import ChannelSection, RigConfig
from daq.config.write import to_toml
from daq.errors import ConfigError


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
    config, faults = _checked(data)
    calibrations: dict[str, Calibration] = {}
    for number, channel in _probes(data):
        key = f"channel[{number}]"
        try:
            calibration = load_calibration(path.parent / str(channel["calibration"]))
        except ConfigError as error:
            name = f'{key}.calibration = "{channel["calibration"]}"'
            faults += [Fault((f"{key}.calibration",), f"{name}: {fault}") for fault in error.faults]
        else:
            calibrations[str(channel.get("name"))] = calibration
            if config is not None:
                faults += _window_faults(config.channel[number], calibration, key)
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
    config, faults = _checked(read_tables(text, file))
    if faults or config is None:
        raise ConfigError(file, [fault.text for fault in faults])
    return config


def _checked(data: dict[str, object]) -> tuple[RigConfig | None, list[Fault]]:
    """Return the configuration in tables with every fault in it; None where it is not even whole.

    What is wrong is taken out, so that its default stands in for it and the rest can still be checked. A table that
    lacks what has no default is taken out altogether.
    """
    faults: list[Fault] = []
    wrong: set[str] = set()
    pruned: Mapping[str, object] = data
    whole = True
    while True:
        try:
            config = RigConfig.model_validate_json(plain_json(pruned), strict=True)
        except ValidationError as error:
            if not faults:
                faults = list(validation_faults(error, RigConfig, data))
                wrong = {_bare(fault.keys[0]) for fault in faults}
            places = [
                details["loc"] if details["type"] != "missing" else details["loc"][:-1] for details in error.errors()
            ]
            if () in places:
                return None, faults
            lost = {_bare(dotted(place)) for place in places if isinstance(place[-1], int)}
            whole, wrong = whole and not lost, wrong | lost
            pruned = _without(pruned, places)
        else:
            faults += [fault for fault in cross_faults(config) if not _rests_on(fault, wrong)]
            return config if whole else None, faults


def _without(data: Mapping[str, object], places: list[tuple[int | str, ...]]) -> dict[str, object]:
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


def _items_without(items: list[object], places: list[tuple[int | str, ...]]) -> list[object]:
    """Return a list without what is at places in it."""
    kept: list[object] = []
    for number, item in enumerate(items):
        inner = [place[1:] for place in places if place[0] == number]
        if () not in inner:
            kept.append(_without(item, inner) if isinstance(item, Mapping) else item)
    return kept


def _rests_on(fault: Fault, wrong: set[str]) -> bool:
    """Return whether a contradiction involves what is wrong in itself, and so says nothing new."""
    return any(_bare(key) == bare or _bare(key).startswith(f"{bare}.") for key in fault.keys for bare in wrong)


def _bare(key: str) -> str:
    return re.sub(r"\[\d+\]", "", key)


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
