"""Parameters that a sweep can vary, by a name that ends with the unit."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

from analysis.signals.units import MICROMETRE, MILLIMETRE
from model.errors import ParameterError
from model.rotor.parameters import Imbalance, ModelParameters
from model.rotor.rub import Rub
from model.rotor.supports import SupportCoefficients


def _bearing(field: str, factor: float) -> Callable[[ModelParameters, float], ModelParameters]:
    def change(parameters: ModelParameters, value: float) -> ModelParameters:
        changed: dict[str, Any] = {field: value * factor}
        return replace(parameters, bearing=replace(parameters.floating_ring, **changed))

    return change


def _ring_ratio(parameters: ModelParameters, value: float) -> ModelParameters:
    """Set the outer ring radius that gives this ratio of ring to shaft speed, eq. (3.25)."""
    if not 0 < value < 1:
        raise ParameterError(f"ring_speed_ratio: {value:g}, expected more than 0 and less than 1")
    bearing = parameters.floating_ring
    cubed = (1 / value - 1) * bearing.journal_radius**3 * bearing.outer_clearance / bearing.inner_clearance
    return replace(parameters, bearing=replace(bearing, ring_outer_radius=cubed ** (1 / 3)))


def _imbalance(parameters: ModelParameters, value: float) -> ModelParameters:
    first, *others = parameters.imbalances or (Imbalance(1, 0.0),)
    return replace(parameters, imbalances=(replace(first, magnitude=value), *others))


def _phase(parameters: ModelParameters, value: float) -> ModelParameters:
    first, *others = parameters.imbalances or (Imbalance(1, 0.0),)
    return replace(parameters, imbalances=(replace(first, phase=math.radians(value)), *others))


def _rub(changed: Callable[[Rub, float], Rub]) -> Callable[[ModelParameters, float], ModelParameters]:
    def change(parameters: ModelParameters, value: float) -> ModelParameters:
        if not parameters.rubs:
            raise ParameterError(f"rub: none, expected a rotor with [[rub]] to set {value:g}")
        first, *others = parameters.rubs
        return replace(parameters, rubs=(changed(first, value), *others))

    return change


def _support(parameters: ModelParameters, value: float) -> ModelParameters:
    """Set an isotropic stiffness of the first support; its damping is unchanged."""
    if not parameters.supports:
        raise ParameterError(f"support: none, expected a rotor with [[support]] to set {value:g} N/m")
    first, *others = parameters.supports
    inner = replace(SupportCoefficients.isotropic(value), damping=first.inner.damping)
    return replace(parameters, supports=(replace(first, inner=inner), *others))


def _station(parameters: ModelParameters, value: float) -> ModelParameters:
    if value != int(value):
        raise ParameterError(f"imbalance_station: {value:g}, expected a whole number")
    first, *others = parameters.imbalances or (Imbalance(1, 0.0),)
    return replace(parameters, imbalances=(replace(first, station=int(value)), *others))


PARAMETER_SETTERS: Final[dict[str, Callable[[ModelParameters, float], ModelParameters]]] = {
    "imbalance_kg_m": _imbalance,
    "imbalance_station": _station,
    "imbalance_phase_deg": _phase,
    "viscosity_pa_s": _bearing("viscosity", 1.0),
    "inner_clearance_um": _bearing("inner_clearance", MICROMETRE),
    "outer_clearance_um": _bearing("outer_clearance", MICROMETRE),
    "ring_outer_radius_mm": _bearing("ring_outer_radius", MILLIMETRE),
    "ring_mass_kg": _bearing("ring_mass", 1.0),
    "film_length_mm": _bearing("length", MILLIMETRE),
    "static_load_n": _bearing("static_load", 1.0),
    "support_stiffness_n_m": _support,
    "rub_clearance_um": _rub(lambda rub, value: replace(rub, clearance=value * MICROMETRE)),
    "rub_stiffness_n_m": _rub(lambda rub, value: replace(rub, stiffness=value)),
    "rub_friction": _rub(lambda rub, value: replace(rub, friction=value)),
    "rub_damping_s_m": _rub(lambda rub, value: replace(rub, damping=value)),
    "gravity_m_s2": lambda parameters, value: replace(parameters, gravity=value),
    "ring_speed_ratio": _ring_ratio,  # after the clearances, on which it depends
}


def with_values(parameters: ModelParameters, values: Mapping[str, float]) -> ModelParameters:
    """Return parameters with some values changed.

    Parameters
    ----------
    parameters : ModelParameters
        Base parameters.
    values : mapping of str to float
        By the names of `PARAMETER_SETTERS`, and applied in its order. Names of an imbalance, support or rub refer to
        the first one.

    Raises
    ------
    ParameterError
        If a name is unknown or a value is invalid.
    """
    for name in values:
        if name not in PARAMETER_SETTERS:
            raise ParameterError(f"{name}: unknown, expected one of {', '.join(PARAMETER_SETTERS)}")
    for name, change in PARAMETER_SETTERS.items():
        if name in values:
            parameters = change(parameters, values[name])
    return parameters
