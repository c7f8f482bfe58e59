"""Sweeps: quantities as functions of parameters, parameters that can vary, and the points of a sweep."""

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from json import dumps
from typing import Any, Final

import numpy as np

from analysis.signals.units import MICROMETRE, MILLIMETRE, phase_lag_degrees
from model.dynamics.stability import FilmName
from model.dynamics.synchronous import synchronous_response
from model.errors import ModelError, ParameterError
from model.linear.linear_system import linear_system
from model.linear.modes import critical_speeds
from model.prediction.prediction_map import MODEL_VERSION
from model.rotor.parameters import Imbalance, ModelParameters
from model.rotor.supports import Rub, SupportCoefficients
from model.studies.linear_studies import journal_springs
from model.studies.motion import DEFAULT_PERTURBATION
from model.studies.onset import stability
from model.studies.run_up import run_up

QUANTITIES_VERSION = 3  # increase with every change of a quantity
_RANGE = {"lowest_speed_rad_s": 100.0, "highest_speed_rad_s": 4000.0, "speeds": 40.0}


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


@dataclass(frozen=True, slots=True)
class Quantity:
    """A quantity that a sweep can compute.

    Parameters
    ----------
    description : str
        Description for the help.
    options : mapping of str to float
        Options of the quantity with their defaults; they may be varied too.
    results : tuple of str
        Names of the results, with units.
    compute : callable
        Function from parameters and options to the values of `results`.
    needs_films : bool
        Whether the quantity needs a rotor on oil films.
    """

    description: str
    options: Mapping[str, float]
    results: tuple[str, ...]
    compute: Callable[[ModelParameters, Mapping[str, float]], tuple[float, ...]]
    needs_films: bool = True


