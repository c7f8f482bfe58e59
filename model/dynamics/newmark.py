"""Implicit integration in time with Newmark's method, compiled on the first call.

Each step is condensed to the points where forces act on shaft and rings. Complex numbers are vectors in the plane of
measurement, ``X + i Y``.
"""

from typing import NamedTuple

import numpy as np

from analysis.signals import ComplexArray, FloatArray
from model.compiling import Compiler
from model.dynamics import condensed, modal_system
from model.dynamics.condensed import (
    constraint_derivatives,
    eliminate,
    film_derivatives,
    newton_matrix,
    solve,
)
from model.dynamics.modal_system import (
    NO_LEVEL,
    Constraints,
    ModalShaft,
    MotionState,
    NewmarkMatrices,
    Parts,
    Rings,
    Workspace,
)
from model.films import film_kernels

NO_FAILURE = -1
MAX_SUBSTEP_ANGLE = 2 * np.pi / 48  # shaft rotation per time step, rad

compiler = Compiler(condensed, film_kernels, modal_system)


class Tangent(NamedTuple):
    """Disturbances of the motion in X and Y, propagated with it to first order.

    Parameters
    ----------
    motion : ndarray of float64, shape (3, m + n_rings, 2, n)
        Displacements, velocities and accelerations of n disturbances; changed in place.
    saved : ndarray of float64, shape (3, m + n_rings, 2, n)
        The same at the start of the caller's step.
    path : ndarray of float64, shape (n_outputs, n_steps, 2, n)
        Receives the outputs of the disturbances.
    """

    motion: FloatArray
    saved: FloatArray
    path: FloatArray


@compiler.inlined
def workspace(modes: int, points: int, rings: int) -> Workspace:
    """Return the work arrays."""
    bodies = points + rings
    return Workspace(
        np.zeros((2, bodies), np.complex128),
        np.zeros((3, bodies), np.complex128),
        np.zeros(bodies, np.complex128),
        np.zeros((bodies, bodies), np.complex128),
        np.zeros(bodies, np.complex128),
        np.zeros((bodies, bodies, 2), np.complex128),
        np.zeros(2 * bodies),
        np.zeros(2 * bodies),
        np.zeros((2 * bodies, 2 * bodies)),
        np.zeros((3, modes), np.complex128),
        np.zeros((3, modes + rings), np.complex128),
        np.zeros((2, 2)),
    )


@compiler.inlined
def _modes_without_forces(
    shaft: ModalShaft, matrices: NewmarkMatrices, level: int, state: MotionState, work: Workspace
) -> None:
    # Diagonal modal coordinates at the end of the step without bearing forces, and their compliances.
    h, speed, T = matrices.steps[level], state.speed[0], matrices.transforms[level]
    q, v, a = state.motion[0], state.motion[1], state.motion[2]
    force, y, compliance = work.modal[0], work.modal[1], work.modal[2]
    turn = complex(np.cos(state.angle[0]), np.sin(state.angle[0]))
    imbalance, rate = complex(speed * speed, -state.acceleration[0]) * turn, 2 / h  # -d²/dt² exp(i theta)
    for k in range(y.size):
        y[k] = rate * q[k] + v[k]
    for i in range(y.size):
        turned = 0j
        for j in range(y.size):
            turned += shaft.gyroscopic[i, j] * y[j]
        force[i] = imbalance * shaft.imbalance[i] + turn * shaft.bow[i] + shaft.weight[i]
        force[i] += rate * (y[i] + v[i]) + a[i] + shaft.damping[i] * y[i]
        force[i] += speed * complex(turned.imag, -turned.real)  # - i Omega G
    for k in range(y.size):
        lag = speed * matrices.gyroscopic[level, k]
        compliance[k] = complex(1, lag) / (1 + lag * lag)
        pushed = 0j
        for i in range(y.size):
            pushed += T[i, k] * force[i]
        y[k] = compliance[k] * pushed


