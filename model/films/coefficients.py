"""The eight linear coefficients of an oil film (thesis, section 4.3.1): short, of finite length, and two in series.

Sign convention: ``F = F0 - K dx - C dx'``, with rows for X and Y of the force and columns for X and Y of the
displacement. The thesis writes (4.20) with the opposite sign and (4.28)-(4.35) with this one. Closed forms hold for a
downward load (-Y) and counter-clockwise rotation.
"""

import math
from dataclasses import dataclass, replace
from typing import assert_never

import numpy as np
from scipy.optimize import brentq
from scipy.sparse.linalg import splu

from analysis.signals import ComplexArray, FloatArray
from model.errors import EquilibriumError, ParameterError
from model.films.film import Film, bearing_films
from model.films.film_kernels import FORCE_LAWS, film_force, film_slopes
from model.films.finite_film import Flow, Grid, pressure_unit, slenderness, solve_reynolds, thickness
from model.rotor.parameters import GRAVITY, FilmModel, FloatingRing
from model.rotor.rotor import require_positive

MAX_ECCENTRICITY = 1 - 1e-6


@dataclass(frozen=True, slots=True)
class LinearCoefficients:
    """Linear coefficients of a film about an equilibrium position.

    Parameters
    ----------
    position : complex
        Of the inner body relative to the outer one, X + i Y, m.
    force : complex
        Static force of the film on the inner body, X + i Y, N.
    stiffness : ndarray, shape (2, 2)
        k_xx, k_xy; k_yx, k_yy, N/m.
    damping : ndarray, shape (2, 2)
        c_xx, c_xy; c_yx, c_yy, N s/m.
    """

    position: complex
    force: complex
    stiffness: FloatArray
    damping: FloatArray

    def impedance(self, whirl_speed: float) -> ComplexArray:
        """Return the impedance K + i omega C at a whirl frequency in rad/s, N/m, shape (2, 2)."""
        return np.asarray(self.stiffness + 1j * whirl_speed * self.damping)


def short_film_ratios(eccentricity: float, model: FilmModel = FilmModel.CAPONE) -> tuple[FloatArray, FloatArray]:
    """Return the dimensionless coefficients of the infinitely short film.

    Parameters
    ----------
    eccentricity : float
        Ratio, above 0 and below 1.
    model : FilmModel, optional
        Force law.

    Returns
    -------
    tuple of ndarray, shape (2, 2)
        Stiffness over W / C and damping over W / (C w), with load W and sum w of the surface speeds; with cavity from
        Friswell et al., Dynamics of Rotating Machines, section 5.5.

    Raises
    ------
    ParameterError
        If the eccentricity lies outside its range.
    """
    _require_inside(eccentricity)
    match model:
        case FilmModel.CAPONE:
            return _capone_ratios(eccentricity)
        case FilmModel.FULL_SOMMERFELD:
            e = eccentricity
            steep = (1 + 2 * e**2) / (e * (1 - e**2))
            return np.array([[0.0, 1 / e], [-steep, 0.0]]), np.array([[2 * steep, 0.0], [0.0, 2 / e]])
        case _:
            assert_never(model)


def _capone_ratios(e: float) -> tuple[FloatArray, FloatArray]:
    """Return stiffness and damping of the cavitated film at an eccentricity; see `short_film_ratios`."""
    pi, s = math.pi, math.sqrt(1 - e**2)
    h0 = (pi**2 * (1 - e**2) + 16 * e**2) ** -1.5
    a_xx = 4 * h0 * (pi**2 * (2 - e**2) + 16 * e**2)
    a_xy = pi * h0 * (pi**2 * (1 - e**2) ** 2 - 16 * e**4) / (e * s)
    a_yx = -pi * h0 * (pi**2 * (1 - e**2) * (1 + 2 * e**2) + 32 * e**2 * (1 + e**2)) / (e * s)
    a_yy = 4 * h0 * (pi**2 * (1 + 2 * e**2) + 32 * e**2 * (1 + e**2) / (1 - e**2))
    b_xx = 2 * pi * h0 * s * (pi**2 * (1 + 2 * e**2) - 16 * e**2) / e
    b_xy = -8 * h0 * (pi**2 * (1 + 2 * e**2) - 16 * e**2)
    b_yy = 2 * pi * h0 * (pi**2 * (1 - e**2) ** 2 + 48 * e**2) / (e * s)
    return np.array([[a_xx, a_xy], [a_yx, a_yy]]), np.array([[b_xx, b_xy], [b_xy, b_yy]])


def short_film_load(eccentricity: float, model: FilmModel = FilmModel.CAPONE) -> float:
    """Return the static load of the infinitely short film over `Film.factor` times w."""
    _require_inside(eccentricity)
    e = eccentricity
    match model:
        case FilmModel.CAPONE:
            return 4 * e / (1 - e**2) ** 2 * math.sqrt(e**2 + (math.pi / 4) ** 2 * (1 - e**2))
        case FilmModel.FULL_SOMMERFELD:
            return 2 * math.pi * e / math.sqrt(1 - e**2) ** 3
        case _:
            assert_never(model)


