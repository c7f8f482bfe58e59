"""Whatever stands in a rig.toml, it is either a rig or told what is wrong."""

import copy
import tomllib
from pathlib import Path
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from daq.config.loader import read_recorded_config
from daq.config.toml_files import to_toml
from daq.errors import ConfigError

BENCH = tomllib.loads((Path(__file__).parents[3] / "rigs" / "bench.toml").read_text("utf-8"))
ODD = [
    0,
    -1,
    1e308,
    3.5,
    True,
    "",
    "x",
    "ai0",
    "probe_x",
    10**30,
    float("inf"),
    [],
    [1],
    [[1]],
    ["a"],
    {},
    {"a": 1},
    [{}],
]

Place = tuple[int | str, ...]


def places(data: object, above: Place = ()) -> list[Place]:
    """Return every place in nested tables."""
    items: list[tuple[int | str, object]] = []
    if isinstance(data, dict):
        items = list(data.items())
    elif isinstance(data, list):
        items = list(enumerate(data))
    return [place for key, value in items for place in [(*above, key), *places(value, (*above, key))]]


def told(text: str) -> list[str]:
    """Return the faults that are told of a configuration, none where it is taken as good."""
    try:
        config = read_recorded_config(text, "any.toml")
    except ConfigError as error:
        return error.faults or ["an error without a fault"]
    return [] if len(config.channel) == 3 else ["taken as good without its channels"]


@settings(max_examples=150, deadline=None, derandomize=True)
@given(data=st.data())
def test_read_recorded_config_returns_a_configuration_or_errors(data: st.DataObject) -> None:
    tables = copy.deepcopy(BENCH)
    for _ in range(data.draw(st.integers(1, 4))):
        *above, last = data.draw(st.sampled_from(places(tables)))
        table: Any = tables
        for part in above:
            table = table[part]
        if data.draw(st.booleans()):
            del table[last]
        else:
            table[last] = copy.deepcopy(data.draw(st.sampled_from(ODD)))
    faults = told(to_toml(tables))
    assert all("expected" in fault or "unknown key" in fault for fault in faults)
