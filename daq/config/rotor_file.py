"""Rotor files: what the model's rotor is made of, read from disk; `model.rotor.rotor_file` says whether it is right."""

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path

from daq.config.messages import read_tables, read_text
from model.rotor.parameters import ModelParameters
from model.rotor.rotor_file import rotor_from


def read_rotor(path: Path | str) -> dict[str, object]:
    """Return the content of a rotor file; ConfigError where it cannot be read or is not TOML."""
    return read_tables(read_text(Path(path)), str(path))


def default_rotor() -> dict[str, object]:
    """Return the content of the rotor file that comes with the program: the thesis's GJ90C."""
    text = files("model.rotor").joinpath("gj90c.toml").read_text(encoding="utf-8")
    return read_tables(text, "gj90c.toml")


def rotor_of(document: Mapping[str, object]) -> ModelParameters:
    """Return what a rotor file says, the GJ90C where it says nothing; DocumentError where it is wrong."""
    return rotor_from(document) if document else _gj90c()


@cache
def _gj90c() -> ModelParameters:
    return rotor_from(default_rotor())