@dataclass(frozen=True, slots=True)
class SweepPoint:
    """A point of a sweep.

    Parameters
    ----------
    parameters : ModelParameters
        Base parameters.
    quantity : str
        Name in `QUANTITIES`.
    values : tuple of pairs of str and float
        Varied values: parameters of `PARAMETER_SETTERS`, options of the quantity.
    """

    parameters: ModelParameters
    quantity: str
    values: tuple[tuple[str, float], ...]

    def key(self) -> str:
        """Return a hexadecimal hash of all inputs of the result and of the model version."""
        inputs = {
            "versions": [MODEL_VERSION, QUANTITIES_VERSION],
            "parameters": asdict(self.parameters),
            "quantity": self.quantity,
            "values": sorted(self.values),
        }
        return sha256(dumps(inputs, sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class SweepResult:
    """Result of a point of a sweep.

    Parameters
    ----------
    key : str
        Key of the point.
    results : tuple of float
        Values of the results of the quantity; NaN on failure.
    fault : str
        Error message; empty on success.
    """

    key: str
    results: tuple[float, ...]
    fault: str = ""


def compute_point(point: SweepPoint) -> SweepResult:
    """Return the result of a point. Errors of the model are stored in it, not raised."""
    quantity = QUANTITIES[point.quantity]
    values = dict(point.values)
    options = {**quantity.options, **{name: values[name] for name in quantity.options if name in values}}
    try:
        changed = {name: value for name, value in values.items() if name not in quantity.options}
        parameters = with_values(point.parameters, changed)
        return SweepResult(point.key(), quantity.compute(parameters, options))
    except ModelError as error:
        return SweepResult(point.key(), (math.nan,) * len(quantity.results), str(error))


def compute_points(points: tuple[SweepPoint, ...]) -> tuple[SweepResult, ...]:
    """Return the results of several points: the unit of work sent to another process."""
    return tuple(compute_point(point) for point in points)


def variable_names(quantity: str, parameters: ModelParameters) -> tuple[str, ...]:
    """Return the names that a sweep of a quantity can vary.

    Raises
    ------
    ParameterError
        If the quantity is unknown, or it needs oil films or two bearings and the rotor has none.
    """
    if quantity not in QUANTITIES:
        raise ParameterError(f"quantity: {quantity}, expected one of {', '.join(QUANTITIES)}")
    if QUANTITIES[quantity].needs_films and parameters.bearing is None:
        raise ParameterError(f"quantity: {quantity} needs oil films, expected a rotor with [bearing]")
    parameters.rotor.require_journals()
    return (*PARAMETER_SETTERS, *QUANTITIES[quantity].options)


def _response(parameters: ModelParameters, options: Mapping[str, float]) -> tuple[float, ...]:
    found = synchronous_response(parameters, options["speed_rad_s"])
    vector = complex(found.vectors[0])
    lag = phase_lag_degrees(vector)
    return abs(vector) / MICROMETRE, lag, found.growth_rate, found.whirl_order


def _onset(parameters: ModelParameters, options: Mapping[str, float]) -> tuple[float, ...]:
    low, high, count = options["lowest_speed_rad_s"], options["highest_speed_rad_s"], int(options["speeds"])
    found = stability(parameters, np.linspace(low, high, count))
    largest = float(np.nanmax(found.growth_rates)) if np.any(np.isfinite(found.growth_rates)) else math.nan
    film_onsets = found.onset(FilmName.INNER), found.onset(FilmName.OUTER)
    order = found.bands[0].order if found.bands else math.nan
    return min(film_onsets, key=lambda onset: (math.isnan(onset), onset)), order, *film_onsets, largest


def _whirl(parameters: ModelParameters, options: Mapping[str, float]) -> tuple[float, ...]:
    low, high, count = options["lowest_speed_rad_s"], options["highest_speed_rad_s"], int(options["speeds"])
    speeds, settle, turns = np.linspace(low, high, count), int(options["settle_turns"]), int(options["turns"])
    found = run_up(parameters, speeds, settle, turns, perturbation=options["perturbation_um"] * MICROMETRE)
    largest = float(np.nanmax(found.peak_to_peak)) if np.any(np.isfinite(found.peak_to_peak)) else math.nan
    return found.onset(FilmName.INNER), found.onset(FilmName.OUTER), largest / MICROMETRE


def _critical(parameters: ModelParameters, options: Mapping[str, float]) -> tuple[float, ...]:
    springs = journal_springs(parameters.rotor, options["stiffness_n_m"])
    found = critical_speeds(linear_system(parameters.rotor, springs), options["highest_speed_rad_s"])
    first = [speeds[0] if speeds else math.nan for speeds in (found.forward, found.reverse)]
    return *first, float(len(found.forward)), float(len(found.reverse))


QUANTITIES: Final[dict[str, Quantity]] = {
    "response": Quantity(
        "1X at probe x and least stable whirl at a speed, without weight",
        {"speed_rad_s": 1000.0},
        ("amplitude_um_pk", "lag_deg", "growth_rate_1_s", "whirl_order"),
        _response,
    ),
    "onset": Quantity(
        "onset of instability of the synchronous motion, and of the whirl of each film, by eigenvalues",
        _RANGE,
        ("onset_rad_s", "whirl_order", "inner_onset_rad_s", "outer_onset_rad_s", "largest_growth_rate_1_s"),
        _onset,
    ),
    "whirl": Quantity(
        "onset of the whirl of each film in a run-up in time, and largest overall vibration",
        {**_RANGE, "settle_turns": 40.0, "turns": 64.0, "perturbation_um": DEFAULT_PERTURBATION / MICROMETRE},
        ("inner_onset_rad_s", "outer_onset_rad_s", "largest_um_pp"),
        _whirl,
    ),
    "critical": Quantity(
        "critical speeds on springs",
        {"stiffness_n_m": 1e4, "highest_speed_rad_s": 8000.0},
        ("first_forward_rad_s", "first_reverse_rad_s", "forward", "reverse"),
        _critical,
        needs_films=False,
    ),
}
