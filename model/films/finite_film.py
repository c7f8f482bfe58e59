"""Finite-volume solution of a film of finite length with the Reynolds cavitation condition.

The film is symmetric about its middle, so the grid covers half of its length and the full circumference. With h in
clearances, zeta from the middle (0) to the end (1), p in mu R²/C² and w the sum of both surface speeds, the Reynolds
equation is

    d/dtheta (h³ dp/dtheta) + (2R/L)² d/dzeta (h³ dp/dzeta) = 6 (w dh/dtheta + 2 dh/dt)

The film cavitates instead of carrying tension: the pressure is never negative, and its gradient is zero at the rupture.
This is a linear complementarity problem: ``p >= 0``, outflow ``M p + b >= 0``, and one of both is 0 in every volume.
The full-film volumes are found by an active-set iteration with sparse linear systems. M is an M-matrix, so a few
iterations suffice. The result is the reference for the closed forms.
"""

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from analysis.signals import BoolArray, FloatArray
from analysis.signals.units import MICROMETRE
from model.errors import EquilibriumError, ParameterError
from model.films.film import Film

MAX_ITERATIONS = 100
MIN_NODES_IN_GAP = 4  # from the thinnest position to the one where the film is twice as thick
ROUNDING_TOLERANCE = 1e-13  # of the largest outflow


class Flow(Enum):
    """Directions of the pressure-driven flow."""

    BOTH = "both"
    AXIAL = "axial"
    """Axial flow only: the infinitely short film, for comparison."""


@dataclass(frozen=True, slots=True)
class Grid:
    """Numbers of nodes of a film.

    Parameters
    ----------
    around : int
        Nodes in the circumference, an even number of 8 or more.
    along : int
        Intervals from the middle of the film to its end, an even number of 2 or more.
    first_angle : float
        Angle of the first node, from +X in the direction of rotation, rad.

    Raises
    ------
    ParameterError
        If a number of intervals is odd or too small.
    """

    around: int = 180
    along: int = 12
    first_angle: float = 0.0

    def __post_init__(self) -> None:
        for name, value, minimum in (("around", self.around, 8), ("along", self.along, 2)):
            if value < minimum or value % 2:
                raise ParameterError(f"{name}: {value} intervals, expected an even number, {minimum} or more")
        if not math.isfinite(self.first_angle):
            raise ParameterError(f"first_angle: {self.first_angle} rad, expected a finite angle")

    @property
    def angles(self) -> FloatArray:
        """Angles of the nodes, rad, shape (around,)."""
        return np.asarray(self.first_angle + self.width * np.arange(self.around), dtype=np.float64)

    @property
    def faces(self) -> FloatArray:
        """Angles half-way to the next node, rad, shape (around,)."""
        return self.angles + self.width / 2

    @property
    def width(self) -> float:
        """Angular width of a volume, rad."""
        return 2 * math.pi / self.around

    @property
    def lengths(self) -> FloatArray:
        """Axial lengths of the volumes from the middle on, in half lengths, shape (along,); the first one is halved."""
        lengths = np.full(self.along, 1 / self.along)
        lengths[0] /= 2
        return lengths

    def flow_matrix(
        self, at_nodes: FloatArray, at_faces: FloatArray, slenderness: float, flow: Flow
    ) -> sparse.csr_array:
        """Return the matrix of the outflow of every volume per pressure in every volume.

        Parameters
        ----------
        at_nodes, at_faces : ndarray, shape (around,)
            h³ at the nodes and at the faces between them, or a derivative of it.
        slenderness : float
            (2 R / L)².
        flow : Flow
            Directions of flow.

        Returns
        -------
        csr_array, shape (along * around, along * around)
            Volumes row by row from the middle of the film; the pressure at the end is zero.
        """
        line = np.full(self.along, 2.0)  # links to both neighbours; at the middle to one
        line[0] = 1.0
        beside = np.full(self.along - 1, -1.0)
        chain = sparse.csr_array(np.diag(line) + np.diag(beside, 1) + np.diag(beside, -1))
        total = sparse.kron(chain * (self.along * slenderness), sparse.diags_array(at_nodes * self.width))
        if flow is Flow.BOTH:
            here = np.arange(self.around)
            ahead = sparse.csr_array((np.ones(self.around), (here, (here + 1) % self.around)))
            forward = ahead - sparse.eye_array(self.around)
            ring = forward.T @ sparse.diags_array(at_faces / self.width) @ forward
            total = total + sparse.kron(sparse.diags_array(self.lengths), ring)
        return sparse.csr_array(total)

    def surface_flow(self, wedge: FloatArray, squeeze: FloatArray) -> FloatArray:
        """Return the outflow of every volume due to the motion of the surfaces.

        Parameters
        ----------
        wedge : ndarray, shape (around,)
            w h at the faces.
        squeeze : ndarray, shape (around,)
            dh/dt at the nodes.

        Returns
        -------
        ndarray, shape (along * around,)
        """
        out = 6 * (wedge - np.roll(wedge, 1)) + 12 * squeeze * self.width
        return np.outer(self.lengths, out).ravel()

    def resultant(self, pressure: FloatArray) -> complex:
        """Return the integral of p e^(i theta) over the circumference, averaged over the length."""
        rows = np.vstack([pressure.reshape(self.along, self.around), np.zeros(self.around)])
        weights = np.tile([2.0, 4.0], self.along // 2 + 1)[: self.along + 1]
        weights[0] = weights[-1] = 1.0  # Simpson's rule: exact for the parabola of a short film
        around = rows @ np.exp(1j * self.angles) * self.width
        return complex(weights @ around / (3 * self.along))


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
    ParameterError
        If a value is invalid.
    """

    angle: float
    pressure: float

    def __post_init__(self) -> None:
        if not math.isfinite(self.angle):
            raise ParameterError(f"angle: {self.angle} rad, expected a finite angle")
        if not (math.isfinite(self.pressure) and self.pressure >= 0):
            raise ParameterError(f"pressure: {self.pressure:g} Pa, expected a finite value, 0 or more")


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
    ParameterError
        If the position is at or beyond the wall, or a value is not finite.
    EquilibriumError
        If the full-film set does not converge.
    """
    if groove is not None:
        grid = replace(grid, first_angle=groove.angle)
    if not math.isfinite(surface_speed):
        raise ParameterError(f"surface_speed: {surface_speed} rad/s, expected a finite value")
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
    ParameterError
        If the position is at or beyond the wall or the velocity is not finite.
    """
    _require_inside(film, position)
    if not np.isfinite(velocity):
        raise ParameterError(f"velocity: {velocity} m/s, expected a finite value")
    z, v = position / film.clearance, velocity / film.clearance
    at_faces = 1 - (z * np.exp(-1j * grid.faces)).real
    at_nodes = 1 - (z * np.exp(-1j * grid.angles)).real
    return at_faces, at_nodes, -(v * np.exp(-1j * grid.angles)).real


def _require_inside(film: Film, position: complex) -> None:
    if not abs(position) < film.clearance:
        raise ParameterError(
            f"position: {abs(position) / MICROMETRE:g} µm from the centre, expected less than the clearance of "
            f"{film.clearance / MICROMETRE:g} µm"
        )


def _require_resolved(eccentricity: float, grid: Grid) -> None:
    narrow = math.sqrt(2 * (1 - eccentricity))  # angle over which the thickness doubles from its minimum
    if narrow < MIN_NODES_IN_GAP * grid.width:
        raise ParameterError(
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
