"""Condensed equations of a time step, compiled: forces on the bodies, and Newton's method for their positions.

Bodies are ``n`` points of the shaft (with films first the two journals, then other stations with supports or walls),
followed by the rings (with films first the two floating rings, then those of linear supports): ``size`` bodies in
total. Without constraints both numbers are compile-time constants, and the code for constraints is not compiled; nor is
the code for films without films. Complex numbers are vectors in the plane of measurement, ``X + i Y``.
"""

import numpy as np

from analysis.signals import ComplexArray, FloatArray
from model.compiling import Compiler
from model.dynamics import modal_system
from model.dynamics.modal_system import Constraints, Films, MotionState, Parts, Workspace
from model.films import film_kernels
from model.films.film_kernels import MIN_WALL_MARGIN, ForceLaw, film_force, film_slopes

FRICTION_TRANSITION_SPEED = 1e-3  # m/s: regularises friction, so that it does not jump at the reversal of sliding
NEWTON_ITERATIONS = 25

compiler = Compiler(film_kernels, modal_system)


@compiler.compiled
def support_force(position: complex, velocity: complex, coefficients: ComplexArray) -> complex:
    """Return the force of a linear support on the shaft or ring, N.

    Parameters
    ----------
    position, velocity : complex
        Of the supported body relative to the supporting one, m and m/s.
    coefficients : ndarray of complex128, shape (4,)
        a, b, c, d of ``-(a z + b conj z + c z' + d conj z')``, N/m and N s/m.
    """
    restoring = coefficients[0] * position + coefficients[1] * position.conjugate()
    force: complex = -(restoring + coefficients[2] * velocity + coefficients[3] * velocity.conjugate())
    return force


@compiler.compiled
def support_force_derivatives(velocity_ratio: complex, coefficients: ComplexArray) -> tuple[complex, complex]:
    """Return the derivatives of `support_force` with respect to X and Y, N/m; ``velocity_ratio`` as for a film."""
    of_x = support_force(1 + 0j, velocity_ratio, coefficients)
    return of_x, support_force(1j, velocity_ratio * 1j, coefficients)


@compiler.compiled
def wall_force(
    position: complex,
    velocity: complex,
    speed: float,
    sizes: FloatArray,
) -> complex:
    """Return the contact force of a wall on the shaft, N.

    Thesis eqs. (4.41) and (4.42) with Hunt-Crossley damping, which is proportional to the depth, so that the force does
    not jump at first contact. A wall never pulls.

    Parameters
    ----------
    position, velocity : complex
        Of the shaft centre, m and m/s.
    speed : float
        Of the shaft, rad/s.
    sizes : ndarray of float64, shape (5,)
        Clearance, the displacement at which contact begins, m; radial stiffness, N/m; friction coefficient; damping,
        the relative increase of the contact force per m/s of approach, s/m; radius of the rubbing surface, m.

    Returns
    -------
    complex
        Contact and friction force, N; 0 without contact.
    """
    clearance, stiffness, friction, damping, radius = sizes[0], sizes[1], sizes[2], sizes[3], sizes[4]
    distance = abs(position)
    depth = distance - clearance
    if depth <= 0.0:
        return 0j
    outwards = position / distance
    along = outwards.conjugate() * velocity  # radial + i tangential
    press = stiffness * depth * (1 + damping * along.real)  # Eq. (4.41)
    if press <= 0.0:
        return 0j
    sliding = speed * radius + along.imag
    rub = (
        friction * press * sliding / np.sqrt(sliding * sliding + FRICTION_TRANSITION_SPEED * FRICTION_TRANSITION_SPEED)
    )  # Eq. (4.42)
    return -complex(press, rub) * outwards


@compiler.compiled
def wall_force_derivatives(
    position: complex,
    velocity: complex,
    velocity_ratio: complex,
    speed: float,
    sizes: FloatArray,
) -> tuple[complex, complex]:
    """Return the derivatives of `wall_force` with respect to X and Y, N/m, by finite differences.

    Parameters
    ----------
    position, velocity, speed, sizes : complex, float and ndarray
        As for ``wall_force``.
    velocity_ratio : complex
        As for ``film_slopes``.
    """
    start, reach = wall_force(position, velocity, speed, sizes), 1e-7 * sizes[0]
    in_x = reach if position.real > 0 else -reach  # into the wall
    in_y = reach if position.imag > 0 else -reach
    of_x = wall_force(position + in_x, velocity + velocity_ratio * in_x, speed, sizes)
    of_y = wall_force(position + 1j * in_y, velocity + velocity_ratio * 1j * in_y, speed, sizes)
    return (of_x - start) / in_x, (of_y - start) / in_y


@compiler.inlined
def wall_margin(films: Films | None, n: int, positions: ComplexArray) -> float:
    """Return the minimum of 1 - eccentricity² over the four films; 1 without films."""
    nearest = 1.0
    if films is not None:
        for b in range(2):
            inner, outer = positions[b] - positions[n + b], positions[n + b]
            nearest = min(nearest, 1 - (inner.real**2 + inner.imag**2) / films.inner_clearance**2)
            nearest = min(nearest, 1 - (outer.real**2 + outer.imag**2) / films.outer_clearance**2)
    return nearest


