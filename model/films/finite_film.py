"""Finite-volume solution of a film of finite length with the Reynolds cavitation condition.

The film cavitates instead of carrying tension: the pressure is never negative, and its gradient is zero at the rupture.
This is a linear complementarity problem: ``p >= 0``, outflow ``M p + b >= 0``, and one of both is 0 in every volume.
The full-film volumes are found by an active-set iteration with sparse linear systems. M is an M-matrix, so a few
iterations suffice. The result is the reference for the closed forms.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from analysis.signals.units import MICROMETRE
from model.errors import EquilibriumError
from model.films.film import Film
from model.films.grid import Flow, Grid

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MAX_ITERATIONS = 100
MIN_NODES_IN_GAP = 4  # from the thinnest position to the one where the film is twice as thick
ROUNDING_TOLERANCE = 1e-13  # of the largest outflow


@dataclass(frozen=True, slots=True)
class Groove:
    """An axial groove over the full length, at a given pressure.

    Parameters
    ----------
    angle : float
        From +X in the direction of rotation, rad. The grid is rotated so that a node lies on it.
    pressure : float
        Pa, 0 or more.

    Raises
    ------
    ValueError
        If a value is invalid.
    """

    angle: float
    pressure: float

    def __post_init__(self) -> None:
        if not math.isfinite(self.angle):
            raise ValueError(f"angle: {self.angle} rad, expected a finite angle")
        if not (math.isfinite(self.pressure) and self.pressure >= 0):
            raise ValueError(f"pressure: {self.pressure:g} Pa, expected a finite value, 0 or more")


@dataclass(frozen=True, slots=True)
class FilmPressure:
    """The pressure in a film of finite length.

    Parameters
    ----------
    grid : Grid
        Nodes: `grid.angles` in the circumference, from the middle to the end in the axial direction.
    pressure : ndarray, shape (grid.along + 1, grid.around)
        Pa.
    is_full_film : ndarray of bool, shape (grid.along, grid.around)
        Volumes with a full film; the others cavitate or are the groove.
    force : complex
        On the inner body, X + i Y, N.
    iterations : int
        Number of linear systems solved.
    """

    grid: Grid
    pressure: FloatArray
    is_full_film: BoolArray
    force: complex
    iterations: int


def solve_reynolds(
    film: Film,
    position: complex,
    velocity: complex,
    surface_speed: float,
    grid: Grid,
    *,
    groove: Groove | None = None,
    flow: Flow = Flow.BOTH,
    cavitates: bool = True,
) -> FilmPressure:
    """Return the pressure in a film of finite length, with zero pressure at both ends.

    Parameters
    ----------
    film : Film
        Sizes and viscosity.
    position, velocity : complex
        Of the inner body relative to the outer one, X + i Y, m and m/s.
    surface_speed : float
        Sum of the angular speeds of both surfaces, rad/s.
    grid : Grid
        Grid of the film.
    groove : Groove, optional
        Oil supply.
    flow : Flow, optional
        Directions of the pressure-driven flow.
    cavitates : bool, optional
        Whether the film cavitates; if not, its pressure may be negative.

    Returns
    -------
    FilmPressure

    Raises
    ------
    ValueError
        If the position is at or beyond the wall, or a value is not finite.
    EquilibriumError
        If the full-film set does not converge.
    """
    if groove is not None:
        grid = replace(grid, first_angle=groove.angle)
    if not math.isfinite(surface_speed):
        raise ValueError(f"surface_speed: {surface_speed} rad/s, expected a finite value")
    _require_inside(film, position)
    _require_resolved(abs(position) / film.clearance, grid)
    unit = pressure_unit(film)
    levels = _coarse_to_fine(grid) if cavitates else [grid]
    is_full_film = np.ones((levels[0].along, levels[0].around), dtype=np.bool_)
    solution, iterations = np.zeros(0), 0
    for level in levels:
        h_faces, h_nodes, squeeze = thickness(film, position, velocity, level)
        matrix = level.flow_matrix(h_nodes**3, h_faces**3, slenderness(film), flow)
        source = level.surface_flow(surface_speed * h_faces, squeeze)
        given = np.zeros((level.along, level.around))
        free = np.ones(given.shape, dtype=np.bool_)
        if groove is not None:
            free[:, 0], given[:, 0] = False, groove.pressure / unit
        first = free & _refined(is_full_film, level)
        volumes = Volumes(matrix, source, given.ravel(), free.ravel())
        solution, found, spent = _full_film_pressure(volumes, first.ravel(), cavitates=cavitates)
        is_full_film, iterations = found.reshape(free.shape), iterations + spent
    rows = np.vstack([solution.reshape(grid.along, grid.around), np.zeros(grid.around)])
    force = -unit * film.radius * film.length * grid.resultant(solution)
    return FilmPressure(grid, unit * rows, is_full_film, force, iterations)


def _coarse_to_fine(grid: Grid) -> list[Grid]:
    # The full-film set grows by one volume per iteration: start it on coarser grids.
    grids = [grid]
    while grids[-1].around % 4 == 0 and grids[-1].around >= 32:
        last = grids[-1]
        along = last.along // 2 if last.along % 4 == 0 else last.along
        grids.append(replace(last, around=last.around // 2, along=along))
    return grids[::-1]


def _refined(is_full_film: BoolArray, grid: Grid) -> BoolArray:
    # The full-film set of a coarser grid: each node becomes itself and its next neighbour.
    along = np.repeat(is_full_film, grid.along // is_full_film.shape[0], axis=0)
    return np.repeat(along, grid.around // is_full_film.shape[1], axis=1)


def thickness(
    film: Film, position: complex, velocity: complex, grid: Grid
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the film thickness at faces and at nodes, clearances, and its rate at nodes, clearances/s.

    Raises
    ------
    ValueError
        If the position is at or beyond the wall or the velocity is not finite.
    """
    _require_inside(film, position)
    if not np.isfinite(velocity):
        raise ValueError(f"velocity: {velocity} m/s, expected a finite value")
    z, v = position / film.clearance, velocity / film.clearance
    at_faces = 1 - (z * np.exp(-1j * grid.faces)).real
    at_nodes = 1 - (z * np.exp(-1j * grid.angles)).real
    return at_faces, at_nodes, -(v * np.exp(-1j * grid.angles)).real