@compiler.inlined
def _bodies_without_forces(
    shaft: ModalShaft, rings: Rings, matrices: NewmarkMatrices, level: int, state: MotionState, work: Workspace
) -> None:
    # Positions of the bodies at the end of the step without bearing forces, and the receptance for such forces.
    h, psi, shapes, H = matrices.steps[level], matrices.points[level], shaft.points, work.receptance
    y, compliance = work.modal[1], work.modal[2]
    for p in range(shapes.shape[0]):
        start, rate, growth, free = 0j, 0j, 0j, 0j
        for k in range(y.size):
            start += shapes[p, k] * state.motion[0, k]
            rate += shapes[p, k] * state.motion[1, k]
            growth += shapes[p, k] * state.motion[2, k]
            free += psi[p, k] * y[k]
        work.start[0, p], work.start[1, p], work.start[2, p], work.free[p] = start, rate, growth, free
        for c in range(p + 1):
            moved = 0j
            for k in range(y.size):
                moved += psi[p, k] * psi[c, k] * compliance[k]
            H[p, c] = H[c, p] = moved
    for r in range(rings.mass.size):
        j, k = shapes.shape[0] + r, y.size + r
        position, rate, acceleration = state.motion[0, k], state.motion[1, k], state.motion[2, k]
        work.start[0, j], work.start[1, j], work.start[2, j] = position, rate, acceleration
        work.free[j] = position + h * rate + h * h / 4 * (acceleration - 1j * rings.gravity[r])
        H[j, j] = h * h / (4 * rings.mass[r]) + 0j


@compiler.inlined
def _needs_shorter_step(constraints: Constraints, step: float, bodies: ComplexArray, ahead: float) -> bool:
    # Whether a wall is in contact now, or after the time ``ahead``, and this step is too long to resolve it
    for w in range(constraints.wall_points.size):
        if step > constraints.max_steps[w]:
            p, clearance = constraints.wall_points[w], constraints.walls[w, 0]
            if abs(bodies[0, p]) > clearance or abs(bodies[0, p] + ahead * bodies[1, p]) > clearance:
                return True
    return False


@compiler.inlined
def _step(
    parts: Parts,
    constraints: Constraints | None,
    matrices: NewmarkMatrices,
    level: int,
    state: MotionState,
    work: Workspace,
    tangent: Tangent | None,
) -> bool:
    # Newmark step, beta = 1/4, gamma = 1/2, to the angle and speed of the state; False if a shorter step is needed
    shaft, _, rings, _ = parts
    _modes_without_forces(shaft, matrices, level, state, work)
    _bodies_without_forces(shaft, rings, matrices, level, state, work)
    h, n, is_last = matrices.steps[level], shaft.points.shape[0], level == matrices.steps.size - 1
    if constraints is not None and not is_last and _needs_shorter_step(constraints, h, work.start, h):
        return False
    if not solve(parts, constraints, h, level, state, work):
        return False
    if constraints is not None and not is_last and _needs_shorter_step(constraints, h, work.bodies, 0.0):
        return False
    if tangent is not None:
        _tangent_step(parts, constraints, matrices, level, state.speed[0], work, tangent.motion)
    _finish_modes(matrices, level, n, state, work)
    for r in range(rings.mass.size):
        j, k = n + r, work.modal.shape[1] + r
        state.motion[0, k], state.motion[1, k] = work.bodies[0, j], work.bodies[1, j]
        state.motion[2, k] = work.forces[j] / rings.mass[r] - 1j * rings.gravity[r]
    return True


@compiler.inlined
def _finish_modes(matrices: NewmarkMatrices, level: int, n: int, state: MotionState, work: Workspace) -> None:
    # Modes at the end of the step, from the forces on the n points of the shaft
    h, T, psi, y, compliance = (
        matrices.steps[level],
        matrices.transforms[level],
        matrices.points[level],
        work.modal[1],
        work.modal[2],
    )
    for k in range(y.size):
        pushed = 0j
        for p in range(n):
            pushed += psi[p, k] * work.forces[p]
        y[k] += compliance[k] * pushed
    q, v, a = state.motion[0], state.motion[1], state.motion[2]
    for i in range(y.size):
        end = 0j
        for k in range(y.size):
            end += T[i, k] * y[k]
        change = end - q[i]
        a[i] = 2 / h * (2 / h * change - 2 * v[i]) - a[i]
        v[i] = 2 / h * change - v[i]
        q[i] = end


@compiler.compiled
def _product(matrix: FloatArray, planes: FloatArray) -> FloatArray:
    # Product of a matrix, (m, n), and planes of real and imaginary parts, (n, 2, columns); quicker than BLAS
    product = np.zeros((matrix.shape[0], 2, planes.shape[2]))
    for i in range(matrix.shape[0]):
        for k in range(matrix.shape[1]):
            for x in range(2):
                for c in range(planes.shape[2]):
                    product[i, x, c] += matrix[i, k] * planes[k, x, c]
    return product


@compiler.compiled
def _add_product(planes: FloatArray, factors: tuple[complex, complex], product: FloatArray) -> None:
    # Add real and imaginary part of two factors times the planes, (2, columns)
    (a, b), (c, d) = (factors[0].real, factors[1].real), (factors[0].imag, factors[1].imag)
    for j in range(planes.shape[1]):
        product[0, j] += a * planes[0, j] + b * planes[1, j]
    for j in range(planes.shape[1]):
        product[1, j] += c * planes[0, j] + d * planes[1, j]


