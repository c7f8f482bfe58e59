"""The rig files in the repository: they explain all keys, and the simulated ones run."""

import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
from pydantic import BaseModel

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
