"""The rotor model's parameters, from the rig's configuration."""

import math

from analysis.run import Role
from daq.config.rig import MICRO, Rig
from daq.config.schema import RigConfig
from model.gj90c import gj90c
from model.parameters import ModelParameters


def rotor_parameters(rig: Rig) -> ModelParameters:
    """Return the parameters of the model that is laid over a rig's measurement."""
    return configured_rotor(rig.config)


def configured_rotor(config: RigConfig) -> ModelParameters:
    """Return the parameters of the model that a configuration asks for, as of a recording's rig."""
    section = config.model
    seats = {channel.role: math.radians(channel.angle_deg) for channel in config.channel}
    return gj90c(
        imbalance=section.imbalance_kg_m,
        imbalance_station=section.imbalance_station,
        imbalance_phase=math.radians(section.imbalance_phase_deg),
        viscosity=section.viscosity_pa_s,
        inner_clearance=section.inner_clearance_um * MICRO,
        outer_clearance=section.outer_clearance_um * MICRO,
        probe_angles=(seats.get(Role.PROBE_X, 0.0), seats.get(Role.PROBE_Y, math.pi / 2)),
    )