@compiler.compiled
def _scaled_sum(factor: float, scaled: FloatArray, added: FloatArray) -> FloatArray:
    # Loops here and below: expressions of whole arrays take ten times as long to compile
    total = np.empty_like(scaled)
    sums, first, second = total.reshape(-1), scaled.reshape(-1), added.reshape(-1)
    for i in range(sums.size):
        sums[i] = factor * first[i] + second[i]
    return total


@compiler.compiled
def _fill(target: FloatArray, begin: int, source: FloatArray, factor: float) -> None:
    # Put a factor times the source into the rows from `begin` on
    for i in range(source.shape[0]):
        for x in range(2):
            for c in range(source.shape[2]):
                target[begin + i, x, c] = factor * source[i, x, c]


@compiler.compiled
def _finish_tangent(tangent: FloatArray, end: FloatArray, rate: float) -> None:
    # Displacements, velocities and accelerations at the end of the step
    q, v, a, ends = tangent[0].reshape(-1), tangent[1].reshape(-1), tangent[2].reshape(-1), end.reshape(-1)
    for i in range(q.size):
        change = ends[i] - q[i]
        a[i] = rate * (rate * change - 2 * v[i]) - a[i]
        v[i] = rate * change - v[i]
        q[i] = ends[i]


@compiler.compiled
def _copy_tangent(source: FloatArray, target: FloatArray) -> None:
    sources, targets = source.reshape(-1), target.reshape(-1)
    for i in range(sources.size):
        targets[i] = sources[i]


@compiler.compiled
def _store_path(outputs: FloatArray, tangent: Tangent, step: int) -> None:
    path = _product(outputs, tangent.motion[0, : outputs.shape[1]])
    for row in range(outputs.shape[0]):
        for x in range(2):
            for column in range(path.shape[2]):
                tangent.path[row, step, x, column] = path[row, x, column]


@compiler.compiled
def _tangent_forces(derivatives: ComplexArray, bodies: FloatArray) -> FloatArray:
    # Forces of disturbances of the bodies, (size, 2, columns)
    forces = np.zeros_like(bodies)
    for j in range(bodies.shape[0]):
        for body in range(bodies.shape[0]):
            slopes = derivatives[j, body, 0], derivatives[j, body, 1]
            if slopes != (0j, 0j):
                _add_product(bodies[body], slopes, forces[j])
    return forces


@compiler.compiled
def _tangent_step(
    parts: Parts,
    constraints: Constraints | None,
    matrices: NewmarkMatrices,
    level: int,
    speed: float,
    work: Workspace,
    tangent: FloatArray,
) -> None:
    # The step of `_step`, after `solve`, for disturbances, with the exact derivatives of the forces
    shaft, films, rings, _ = parts
    h, T, psi = matrices.steps[level], matrices.transforms[level], matrices.points[level]
    n, m, rate, compliance = psi.shape[0], psi.shape[1], 2 / h, work.modal[2]
    size = n + rings.mass.size
    slopes, slow = work.derivatives, np.zeros_like(work.derivatives)
    film_derivatives(films, n, speed, 0j, work.bodies, slow)
    constraint_derivatives(constraints, speed, 0j, work.bodies, slow)
    film_derivatives(films, n, speed, rate + 0j, work.bodies, slopes)
    constraint_derivatives(constraints, speed, rate + 0j, work.bodies, slopes)
    newton_matrix(n, slopes, work.receptance, work.matrix)
    q, v, a = tangent[0], tangent[1], tangent[2]
    y = _scaled_sum(rate, q, v)
    pushed = _scaled_sum(rate, _scaled_sum(1.0, y, v), a)
    turned, modal = _product(shaft.gyroscopic, y[:m]), np.zeros((m, 2, q.shape[2]))
    for i in range(m):
        _add_product(turned[i], (-1j * speed, speed + 0j), pushed[i])  # - i Omega G
        _add_product(y[i], (shaft.damping[i] + 0j, 1j * shaft.damping[i]), pushed[i])
    free = _product(T.T, pushed[:m])
    for k in range(m):
        _add_product(free[k], (compliance[k], 1j * compliance[k]), modal[k])
    bodies, starts = np.empty((size, 2, q.shape[2])), np.empty((size, 2, q.shape[2]))
    _fill(bodies, 0, _product(psi, modal), 1.0)
    _fill(bodies, n, pushed[m:], h * h / 4)
    _fill(starts, 0, _product(shaft.points, y[:m]), 1.0)
    _fill(starts, n, y[m:], 1.0)
    for j in range(size):
        for body in range(size):
            for x in range(2):
                slow[j, body, x] = (slopes[j, body, x] - slow[j, body, x]) / rate
    rest = _tangent_forces(slow, starts)  # forces of the velocities that the start leaves
    for j in range(size):
        for body in range(size):
            H = work.receptance[j, body]
            if H != 0j:
                _add_product(rest[body], (-H, -1j * H), bodies[j])
    eliminate(work.matrix, bodies.reshape(2 * size, -1))  # X and Y alternately
    forces = _scaled_sum(-1.0, rest, _tangent_forces(slopes, bodies))
    free = _product(psi.T, forces[:n])
    for k in range(m):
        _add_product(free[k], (compliance[k], 1j * compliance[k]), modal[k])
    end = np.empty_like(q)
    _fill(end, 0, _product(T, modal), 1.0)
    _fill(end, m, bodies[n:], 1.0)
    _finish_tangent(tangent, end, rate)