@compiler.inlined
def _inner_film_arguments(
    films: Films, body: int, ring: int, speed: float, bodies: ComplexArray
) -> tuple[ForceLaw, complex, complex, float, float, float]:
    # Arguments of film_force for a journal in its ring
    position, rate = bodies[0, body] - bodies[0, ring], bodies[1, body] - bodies[1, ring]
    return films.law, position, rate, films.inner_clearance, films.inner_speed * speed, films.inner_factor


@compiler.inlined
def _outer_film_arguments(
    films: Films, ring: int, speed: float, bodies: ComplexArray
) -> tuple[ForceLaw, complex, complex, float, float, float]:
    # Arguments of film_force for a ring in the housing
    position, rate = bodies[0, ring], bodies[1, ring]
    return films.law, position, rate, films.outer_clearance, films.outer_speed * speed, films.outer_factor


@compiler.inlined
def film_forces(films: Films | None, n: int, speed: float, bodies: ComplexArray, forces: ComplexArray) -> None:
    """Set the forces to those of the films at the present positions and velocities."""
    for j in range(forces.size):
        forces[j] = 0j
    if films is not None:
        for b in range(2):
            r = n + b
            inner = film_force(*_inner_film_arguments(films, b, r, speed, bodies))
            outer = film_force(*_outer_film_arguments(films, r, speed, bodies))
            forces[b], forces[r] = inner, outer - inner


@compiler.inlined
def constraint_forces(
    constraints: Constraints | None, speed: float, bodies: ComplexArray, forces: ComplexArray
) -> None:
    """Add the forces of supports and walls."""
    if constraints is not None:
        for s in range(constraints.supported.shape[0]):
            p, r = constraints.supported[s]
            position, rate, coefficients = bodies[0, p], bodies[1, p], constraints.coefficients[s]
            if r >= 0:
                position, rate = position - bodies[0, r], rate - bodies[1, r]
            inner = support_force(position, rate, coefficients[:4])
            forces[p] += inner
            if r >= 0:
                forces[r] = support_force(bodies[0, r], bodies[1, r], coefficients[4:]) - inner
        for w in range(constraints.wall_points.size):
            p = constraints.wall_points[w]
            forces[p] += wall_force(bodies[0, p], bodies[1, p], speed, constraints.walls[w])


@compiler.inlined
def _add_derivative(derivatives: ComplexArray, body: int, other: int, slope: tuple[complex, complex]) -> None:
    # Add the derivative of a force between two bodies; ``other`` < 0 is the housing
    for k in range(2):
        derivatives[body, body, k] += slope[k]
        if other >= 0:
            derivatives[body, other, k] -= slope[k]
            derivatives[other, body, k] -= slope[k]
            derivatives[other, other, k] += slope[k]


@compiler.compiled
def film_derivatives(
    films: Films | None, n: int, speed: float, velocity_ratio: complex, bodies: ComplexArray, derivatives: ComplexArray
) -> None:
    """Set the derivatives of `film_forces` with respect to X and Y, (size, size, 2), N/m.

    ``velocity_ratio`` is the change of velocity per change of position, 1/s.
    """
    for j in range(derivatives.shape[0]):
        for k in range(derivatives.shape[0]):
            derivatives[j, k, 0] = derivatives[j, k, 1] = 0j
    if films is not None:
        for b in range(2):
            r = n + b
            inner = film_slopes(*_inner_film_arguments(films, b, r, speed, bodies), velocity_ratio)
            outer = film_slopes(*_outer_film_arguments(films, r, speed, bodies), velocity_ratio)
            _add_derivative(derivatives, b, r, inner)
            _add_derivative(derivatives, r, -1, outer)


@compiler.compiled
def constraint_derivatives(
    constraints: Constraints | None,
    speed: float,
    velocity_ratio: complex,
    bodies: ComplexArray,
    derivatives: ComplexArray,
) -> None:
    """Add the derivatives of the forces of supports and walls."""
    if constraints is not None:
        for s in range(constraints.supported.shape[0]):
            p, r = constraints.supported[s]
            coefficients = constraints.coefficients[s]
            _add_derivative(derivatives, p, r, support_force_derivatives(velocity_ratio, coefficients[:4]))
            if r >= 0:
                _add_derivative(derivatives, r, -1, support_force_derivatives(velocity_ratio, coefficients[4:]))
        for w in range(constraints.wall_points.size):
            p = constraints.wall_points[w]
            slope = wall_force_derivatives(bodies[0, p], bodies[1, p], velocity_ratio, speed, constraints.walls[w])
            _add_derivative(derivatives, p, -1, slope)


