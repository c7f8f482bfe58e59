"""Property test: any rig.toml gives either a rig or a list of errors."""

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

KeyPath = tuple[int | str, ...]


def key_paths(data: object, above: KeyPath = ()) -> list[KeyPath]:
    """Return the paths of all values in nested tables."""
    items: list[tuple[int | str, object]] = []
    if isinstance(data, dict):
        items = list(data.items())
    elif isinstance(data, list):
        items = list(enumerate(data))
    return [place for key, value in items for place in [(*above, key), *key_paths(value, (*above, key))]]


def errors_in(text: str) -> list[str]:
    """Return the errors reported for a configuration; an empty list if it is accepted."""
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
        *above, last = data.draw(st.sampled_from(key_paths(tables)))
        table: Any = tables
        for part in above:
            table = table[part]
        if data.draw(st.booleans()):
            del table[last]
        else:
            table[last] = copy.deepcopy(data.draw(st.sampled_from(ODD)))
    faults = errors_in(to_toml(tables))
    assert all("expected" in fault or "unknown key" in fault for fault in faults)