def short_film_attitude(eccentricity: float, model: FilmModel = FilmModel.CAPONE) -> float:
    """Return the attitude angle, from the load to the displacement in the direction of rotation, rad."""
    _require_inside(eccentricity)
    match model:
        case FilmModel.CAPONE:
            return math.atan2(math.pi * math.sqrt(1 - eccentricity**2), 4 * eccentricity)
        case FilmModel.FULL_SOMMERFELD:
            return math.pi / 2
        case _:
            assert_never(model)


def short_film_coefficients(film: Film, load: float, surface_speed: float) -> LinearCoefficients:
    """Return the coefficients of the infinitely short film under a load, in closed form.

    Parameters
    ----------
    film : Film
        Sizes, viscosity and film model.
    load : float
        Downwards, N.
    surface_speed : float
        w, the sum of the angular speeds of both surfaces, rad/s.

    Returns
    -------
    LinearCoefficients

    Raises
    ------
    ParameterError
        If load or speed is not positive.
    EquilibriumError
        If the load presses the inner body against the wall.
    """
    require_positive("load", load, "N")
    require_positive("surface_speed", surface_speed, "rad/s")
    target = load / (film.factor * surface_speed)
    maximum = short_film_load(MAX_ECCENTRICITY, film.model)
    if target >= maximum:
        raise EquilibriumError(
            f"load: {load:g} N presses the inner body to {MAX_ECCENTRICITY} of its clearance, expected less than "
            f"{maximum * film.factor * surface_speed:g} N"
        )
    lightest = (
        1e-3 * target / math.pi
    )  # the load is pi (2 pi without cavity) times a small eccentricity, and grows faster
    eccentricity = brentq(
        lambda e: short_film_load(e, film.model) - target, min(lightest, 0.5), MAX_ECCENTRICITY, xtol=1e-15
    )
    stiffness, damping = short_film_ratios(eccentricity, film.model)
    angle = short_film_attitude(eccentricity, film.model) - math.pi / 2
    position = eccentricity * film.clearance * complex(math.cos(angle), math.sin(angle))
    unit = load / film.clearance
    return LinearCoefficients(position, complex(0.0, load), unit * stiffness, unit / surface_speed * damping)


def differentiated_coefficients(film: Film, position: complex, surface_speed: float) -> LinearCoefficients:
    """Return the coefficients of a short film at rest: the exact derivatives of its force.

    Parameters
    ----------
    film : Film
        Sizes, viscosity and film model.
    position : complex
        Of the inner body relative to the outer one, X + i Y, m; not the centre, where a static film has no force.
    surface_speed : float
        w, rad/s.

    Returns
    -------
    LinearCoefficients

    Raises
    ------
    ParameterError
        If the position is the centre or at or beyond the wall, or the speed is 0.
    """
    _require_inside(abs(position) / film.clearance)
    if not (math.isfinite(surface_speed) and surface_speed != 0):
        raise ParameterError(f"surface_speed: {surface_speed:g} rad/s, expected a finite value other than 0")
    state = (FORCE_LAWS[film.model], complex(position), 0j, film.clearance, float(surface_speed), film.factor)
    at_rest, moving = (np.array(film_slopes(*state, ratio)) for ratio in (0j, complex(surface_speed)))
    stiffness, damping = (np.stack((one.real, one.imag)) for one in (-at_rest, (at_rest - moving) / surface_speed))
    return LinearCoefficients(position, film_force(*state), stiffness, damping)


def series_impedance(
    inner: LinearCoefficients, outer: LinearCoefficients, ring_mass: float, whirl_speed: float
) -> ComplexArray:
    """Return the impedance at the journal of two films in series with the ring mass between them.

    Parameters
    ----------
    inner, outer : LinearCoefficients
        Journal in ring and ring in housing.
    ring_mass : float
        kg.
    whirl_speed : float
        Angular frequency of the whirl, rad/s.

    Returns
    -------
    ndarray of complex, shape (2, 2)
        Resisting force per displacement of the journal, N/m.
    """
    Z_i, Z_o = inner.impedance(whirl_speed), outer.impedance(whirl_speed)
    ring = Z_i + Z_o - ring_mass * whirl_speed**2 * np.eye(2)
    return np.asarray(Z_i - Z_i @ np.linalg.solve(ring, Z_i))


