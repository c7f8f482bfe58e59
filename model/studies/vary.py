"""Parameters by name, with their unit in the name, as a sweep changes them."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

from model.parameters import FloatingRing, Imbalance, ModelParameters

MICRO = 1e-6
MILLI = 1e-3


def _bearing(field: str, factor: float) -> Callable[[ModelParameters, float], ModelParameters]:
    def change(parameters: ModelParameters, value: float) -> ModelParameters:
        return replace(parameters, bearing=replace(parameters.bearing, **{field: value * factor}))

    return change


def _ring_ratio(parameters: ModelParameters, value: float) -> ModelParameters:
    """Give the ring the outer radius at which it turns at that part of the shaft's speed, eq. (3.25)."""
    if not 0 < value < 1:
        raise ValueError(f"ring_speed_ratio: {value:g}, expected more than 0 and less than 1")
    bearing: FloatingRing = parameters.bearing
    cubed = (1 / value - 1) * bearing.journal_radius**3 * bearing.outer_clearance / bearing.inner_clearance
    return replace(parameters, bearing=replace(bearing, ring_outer_radius=cubed ** (1 / 3)))


def _imbalance(parameters: ModelParameters, value: float) -> ModelParameters:
    first, *others = parameters.imbalances or (Imbalance(1, 0.0),)
    return replace(parameters, imbalances=(replace(first, magnitude=value), *others))


def _phase(parameters: ModelParameters, value: float) -> ModelParameters:
    first, *others = parameters.imbalances or (Imbalance(1, 0.0),)
    return replace(parameters, imbalances=(replace(first, phase=math.radians(value)), *others))


def _station(parameters: ModelParameters, value: float) -> ModelParameters:
    if value != int(value):
        raise ValueError(f"imbalance_station: {value:g}, expected a whole number")
    first, *others = parameters.imbalances or (Imbalance(1, 0.0),)
    return replace(parameters, imbalances=(replace(first, station=int(value)), *others))


CHANGES: Final[dict[str, Callable[[ModelParameters, float], ModelParameters]]] = {
    "imbalance_kg_m": _imbalance,
    "imbalance_station": _station,
    "imbalance_phase_deg": _phase,
    "viscosity_pa_s": _bearing("viscosity", 1.0),
    "inner_clearance_um": _bearing("inner_clearance", MICRO),
    "outer_clearance_um": _bearing("outer_clearance", MICRO),
    "ring_outer_radius_mm": _bearing("ring_outer_radius", MILLI),
    "ring_mass_kg": _bearing("ring_mass", 1.0),
    "film_length_mm": _bearing("length", MILLI),
    "static_load_n": _bearing("static_load", 1.0),
    "gravity_m_s2": lambda parameters, value: replace(parameters, gravity=value),
    "ring_speed_ratio": _ring_ratio,  # after the clearances that it goes by
}


def varied(parameters: ModelParameters, values: Mapping[str, float]) -> ModelParameters:
    """Return parameters with some changed.

    Parameters
    ----------
    parameters : ModelParameters
        What stays.
    values : mapping of str to float
        By the names of `CHANGES`; an imbalance is the first one. In the order of `CHANGES`, whatever theirs.

    Raises
    ------
    ValueError
        Where a name is unknown or the parameters make no sense.
    """
    for name in values:
        if name not in CHANGES:
            raise ValueError(f"{name}: unknown, expected one of {', '.join(CHANGES)}")
    for name, change in CHANGES.items():
        if name in values:
            parameters = change(parameters, values[name])
    return parameters
