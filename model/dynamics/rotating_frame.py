"""Synchronous motion as an equilibrium in the frame rotating with the shaft, and its first-order matrix, compiled.

Bodies are points of the shaft, then rings. Complex numbers are vectors in the plane of measurement, ``X + i Y``.
"""

import numpy as np

from analysis.signals import ComplexArray, FloatArray
from model.compiling import Compiler
from model.dynamics import condensed, modal_system, newmark
from model.dynamics.condensed import (
    constraint_derivatives,
    constraint_forces,
    eliminate,
    film_derivatives,
    film_forces,
    newton_matrix,
    residual,
    wall_margin,
)
from model.dynamics.modal_system import Constraints, ModalShaft, Parts, Rings, Workspace
from model.dynamics.newmark import workspace
from model.films import film_kernels

MAX_ITERATIONS = 60
MAX_ECCENTRICITY = 0.9999  # eccentricity ratio accepted in Newton's method
MIN_FRACTION = 1e-6  # of a Newton step

compiler = Compiler(condensed, film_kernels, modal_system, newmark)


@compiler.compiled
def _evaluate(parts: Parts, constraints: Constraints | None, n: int, speed: float, work: Workspace) -> float:
    # Forces and residual at the present positions; norm of the residual, m, infinite beyond the clearances
    positions, films, total = work.bodies[0], parts.films, 0.0
    if not wall_margin(films, n, positions) > 1 - MAX_ECCENTRICITY**2:
        return np.inf
    for j in range(positions.size):
        work.bodies[1, j] = 1j * speed * positions[j]
    film_forces(films, n, speed, work.bodies, work.forces)
    constraint_forces(constraints, speed, work.bodies, work.forces)
    residual(n, positions.size, work)
    for j in range(2 * positions.size):
        total += work.residual[j] * work.residual[j]
    norm: float = np.sqrt(total)
    return norm


@compiler.compiled
def _newton(parts: Parts, constraints: Constraints | None, n: int, speed: float, work: Workspace) -> bool:
    # Newton's method for the positions, each step shortened until the residual falls; returns whether it converged
    positions, start, size = work.bodies[0], work.start[0], work.forces.size
    error = _evaluate(parts, constraints, n, speed, work)
    if error == np.inf:
        positions[:] = 0j
        error = _evaluate(parts, constraints, n, speed, work)
    for _ in range(MAX_ITERATIONS):
        if error < 0.1 * parts.tolerance:
            return True
        film_derivatives(parts.films, n, speed, 1j * speed, work.bodies, work.derivatives)
        constraint_derivatives(constraints, speed, 1j * speed, work.bodies, work.derivatives)
        newton_matrix(n, work.derivatives, work.receptance, work.matrix)
        change = -work.residual.reshape(-1, 1)
        eliminate(work.matrix, change)
        start[:] = positions
        fraction, following = 2.0, np.inf
        while not following < error:
            fraction /= 2
            if fraction < MIN_FRACTION:
                return False
            for j in range(size):
                positions[j] = start[j] + fraction * complex(change[2 * j, 0], change[2 * j + 1, 0])
            following = _evaluate(parts, constraints, n, speed, work)
        error = following
    return False


