"""The rig files in the repository: they explain all keys, and the simulated ones run."""

import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from analysis.signals.header import Role
from daq.config.loader import load_rig
from daq.config.schema import RigConfig
from daq.drivers.simulation.card import SimulatedCard

RIGS = Path(__file__).parents[3] / "rigs"


def keys(data: object, above: str = "") -> Iterator[str]:
    """Yield all keys of nested tables, dotted, without indices."""
    if isinstance(data, BaseModel):
        data = data.model_dump()
    if isinstance(data, Mapping):
        for key, value in data.items():
            yield f"{above}{key}"
            yield from keys(value, f"{above}{key}.")
    elif isinstance(data, list | tuple):
        for item in data:
            yield from keys(item, above)


def test_every_key_of_the_configuration_is_explained_in_a_rig_file() -> None:
    config = load_rig(RIGS / "bench.toml").config.model_dump()
    del config["rotor"]  # content of the rotor file, which explains its keys itself
    known = set(keys(config))
    assert set(RigConfig.model_fields) - {"rotor"} < known
    written = {
        key for name in ("bench", "usb6251") for key in keys(tomllib.loads((RIGS / f"{name}.toml").read_text("utf-8")))
    }
    assert written == known


def section(annotation: object) -> type[BaseModel] | None:
    """Return the section that a field holds, also inside a tuple or an optional; None for a value."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(section, get_args(annotation))), None)


def other_values(model: type[BaseModel], data: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, object]]:
    """Yield the dotted key and the default of each value that differs from its default."""
    for key, value in data.items():
        field = model.model_fields[key]
        if inner := section(field.annotation):
            for item in value if isinstance(value, list) else [value]:
                yield from other_values(inner, item, f"{above}{key}.")
        else:
            default = field.get_default()
            default = list(default) if isinstance(default, tuple) else default
            if default is not PydanticUndefined and default != value:
                yield f"{above}{key}", default


def comments(text: str, key: str) -> list[str]:
    """Return the comments behind all values of a key, in the tables where it occurs."""
    table, found = "", []
    for line in text.splitlines():
        if header := re.match(r"\[+([a-z.]+)\]", line):
            table = f"{header[1]}."
        if match := re.match(r"([a-z0-9_]+) = [^#]*(#.*)?$", line):
            found += [match[2] or ""] if f"{table}{match[1]}" == key else []
    return found


@pytest.mark.parametrize("name", ["bench", "usb6251"])
def test_rig_file_states_each_default_that_differs_from_its_value(name: str) -> None:
    text = (RIGS / f"{name}.toml").read_text("utf-8")
    differing = dict(other_values(RigConfig, tomllib.loads(text)))
    for key in [key for key in differing if key.startswith("model.")]:
        del differing[key]  # a comment of [model] refers to the rotor file
    assert "channel.gap_window_v" in differing
    assert [key for key in differing if not any("default" in comment for comment in comments(text, key))] == []


def test_rig_file_shows_the_model_values_of_the_rotor_file() -> None:
    rotor = tomllib.loads((RIGS.parent / "model/rotor/gj90c.toml").read_text("utf-8"))
    imbalance = rotor["imbalance"][0]
    model = load_rig(RIGS / "bench.toml").config.model
    assert model.imbalance_kg_m == imbalance["magnitude_kg_m"]
    assert model.imbalance_station == imbalance["station"]
    assert model.imbalance_phase_deg == imbalance["phase_deg"]


@pytest.mark.parametrize("name", ["bench", "model"])
def test_simulated_rig_starts_in_its_gap_windows_with_a_working_tacho(name: str) -> None:
    card = SimulatedCard(load_rig(RIGS / f"{name}.toml"))
    codes = card.next_codes(20_000)
    for row, channel in enumerate(card.acquisition.channels):
        volts = channel.volts(codes[row])
        if channel.role is Role.TACHO:
            tacho = card.acquisition.tacho
            assert volts.min() < tacho.threshold - tacho.hysteresis / 2
            assert volts.max() > tacho.threshold + tacho.hysteresis / 2
        else:
            assert channel.gap_low < float(np.mean(volts)) < channel.gap_high
