"""Studies of the oil films at rest: by three models over eccentricity, and in their bearing over speed."""

import math

import numpy as np
from numpy.typing import NDArray

from model.errors import EquilibriumError
from model.films.comparison import compare_film_models
from model.films.film import bearing_films
from model.films.grid import Grid
from model.films.lubrication import Lubrication, RingEquilibrium
from model.rotor.parameters import FloatingRing
from model.studies.linear import SPEED_LABEL
from model.studies.study import Plot, Series, Study, Style

FloatArray = NDArray[np.float64]

AXES = ((0, 0, "xx"), (0, 1, "xy"), (1, 0, "yx"), (1, 1, "yy"))


def film_study(bearing: FloatingRing, which: str, speed: float, eccentricities: FloatArray, grid: Grid) -> Study:
    """Return one film's load, attitude and coefficients by the short, the finite and the long film.

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
        Of the film of finite length.
    """
    films = bearing_films(bearing)
    film, ratio = (films.inner, films.inner_speed) if which == "inner" else (films.outer, films.outer_speed)
    found = compare_film_models(film, ratio * speed, eccentricities, grid)
    e = found.eccentricities
    columns: dict[str, FloatArray | tuple[str, ...]] = {
        "eccentricity": e,
        "short_load_n": found.short_load,
        "finite_load_n": found.finite_load,
        "long_load_n": found.long_load,
        "short_attitude_deg": np.degrees(found.short_attitude),
        "finite_attitude_deg": np.degrees(found.finite_attitude),
        "long_attitude_deg": np.degrees(found.long_attitude),
    }
    stiffness = np.array([one.stiffness for one in found.finite_coefficients])
    damping = np.array([one.damping for one in found.finite_coefficients])
    for row, column, name in AXES:
        columns[f"stiffness_{name}_n_m"] = stiffness[:, row, column]
    for row, column, name in AXES:
        columns[f"damping_{name}_n_s_m"] = damping[:, row, column]
    models = ("infinitely short", "of its length", "infinitely long")
    loads = (found.short_load, found.finite_load, found.long_load)
    attitudes = (found.short_attitude, found.finite_attitude, found.long_attitude)
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
        ("short and finite film: cavity where the pressure would fall below 0 (half film; Reynolds's condition)",),
    )


def _coefficients(quantity: str, letter: str, unit: str, e: FloatArray, values: FloatArray) -> Plot:
    """Return coefficients over eccentricity; they change their size by decades, and some their sign."""
    series = []
    for row, column, name in AXES:
        value = values[:, row, column]
        turned_up = Style.DOTTED if name == "yx" else Style.DASHED  # c_xy and c_yx are equal
        series.append(Series(f"{letter}_{name}", e, np.where(value > 0, value, np.nan)))
        series.append(Series(f"−{letter}_{name}", e, np.where(value < 0, -value, np.nan), turned_up))
    shown = tuple(one for one in series if np.any(np.isfinite(one.y)))
    title = f"{quantity} of the film of its length, load downwards"
    return Plot(title, "Eccentricity ratio [–]", f"{quantity} [{unit}]", shown, y_log=True)


def lubrication_study(lubrication: Lubrication, load: float, inlet_pressure: float, speeds: FloatArray) -> Study:
    """Return where journal and ring run at rest over speed, their cavities, and the pressures at the last speed.

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
        Where no film carries the load at any speed.
    """
    rests, missing = _rests(lubrication, load, inlet_pressure, speeds)
    films = {
        "inner": [None if rest is None else rest.inner for rest in rests],
        "outer": [None if rest is None else rest.outer for rest in rests],
    }
    columns: dict[str, FloatArray | tuple[str, ...]] = {"speed_rad_s": speeds}
    for name, found in films.items():
        columns[f"{name}_eccentricity"] = np.array([math.nan if one is None else one.eccentricity for one in found])
        columns[f"{name}_attitude_deg"] = np.array(
            [math.nan if one is None else math.degrees(one.attitude) for one in found]
        )
        ruptures = [None if one is None else one.rupture for one in found]
        columns[f"{name}_rupture_deg"] = np.array([math.nan if r is None else math.degrees(r) for r in ruptures])
    columns["scaled_flow_kg_s"] = np.array([math.nan if rest is None else rest.mean_flow() for rest in rests])
    title = f"Journal and ring at rest, {load:g} N, {inlet_pressure / 1e5:g} bar"
    last_speed, last = next(
        (speed, rest) for speed, rest in zip(reversed(speeds), reversed(rests), strict=True) if rest is not None
    )
    psi = np.arange(0.0, 360.0)
    numbers = {name: column for name, column in columns.items() if not isinstance(column, tuple)}

    def over_speed(quantity: str, label: str, limits: tuple[float, float] | None = None) -> Plot:
        styles = (Style.LINE, Style.DASHED)  # so that equal curves can be told apart
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
                "Place from the top in the direction of rotation [°]",
                "Pressure [bar]",
                pressures,
                x_limits=(0.0, 360.0),
            ),
        ),
        (
            "infinitely long films, their cavities from the named angle on (none: complete film)",
            "flow is known up to a factor that the thesis does not give: compare, do not use it as kg/s",
            *(() if missing is None else (f"{rests.count(None)} of {speeds.size} speeds are left out: {missing}",)),
        ),
    )


def _rests(
    lubrication: Lubrication, load: float, inlet_pressure: float, speeds: FloatArray
) -> tuple[list[RingEquilibrium | None], EquilibriumError | None]:
    """Return the equilibrium at each speed, None where there is none, and why the last of these has none."""
    rests: list[RingEquilibrium | None] = []
    missing: EquilibriumError | None = None
    for speed in speeds:
        try:
            rests.append(lubrication.equilibrium(load, float(speed), inlet_pressure))
        except EquilibriumError as error:
            rests.append(None)
            missing = error
    if missing is not None and not any(rests):
        raise missing
    return rests, missing