@compiler.compiled
def _without_forces(
    shaft: ModalShaft, rings: Rings, size: int, speed: float
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    # Factors of displacements and velocities of modes and rings, their positions at the bodies, their share of forces
    (n, m), coordinates = shaft.points.shape, shaft.points.shape[1] + rings.mass.size
    # q'' + (i Omega (2 - G) + d) q' + (w² - Omega² + Omega² G + i Omega d) q = forces ; rings: 1/m
    # Loops: expressions of whole arrays take ten times as long to compile.
    own = np.zeros((2, coordinates, coordinates), np.complex128)
    shapes = np.zeros((size, coordinates), np.complex128)
    inputs = np.zeros((coordinates, size), np.complex128)
    for i in range(m):
        for j in range(m):
            own[0, i, j] = speed * speed * shaft.gyroscopic[i, j]
            own[1, i, j] = -1j * speed * shaft.gyroscopic[i, j]
        for point in range(n):
            shapes[point, i] = inputs[i, point] = shaft.points[point, i]
    for j in range(coordinates):
        own[0, j, j] -= speed * speed
        own[1, j, j] += 2j * speed
        if j < m:
            own[0, j, j] += shaft.squared_frequencies[j] + 1j * speed * shaft.damping[j]
            own[1, j, j] += shaft.damping[j]
        else:
            shapes[n + j - m, j], inputs[j, n + j - m] = 1.0, 1 / rings.mass[j - m]
    return own, shapes, inputs


@compiler.compiled
def _first_order(parts: Parts, constraints: Constraints | None, n: int, speed: float, work: Workspace) -> FloatArray:
    # Matrix of displacements and velocities of modes and rings, X and Y alternately, about the present positions
    shaft, films, rings, _ = parts
    own, shapes, inputs = _without_forces(shaft, rings, work.forces.size, speed)
    coordinates = own.shape[1]
    still, moving = work.derivatives, np.zeros_like(work.derivatives)
    film_derivatives(films, n, speed, 1j * speed, work.bodies, still)
    constraint_derivatives(constraints, speed, 1j * speed, work.bodies, still)
    film_derivatives(films, n, speed, (1 + 1j) * speed, work.bodies, moving)
    constraint_derivatives(constraints, speed, (1 + 1j) * speed, work.bodies, moving)
    half = 2 * coordinates
    matrix, slopes = np.zeros((2 * half, 2 * half)), np.zeros_like(work.receptance)
    for j in range(half):
        matrix[j, half + j] = 1.0
    for part in range(2):
        for k in range(2):
            for i in range(work.forces.size):
                for j in range(work.forces.size):
                    slope = still[i, j, k]
                    slopes[i, j] = slope if part == 0 else (moving[i, j, k] - slope) / speed
            block = inputs @ (slopes @ shapes)
            for i in range(coordinates):
                for j in range(coordinates):
                    entry = block[i, j] - (1 if k == 0 else 1j) * own[part, i, j]
                    matrix[half + 2 * i, part * half + 2 * j + k] = entry.real
                    matrix[half + 2 * i + 1, part * half + 2 * j + k] = entry.imag
    return matrix


@compiler.compiled
def rotating_motion(
    parts: Parts, constraints: Constraints | None, speed: float, fraction: float, positions: ComplexArray
) -> tuple[bool, ComplexArray, FloatArray]:
    """Solve for the synchronous motion.

    Parameters
    ----------
    parts, constraints : Parts, Constraints or None
        The system.
    speed : float
        Of the shaft, rad/s.
    fraction : float
        Of imbalance and bow.
    positions : ndarray of complex128, shape (n_bodies,)
        Start, then solution, m.

    Returns
    -------
    is_solved : bool
        Whether Newton's method converged within the clearances; the rest is meaningless if not.
    modal : ndarray of complex128, shape (m,)
        Modal displacements.
    matrix : ndarray of float64, shape (4 (m + n_rings), 4 (m + n_rings))
        Derivative of displacements and velocities, X and Y alternately, of disturbances of modes, then rings.
    """
    shaft, rings = parts.shaft, parts.rings
    n, m = shaft.points.shape
    shapes = shaft.points.astype(np.complex128)
    work = workspace(m, n, rings.mass.size)
    work.bodies[0, :] = positions
    # w² - Omega² + i Omega d + Omega² G, from M z'' + D z' - i Omega J z' + K z with z = Z exp(i Omega t)
    dynamic = (speed * speed * shaft.gyroscopic).astype(np.complex128)
    for j in range(m):
        dynamic[j, j] += shaft.squared_frequencies[j] - speed * speed + 1j * speed * shaft.damping[j]
    compliance = np.linalg.inv(dynamic)
    excited = fraction * (speed * speed * shaft.imbalance + shaft.bow)
    work.receptance[:n, :n] = shapes @ (compliance @ shapes.T)
    work.free[:n] = shapes @ (compliance @ excited)
    for r in range(rings.mass.size):
        work.receptance[n + r, n + r] = -1 / (rings.mass[r] * speed * speed)
    is_solved = _newton(parts, constraints, n, speed, work)
    positions[:] = work.bodies[0]
    modal = compliance @ (excited + shapes.T @ work.forces[:n])
    return is_solved, modal, _first_order(parts, constraints, n, speed, work)


@compiler.compiled
def disturbance(matrix: FloatArray, eigenvalue: complex, eccentricities: FloatArray) -> tuple[bool, float]:
    """Return a disturbance of the films from the matrix of `rotating_motion`, by inverse iteration.

    Returns
    -------
    is_reverse : bool
        Whether its larger circle turns against the imaginary part of the eigenvalue.
    inner_share : float
        Share of the inner films in this circle.
    """
    half = matrix.shape[0] // 2
    near = eigenvalue * (1 + 1e-9)
    pencil = -near * matrix[half:, half:] - matrix[half:, :half]
    for j in range(half):
        pencil[j, j] += near * near
    vector = np.linalg.solve(pencil, np.arange(1, half + 1) + 0j)
    vector = np.linalg.solve(pencil, vector / np.abs(vector).max())
    sizes = np.zeros((2, 2))  # circle with and against, inner and outer films
    for film in range(4):
        x, y = 0j, 0j
        for j in range(half // 2):
            x += eccentricities[film, j] * vector[2 * j]
            y += eccentricities[film, j] * vector[2 * j + 1]
        sizes[0, film // 2] += abs(x + 1j * y) ** 2
        sizes[1, film // 2] += abs(x - 1j * y) ** 2
    is_reverse = sizes[1].sum() > sizes[0].sum()
    inner, outer = np.sqrt(sizes[1 if is_reverse else 0])
    return is_reverse, inner / (inner + outer)