def floating_ring_coefficients(
    bearing: FloatingRing, load: float, speed: float, gravity: float = GRAVITY
) -> tuple[LinearCoefficients, LinearCoefficients]:
    """Return the coefficients of both short films of a floating-ring bearing, with the ring speed of (3.25).

    Parameters
    ----------
    bearing : FloatingRing
        Sizes and viscosity.
    load : float
        On the journal, downwards, N.
    speed : float
        Of the shaft, rad/s.
    gravity : float, optional
        m/s²; the outer film also carries the weight of the ring.

    Returns
    -------
    tuple of LinearCoefficients
        Inner and outer film.
    """
    films = bearing_films(bearing)
    return (
        short_film_coefficients(films.inner, load, films.inner_speed * speed),
        short_film_coefficients(films.outer, load + bearing.ring_mass * gravity, films.outer_speed * speed),
    )


def _require_inside(eccentricity: float) -> None:
    if not 0 < eccentricity < 1:
        raise ParameterError(
            f"eccentricity: {eccentricity:g} of the clearance, expected above 0 and below 1 (the wall)"
        )


def perturbed_coefficients(
    film: Film, position: complex, surface_speed: float, grid: Grid, flow: Flow = Flow.BOTH
) -> LinearCoefficients:
    """Return the coefficients of a film of finite length, by perturbation including the axial flow.

    The flow balances of the volumes are differentiated: this is (4.24)-(4.27) before the static Reynolds equation is
    inserted. The thesis prints the circumferential part only, that is, an infinitely long film.

    Parameters
    ----------
    film, position, surface_speed : Film, complex and float
        As for `model.films.coefficients.differentiated_coefficients`.
    grid : Grid
        Grid of the film.
    flow : Flow, optional
        Directions of the pressure-driven flow.

    Returns
    -------
    LinearCoefficients

    Raises
    ------
    ParameterError
        If the position is at or beyond the wall.
    EquilibriumError
        If the static film does not converge.
    """
    rest = solve_reynolds(film, position, 0j, surface_speed, grid, flow=flow)
    unit = pressure_unit(film)
    h_faces, h_nodes, _ = thickness(film, position, 0j, grid)
    slender = slenderness(film)
    pressure = rest.pressure[:-1].ravel() / unit
    full_film = np.flatnonzero(rest.is_full_film)
    stiffness, damping = np.zeros((2, 2)), np.zeros((2, 2))
    if full_film.size:
        matrix = grid.flow_matrix(h_nodes**3, h_faces**3, slender, flow)
        solver = splu(matrix[full_film][:, full_film].tocsc())
        still = np.zeros(grid.around)
        scale = unit * film.radius * film.length / film.clearance
        for column, direction in enumerate((np.cos, np.sin)):
            at_faces, at_nodes = -direction(grid.faces), -direction(grid.angles)  # Eq. (4.22), theta from +X
            thicker = grid.flow_matrix(3 * h_nodes**2 * at_nodes, 3 * h_faces**2 * at_faces, slender, flow)
            moved = thicker @ pressure + grid.surface_flow(surface_speed * at_faces, still)  # Eqs. (4.24), (4.25)
            moving = grid.surface_flow(still, at_nodes)  # Eqs. (4.26), (4.27)
            for source, coefficients in ((moved, stiffness), (moving, damping)):
                change = np.zeros(pressure.size)
                change[full_film] = solver.solve(-source[full_film])
                resultant = scale * grid.resultant(change)  # Eqs. (4.28)-(4.35)
                coefficients[:, column] = resultant.real, resultant.imag
    return LinearCoefficients(position, rest.force, stiffness, damping)


def finite_film_equilibrium(
    film: Film, load: float, surface_speed: float, grid: Grid, max_steps: int = 30
) -> LinearCoefficients:
    """Return the equilibrium of a film of finite length under a load, and its coefficients there.

    Parameters
    ----------
    film, load, surface_speed : Film, float and float
        As for `model.films.coefficients.short_film_coefficients`.
    grid : Grid
        Grid of the film.
    max_steps : int
        Maximum number of Newton steps.

    Returns
    -------
    LinearCoefficients

    Raises
    ------
    ParameterError
        If load or speed is not positive, or the grid is too coarse for the eccentricity under this load.
    EquilibriumError
        If Newton's method does not converge within the clearance.
    """
    cavitated = replace(film, model=FilmModel.CAPONE)  # as the film of finite length
    position = short_film_coefficients(cavitated, load, surface_speed).position
    for _ in range(max_steps):
        coefficients = perturbed_coefficients(film, position, surface_speed, grid)
        missing = coefficients.force - 1j * load
        if abs(missing) < 1e-9 * load:
            return coefficients
        step = np.linalg.solve(coefficients.stiffness, [missing.real, missing.imag])
        move = complex(step[0], step[1])
        gap = film.clearance - abs(position)
        position += move * min(1.0, 0.5 * gap / abs(move))
    raise EquilibriumError(
        f"load: {load:g} N is not balanced after {max_steps} steps ({abs(missing):g} N missing at "
        f"{abs(position) / film.clearance:.6f} of the clearance), expected at most {1e-9 * load:g} N"
    )
