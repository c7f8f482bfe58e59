"""Writing TOML from plain data."""

import tomllib

import pytest

from daq.config.toml_files import to_toml


@pytest.mark.parametrize(
    "data",
    [
        {},
        {"a": 1, "b": 2.5, "c": 1e-300, "d": True, "e": "x", "f": [1, 2], "g": []},
        {"text": 'quotes " back \\ slash, ü, line\n, tab\t, control \x01 and \x7f'},
        {"table": {"inner": {"deep": 1}, "after": 2}, "last": 3},
        {"points": [{"t": 0.0, "inner": {"x": 1}}, {"t": 1.0, "list": [{"y": 1}]}]},
        {"mixed": [1, {"a": [2, 3]}, "x"]},
    ],
)
def test_to_toml_survives_a_round_trip(data: dict[str, object]) -> None:
    assert tomllib.loads(to_toml(data)) == data
