"""Linear coefficients and equilibrium of a film of finite length, by perturbation: (4.22)-(4.35)."""

from dataclasses import replace

import numpy as np
from scipy.sparse.linalg import splu

from model.errors import EquilibriumError
from model.films.coefficients import LinearCoefficients, short_film_coefficients
from model.films.film import Film
from model.films.finite_film import pressure_unit, slenderness, solve_reynolds, thickness
from model.films.grid import Flow, Grid
from model.rotor.parameters import FilmModel


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
    ValueError
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
    ValueError
        If load or speed is not positive, or the grid is too coarse for the eccentricity under this load.
    EquilibriumError
        If Newton's method does not converge within the clearance.
    """
    cavitated = replace(film, model=FilmModel.CAPONE)  # as the film of finite length
    position = short_film_coefficients(cavitated, load, surface_speed).position
    for _ in range(max_steps):
        found = perturbed_coefficients(film, position, surface_speed, grid)
        missing = found.force - 1j * load
        if abs(missing) < 1e-9 * load:
            return found
        step = np.linalg.solve(found.stiffness, [missing.real, missing.imag])
        move = complex(step[0], step[1])
        gap = film.clearance - abs(position)
        position += move * min(1.0, 0.5 * gap / abs(move))
    raise EquilibriumError(
        f"load: {load:g} N is not balanced after {max_steps} steps ({abs(missing):g} N missing at "
        f"{abs(position) / film.clearance:.6f} of the clearance), expected at most {1e-9 * load:g} N"
    )