@compiler.inlined
def _copy(source: ComplexArray, target: ComplexArray) -> None:
    # Loops: slice assignment takes ten times as long to compile.
    for row in range(source.shape[0]):
        for column in range(source.shape[1]):
            target[row, column] = source[row, column]


@compiler.inlined
def _substeps(
    parts: Parts,
    constraints: Constraints | None,
    matrices: NewmarkMatrices,
    level: int,
    state: MotionState,
    work: Workspace,
    tangent: Tangent | None,
) -> bool:
    # One step of the caller in 4^level substeps
    interval = work.interval
    pieces = 4**level
    state.acceleration[0] = (interval[1, 1] - interval[0, 1]) / matrices.steps[0]
    for piece in range(1, pieces + 1):
        state.angle[0] = interval[0, 0] + (interval[1, 0] - interval[0, 0]) * piece / pieces
        state.speed[0] = interval[0, 1] + (interval[1, 1] - interval[0, 1]) * piece / pieces
        if not _step(parts, constraints, matrices, level, state, work, tangent):
            return False
    return True


@compiler.compiled
def integrate(
    parts: Parts,
    constraints: Constraints | None,
    matrices: NewmarkMatrices,
    state: MotionState,
    history: FloatArray,
    outputs: FloatArray,
    displacement: ComplexArray,
    tangent: Tangent | None = None,
) -> int:
    """Integrate the motion along a history of angle and speed with equal time steps.

    If the shaft turns too far in a step, touches a wall, or Newton's method does not converge, the step is divided by
    four, repeatedly.

    Parameters
    ----------
    parts, constraints, matrices : Parts, Constraints or None, NewmarkMatrices
        The system and its time step.
    state : MotionState
        State of the motion; changed in place.
    history : ndarray of float64, shape (2, n)
        Angle, rad, and speed, rad/s, of the shaft at the ends of the steps.
    outputs : ndarray of float64, shape (n_outputs, m)
        Mode shapes at the output stations.
    displacement : ndarray of complex128, shape (n_outputs, n)
        Receives the displacement at the output stations, m.
    tangent : Tangent, optional
        Disturbances to be propagated with the motion.

    Returns
    -------
    int
        ``NO_FAILURE``, or the index of the step that failed at the shortest length: the motion reached a wall.
    """
    shaft = parts.shaft
    work = workspace(shaft.squared_frequencies.size, shaft.points.shape[0], parts.rings.mass.size)
    interval, last = work.interval, matrices.steps.size - 1
    for n in range(history.shape[1]):
        interval[0, 0], interval[0, 1] = state.angle[0], state.speed[0]
        interval[1, 0], interval[1, 1] = history[0, n], history[1, n]
        level, fastest = 0, max(interval[0, 1], interval[1, 1])
        while matrices.steps[level] * fastest > MAX_SUBSTEP_ANGLE and level < last:
            level += 1
        _copy(state.motion, work.saved)
        if tangent is not None:
            _copy_tangent(tangent.motion, tangent.saved)
        while not _substeps(parts, constraints, matrices, level, state, work, tangent):
            _copy(work.saved, state.motion)
            if tangent is not None:
                _copy_tangent(tangent.saved, tangent.motion)
            state.level[0] = NO_LEVEL
            level += 1
            if level > last:
                return n
        for row in range(outputs.shape[0]):
            displacement[row, n] = 0j
            for k in range(outputs.shape[1]):
                displacement[row, n] += outputs[row, k] * state.motion[0, k]
        if tangent is not None:
            _store_path(outputs, tangent, n)
    return NO_FAILURE
