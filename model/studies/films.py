"""Studies of the static oil films: three film models over eccentricity; bearing equilibrium over speed."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from analysis.signals import FloatArray
from model.errors import EquilibriumError
from model.films.coefficients import LinearCoefficients, differentiated_coefficients, perturbed_coefficients
from model.films.film import Film, bearing_films
from model.films.finite_film import Grid
from model.films.long_film import LongFilm, ruptured_film
from model.films.lubrication import Lubrication, RingEquilibrium
from model.rotor.parameters import FilmModel, FloatingRing
from model.rotor.rotor import require_positive
from model.studies.linear_studies import SPEED_LABEL
from model.studies.study import Plot, Series, Study, Style

CAVITY_NOTES = {
    FilmModel.CAPONE: "short and finite film cavitate at zero pressure (half film; Reynolds condition)",
    FilmModel.FULL_SOMMERFELD: "the finite film cavitates (Reynolds condition), the short film does not",
}
AXES = ((0, 0, "xx"), (0, 1, "xy"), (1, 0, "yx"), (1, 1, "yy"))


@dataclass(frozen=True, slots=True)
class FilmComparison:
    """Static results of three film models over eccentricity.

    Parameters
    ----------
    eccentricities : ndarray, shape (n,)
        Ratios.
    short_load, finite_load, long_load : ndarray, shape (n,)
        Of the infinitely short film, the film of finite length and the infinitely long film, N.
    short_attitude, finite_attitude, long_attitude : ndarray, shape (n,)
        Angle from the load to the displacement in the direction of rotation, rad.
    short_coefficients, finite_coefficients : tuple of LinearCoefficients, length n
        For a downward load.
    """

    eccentricities: FloatArray
    short_load: FloatArray
    finite_load: FloatArray
    long_load: FloatArray
    short_attitude: FloatArray
    finite_attitude: FloatArray
    long_attitude: FloatArray
    short_coefficients: tuple[LinearCoefficients, ...]
    finite_coefficients: tuple[LinearCoefficients, ...]


def compare_film_models(film: Film, surface_speed: float, eccentricities: ArrayLike, grid: Grid) -> FilmComparison:
    """Return load, attitude and coefficients of a film by the short, finite and long model.

    Parameters
    ----------
    film : Film
        Sizes, viscosity and model of the short film.
    surface_speed : float
        Sum of the angular speeds of both surfaces, rad/s.
    eccentricities : array_like, shape (n,)
        Ratios, above 0 and below 1.
    grid : Grid
        Grid of the film of finite length.

    Returns
    -------
    FilmComparison
        The infinitely long film starts with zero pressure at its thickest position, as the others do, at least nearly,
        without a groove.

    Raises
    ------
    ParameterError
        If the speed is not positive, or an eccentricity is outside its range or too close to the wall for the grid.
    """
    require_positive("surface_speed", surface_speed, "rad/s")
    ratios = np.atleast_1d(np.asarray(eccentricities, dtype=np.float64))
    if ratios.ndim != 1:
        raise ValueError(f"eccentricities: shape {ratios.shape}, expected (n,)")
    longs = [film_from_thickest(float(ratio)) for ratio in ratios]
    shorts = [_upright_short(film, float(ratio), surface_speed) for ratio in ratios]
    finites = [_upright_finite(film, float(ratio), surface_speed, grid) for ratio in ratios]
    unit = 6 * film.viscosity * (film.radius / film.clearance) ** 2 * surface_speed * film.length * film.radius
    return FilmComparison(
        eccentricities=ratios,
        short_load=np.array([abs(one.force) for one in shorts]),
        finite_load=np.array([abs(one.force) for one in finites]),
        long_load=unit * np.array([one.load for one in longs]),
        short_attitude=np.array([_attitude(one) for one in shorts]),
        finite_attitude=np.array([_attitude(one) for one in finites]),
        long_attitude=np.array([one.attitude for one in longs]),
        short_coefficients=tuple(shorts),
        finite_coefficients=tuple(finites),
    )


def film_from_thickest(eccentricity: float) -> LongFilm:
    """Return the infinitely long film that starts with zero pressure at its thickest position: (3.20), (3.21).

    Parameters
    ----------
    eccentricity : float
        Ratio, above 0 and below 1.
    """
    extent = brentq(lambda extent: ruptured_film(eccentricity, extent).start, 0.1, 1.0, xtol=1e-14)
    return ruptured_film(eccentricity, float(extent))


def _upright_short(film: Film, ratio: float, surface_speed: float) -> LinearCoefficients:
    flat = differentiated_coefficients(film, complex(ratio * film.clearance), surface_speed)
    return differentiated_coefficients(film, _upright_position(flat), surface_speed)


def _upright_finite(film: Film, ratio: float, surface_speed: float, grid: Grid) -> LinearCoefficients:
    flat = perturbed_coefficients(film, complex(ratio * film.clearance), surface_speed, grid)
    return _rotate(flat, _upright_position(flat) / flat.position)


def _upright_position(coefficients: LinearCoefficients) -> complex:
    # the position, rotated so that the film force points up
    return coefficients.position * 1j * abs(coefficients.force) / coefficients.force


def _rotate(coefficients: LinearCoefficients, rotation_factor: complex) -> LinearCoefficients:
    rotation = np.array([[rotation_factor.real, -rotation_factor.imag], [rotation_factor.imag, rotation_factor.real]])
    return LinearCoefficients(
        coefficients.position * rotation_factor,
        coefficients.force * rotation_factor,
        rotation @ coefficients.stiffness @ rotation.T,
        rotation @ coefficients.damping @ rotation.T,
    )


def _attitude(coefficients: LinearCoefficients) -> float:
    # the load points down
    return math.atan2(coefficients.position.real, -coefficients.position.imag)


def film_study(bearing: FloatingRing, which: str, speed: float, eccentricities: FloatArray, grid: Grid) -> Study:
    """Return load, attitude and coefficients of one film by the short, finite and long film model.

    Parameters
    ----------
    bearing : FloatingRing
        Sizes and viscosity.
    which : str
        "inner" or "outer".
    speed : float
        Of the shaft, rad/s.
    eccentricities : ndarray of float64, shape (n,)
        Ratios.
    grid : Grid
        Grid of the film of finite length.
    """
    films = bearing_films(bearing)
    film, ratio = (films.inner, films.inner_speed) if which == "inner" else (films.outer, films.outer_speed)
    comparison = compare_film_models(film, ratio * speed, eccentricities, grid)
    e = comparison.eccentricities
    columns: dict[str, FloatArray | tuple[str, ...]] = {
        "eccentricity": e,
        "short_load_n": comparison.short_load,
        "finite_load_n": comparison.finite_load,
        "long_load_n": comparison.long_load,
        "short_attitude_deg": np.degrees(comparison.short_attitude),
        "finite_attitude_deg": np.degrees(comparison.finite_attitude),
        "long_attitude_deg": np.degrees(comparison.long_attitude),
    }
    stiffness = np.array([one.stiffness for one in comparison.finite_coefficients])
    damping = np.array([one.damping for one in comparison.finite_coefficients])
    for row, column, name in AXES:
        columns[f"stiffness_{name}_n_m"] = stiffness[:, row, column]
    for row, column, name in AXES:
        columns[f"damping_{name}_n_s_m"] = damping[:, row, column]
    models = ("infinitely short", "finite length", "infinitely long")
    loads = (comparison.short_load, comparison.finite_load, comparison.long_load)
    attitudes = (comparison.short_attitude, comparison.finite_attitude, comparison.long_attitude)
    title = f"The {which} film at {speed:,.0f} rad/s"
    label = "Eccentricity ratio [–]"
    return Study(
        title,
        columns,
        (
            Plot(
                f"{title}: load",
                label,
                "Load [N]",
                tuple(Series(name, e, load) for name, load in zip(models, loads, strict=True)),
                y_log=True,
            ),
            Plot(
                "Attitude",
                label,
                "Attitude [°]",
                tuple(Series(m, e, np.degrees(a)) for m, a in zip(models, attitudes, strict=True)),
                y_limits=(0.0, 90.0),
            ),
            _coefficients("Stiffness", "k", "N/m", e, stiffness),
            _coefficients("Damping", "c", "N s/m", e, damping),
        ),
        (CAVITY_NOTES[bearing.film_model],),
    )


def _coefficients(quantity: str, letter: str, unit: str, e: FloatArray, values: FloatArray) -> Plot:
    """Return a plot of coefficients over eccentricity on a logarithmic axis, negative values dashed or dotted."""
    series = []
    for row, column, name in AXES:
        value = values[:, row, column]
        negative_style = Style.DOTTED if name == "yx" else Style.DASHED  # c_xy and c_yx are equal
        series.append(Series(f"{letter}_{name}", e, np.where(value > 0, value, np.nan)))
        series.append(Series(f"−{letter}_{name}", e, np.where(value < 0, -value, np.nan), negative_style))
    finite = tuple(one for one in series if np.any(np.isfinite(one.y)))
    title = f"{quantity} of the film of finite length, load downwards"
    return Plot(title, "Eccentricity ratio [–]", f"{quantity} [{unit}]", finite, y_log=True)


def lubrication_study(lubrication: Lubrication, load: float, inlet_pressure: float, speeds: FloatArray) -> Study:
    """Return equilibrium and cavities of journal and ring over speed, and the pressures at the last speed.

    Parameters
    ----------
    lubrication : Lubrication
        Bearing and calibration.
    load : float
        On the journal, downwards, N.
    inlet_pressure : float
        Pa.
    speeds : ndarray of float64, shape (n,)
        Of the shaft, rad/s.

    Raises
    ------
    EquilibriumError
        If no film carries the load at any speed.
    """
    equilibria, missing = _equilibria(lubrication, load, inlet_pressure, speeds)
    films = {
        "inner": [None if equilibrium is None else equilibrium.inner for equilibrium in equilibria],
        "outer": [None if equilibrium is None else equilibrium.outer for equilibrium in equilibria],
    }
    columns: dict[str, FloatArray | tuple[str, ...]] = {"speed_rad_s": speeds}
    for name, of_film in films.items():
        columns[f"{name}_eccentricity"] = np.array([math.nan if one is None else one.eccentricity for one in of_film])
        columns[f"{name}_attitude_deg"] = np.array(
            [math.nan if one is None else math.degrees(one.attitude) for one in of_film]
        )
        ruptures = [None if one is None else one.rupture for one in of_film]
        columns[f"{name}_rupture_deg"] = np.array([math.nan if r is None else math.degrees(r) for r in ruptures])
    columns["scaled_flow_kg_s"] = np.array(
        [math.nan if equilibrium is None else equilibrium.mean_flow() for equilibrium in equilibria]
    )
    title = f"Equilibrium of journal and ring, {load:g} N, {inlet_pressure / 1e5:g} bar"
    last_speed, last = next(
        (speed, equilibrium)
        for speed, equilibrium in zip(reversed(speeds), reversed(equilibria), strict=True)
        if equilibrium is not None
    )
    psi = np.arange(0.0, 360.0)
    numbers = {name: column for name, column in columns.items() if not isinstance(column, tuple)}

    def over_speed(quantity: str, label: str, limits: tuple[float, float] | None = None) -> Plot:
        styles = (Style.LINE, Style.DASHED)  # to distinguish equal curves
        lines = tuple(
            Series(f"{name} film", speeds, numbers[f"{name}_{quantity}"], style)
            for name, style in zip(films, styles, strict=True)
        )
        return Plot(title if quantity == "eccentricity" else "", SPEED_LABEL, label, lines, y_limits=limits)

    pressures = tuple(
        Series(f"{name} film", psi, np.asarray(film.pressure(np.radians(psi)) / 1e5))
        for name, film in (("inner", last.inner), ("outer", last.outer))
    )
    return Study(
        title,
        columns,
        (
            over_speed("eccentricity", "Eccentricity ratio [–]"),
            over_speed("attitude_deg", "Attitude [°]", (0.0, 100.0)),
            Plot(
                f"Pressure at {last_speed:,.0f} rad/s",
                "Angle from the top in the direction of rotation [°]",
                "Pressure [bar]",
                pressures,
                x_limits=(0.0, 360.0),
            ),
        ),
        (
            "infinitely long films; cavity from the rupture angle on (none: complete film)",
            "flow is known only up to a factor: use it for equilibria, not as kg/s",
            *(() if missing is None else (f"{equilibria.count(None)} of {speeds.size} speeds are omitted: {missing}",)),
        ),
    )


def _equilibria(
    lubrication: Lubrication, load: float, inlet_pressure: float, speeds: FloatArray
) -> tuple[list[RingEquilibrium | None], EquilibriumError | None]:
    """Return the equilibrium at each speed, None without one, and the error of the last speed without one."""
    equilibria: list[RingEquilibrium | None] = []
    missing: EquilibriumError | None = None
    for speed in speeds:
        try:
            equilibria.append(lubrication.equilibrium(load, float(speed), inlet_pressure))
        except EquilibriumError as error:
            equilibria.append(None)
            missing = error
    if missing is not None and not any(equilibria):
        raise missing
    return equilibria, missing