@compiler.compiled
def newton_matrix(n: int, derivatives: ComplexArray, H: ComplexArray, matrix: FloatArray) -> None:
    """Set the matrix to d(residual) / d(positions), X and Y alternately, from the receptance H of the bodies."""
    size = H.shape[0]
    for j in range(2 * size):
        for k in range(2 * size):
            matrix[j, k] = 0.0
        matrix[j, j] = 1.0
    for body in range(size):
        for k in range(2):
            for j in range(size):
                first, last = (0, n) if j < n else (j, j + 1)  # a force on a ring moves only this ring
                for c in range(first, last):
                    through = H[j, c] * derivatives[c, body, k]
                    matrix[2 * j, 2 * body + k] -= through.real
                    matrix[2 * j + 1, 2 * body + k] -= through.imag


@compiler.compiled
def eliminate(matrix: FloatArray, columns: FloatArray) -> None:
    """Replace right-hand sides, (n, columns), by the solutions, by elimination with row pivoting."""
    n = matrix.shape[0]
    for k in range(n):
        pivot = k + int(np.argmax(np.abs(matrix[k:, k])))
        for c in range(n):
            matrix[k, c], matrix[pivot, c] = matrix[pivot, c], matrix[k, c]
        inverse = 1 / matrix[k, k]
        for c in range(columns.shape[1]):
            columns[k, c], columns[pivot, c] = columns[pivot, c], columns[k, c]
            columns[k, c] *= inverse
        for c in range(k + 1, n):
            matrix[k, c] *= inverse
        for row in range(n):
            if row != k:
                for c in range(k + 1, n):
                    matrix[row, c] -= matrix[row, k] * matrix[k, c]
                for c in range(columns.shape[1]):
                    columns[row, c] -= matrix[row, k] * columns[k, c]


@compiler.inlined
def residual(n: int, size: int, work: Workspace) -> float:
    """Set the residual at the present positions; return its largest component, m."""
    H, forces, largest = work.receptance, work.forces, 0.0
    for j in range(size):
        error = work.bodies[0, j] - work.free[j]
        first, last = (0, n) if j < n else (j, j + 1)
        for c in range(first, last):
            error -= H[j, c] * forces[c]
        work.residual[2 * j], work.residual[2 * j + 1] = error.real, error.imag
        largest = max(largest, abs(error.real), abs(error.imag))
    return largest


@compiler.inlined
def _newton_step(films: Films | None, n: int, size: int, state: MotionState, work: Workspace) -> bool:
    # Newton step, halved while it leads too close to a wall
    positions, change = work.bodies[0], work.change
    limit = max(MIN_WALL_MARGIN, 0.2 * wall_margin(films, n, positions))
    for j in range(2 * size):
        change[j] = 0.0
        for k in range(2 * size):
            change[j] -= state.inverse[j, k] * work.residual[k]
    fraction = 1.0
    for _ in range(30):
        for j in range(size):
            positions[j] += fraction * complex(change[2 * j], change[2 * j + 1])
        if wall_margin(films, n, positions) >= limit:
            return True
        fraction = -0.5 * fraction if fraction > 0 else 0.5 * fraction  # step back half way
    return False


@compiler.inlined
def _starting_point(films: Films | None, n: int, size: int, step: float, work: Workspace) -> None:
    # Positions at the present acceleration; the present ones if these are at or beyond a wall
    positions, start = work.bodies[0], work.start
    for j in range(size):
        positions[j] = start[0, j] + step * (start[1, j] + step / 2 * start[2, j])
    if wall_margin(films, n, positions) < MIN_WALL_MARGIN:
        for j in range(size):
            positions[j] = start[0, j]


@compiler.inlined
def solve(
    parts: Parts, constraints: Constraints | None, step: float, level: int, state: MotionState, work: Workspace
) -> bool:
    """Solve for positions and velocities of the bodies at the end of the step; return whether Newton converged."""
    n, size, films = 2, 4, parts.films
    if constraints is not None:
        n, size = int(constraints.points), work.forces.size
    speed, last = state.speed[0], np.inf
    _starting_point(films, n, size, step, work)
    for _ in range(NEWTON_ITERATIONS):
        for j in range(size):  # Newmark's velocities at the end of the step
            work.bodies[1, j] = 2 / step * (work.bodies[0, j] - work.start[0, j]) - work.start[1, j]
        film_forces(films, n, speed, work.bodies, work.forces)
        constraint_forces(constraints, speed, work.bodies, work.forces)
        error = residual(n, size, work)
        if error < parts.tolerance:
            return True
        if state.level[0] != level or error > 0.3 * last:
            film_derivatives(films, n, speed, 2 / step + 0j, work.bodies, work.derivatives)
            constraint_derivatives(constraints, speed, 2 / step + 0j, work.bodies, work.derivatives)
            newton_matrix(n, work.derivatives, work.receptance, work.matrix)
            for j in range(2 * size):
                for k in range(2 * size):
                    state.inverse[j, k] = 0.0
                state.inverse[j, j] = 1.0
            eliminate(work.matrix, state.inverse)
            state.level[0] = level
        last = error
        if not _newton_step(films, n, size, state, work):
            return False
    return False