def _require_inside(film: Film, position: complex) -> None:
    if not abs(position) < film.clearance:
        raise ValueError(
            f"position: {abs(position) / MICROMETRE:g} µm from the centre, expected less than the clearance of "
            f"{film.clearance / MICROMETRE:g} µm"
        )


def _require_resolved(eccentricity: float, grid: Grid) -> None:
    narrow = math.sqrt(2 * (1 - eccentricity))  # angle over which the thickness doubles from its minimum
    if narrow < MIN_NODES_IN_GAP * grid.width:
        raise ValueError(
            f"around: {grid.around} nodes, expected at least {math.ceil(MIN_NODES_IN_GAP * 2 * math.pi / narrow)} to "
            f"resolve the film at {eccentricity:.6f} of its clearance"
        )


def slenderness(film: Film) -> float:
    """Return the slenderness (2 R / L)² of a film."""
    return (2 * film.radius / film.length) ** 2


def pressure_unit(film: Film) -> float:
    """Return the pressure unit mu R² / C² of a film, Pa s."""
    return film.viscosity * (film.radius / film.clearance) ** 2


class Volumes(NamedTuple):
    """Flow balance of the volumes of a film: the outflow is ``matrix @ pressure + source``.

    Parameters
    ----------
    matrix : csr_array
        Outflow per pressure.
    source : ndarray
        Outflow due to the motion of the surfaces.
    given : ndarray
        Prescribed pressure; 0 elsewhere.
    free : ndarray of bool
        Volumes without prescribed pressure.
    """

    matrix: sparse.csr_array
    source: FloatArray
    given: FloatArray
    free: BoolArray


def _full_film_pressure(volumes: Volumes, first: BoolArray, *, cavitates: bool) -> tuple[FloatArray, BoolArray, int]:
    # Return pressures, full-film volumes and the number of systems solved.
    is_full_film = first
    fixed = volumes.matrix @ volumes.given + volumes.source
    threshold = -ROUNDING_TOLERANCE * float(np.max(np.abs(fixed)))
    for iteration in range(1, MAX_ITERATIONS + 1):
        solution = volumes.given.copy()
        among = np.flatnonzero(is_full_film)
        solution[among] += spsolve(volumes.matrix[among][:, among].tocsc(), -fixed[among])
        if not cavitates:
            return solution, is_full_film, iteration
        outflow = volumes.matrix @ solution + volumes.source
        following = volumes.free & np.where(is_full_film, solution > 0, outflow < threshold)
        if np.array_equal(following, is_full_film):
            return solution, is_full_film, iteration
        is_full_film = following
    raise EquilibriumError(
        f"film pressure: the full-film part of {is_full_film.size} volumes still changes after {MAX_ITERATIONS} "
        "iterations, expected it to converge; use another grid"
    )
