"""The rotor model's parameters from the configuration, and reading of rotor files."""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path

from analysis.signals.header import Role
from analysis.signals.units import MICROMETRE
from daq.config.schema import ModelSection, RigConfig
from daq.config.toml_files import read_tables, read_text
from model.rotor.parameters import FloatingRing, Imbalance, ModelParameters
from model.rotor.rotor_file import parse_rotor


def read_rotor(path: Path | str) -> dict[str, object]:
    """Return the content of a rotor file; ConfigError if it cannot be read or is not TOML."""
    return read_tables(read_text(Path(path)), str(path))


def default_rotor() -> dict[str, object]:
    """Return the content of the default rotor file: the thesis's GJ90C."""
    text = files("model.rotor").joinpath("gj90c.toml").read_text(encoding="utf-8")
    return read_tables(text, "gj90c.toml")


def parameters_from_tables(tables: Mapping[str, object]) -> ModelParameters:
    """Return the parameters in a rotor file, those of the GJ90C if it is empty; TableError if it is wrong."""
    return parse_rotor(tables) if tables else _gj90c()


@cache
def _gj90c() -> ModelParameters:
    return parse_rotor(default_rotor())


def model_parameters(config: RigConfig) -> ModelParameters:
    """Return the rotor model's parameters: those of the rotor file, with the changes in `[model]`.

    Raises
    ------
    ParameterError
        The rotor is wrong, or `[model]` contradicts it.
    """
    parameters = parameters_from_tables(config.rotor)
    angles = {channel.role: math.radians(channel.angle_deg) for channel in config.channel}
    return replace(
        parameters,
        bearing=_bearing(parameters.floating_ring, config.model),
        imbalances=_imbalances(parameters.imbalances, config.model),
        probe_angles=(angles.get(Role.PROBE_X, 0.0), angles.get(Role.PROBE_Y, math.pi / 2)),
    )


def _bearing(bearing: FloatingRing, section: ModelSection) -> FloatingRing:
    if section.viscosity_pa_s is not None:
        bearing = replace(bearing, viscosity=section.viscosity_pa_s)
    if section.inner_clearance_um is not None:
        bearing = replace(bearing, inner_clearance=section.inner_clearance_um * MICROMETRE)
    if section.outer_clearance_um is not None:
        bearing = replace(bearing, outer_clearance=section.outer_clearance_um * MICROMETRE)
    return bearing


def _imbalances(imbalances: tuple[Imbalance, ...], section: ModelSection) -> tuple[Imbalance, ...]:
    """Return the imbalances, the first one changed as in the section."""
    magnitude, station, phase = section.imbalance_kg_m, section.imbalance_station, section.imbalance_phase_deg
    if magnitude is None and station is None and phase is None:
        return imbalances
    first, *others = imbalances or (Imbalance(1, 0.0),)
    changed = Imbalance(
        station=first.station if station is None else station,
        magnitude=first.magnitude if magnitude is None else magnitude,
        phase=first.phase if phase is None else math.radians(phase),
    )
    return (changed, *others)
