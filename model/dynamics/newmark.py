"""Implicit integration in time with Newmark's method, compiled on the first call.

Each step is condensed to the points where forces act on shaft and rings. Complex numbers are vectors in the plane of
measurement, ``X + i Y``.
"""

import numpy as np

from analysis.signals import ComplexArray, FloatArray
from model.compiling import Compiler
from model.dynamics import condensed, modal_system
from model.dynamics.condensed import solve
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


@compiler.inlined
def _workspace(modes: int, points: int, rings: int) -> Workspace:
    bodies = points + rings
    return Workspace(
        np.zeros((2, bodies), np.complex128),
        np.zeros((2, bodies), np.complex128),
        np.zeros(bodies, np.complex128),
        np.zeros((bodies, bodies), np.complex128),
        np.zeros(bodies, np.complex128),
        np.zeros((bodies, bodies, 2), np.complex128),
        np.zeros(2 * bodies),
        np.zeros(2 * bodies),
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
    imbalance = speed * speed * complex(np.cos(state.angle[0]), np.sin(state.angle[0]))
    rate = 2 / h
    for k in range(y.size):
        y[k] = rate * q[k] + v[k]
    for i in range(y.size):
        turned = 0j
        for j in range(y.size):
            turned += shaft.gyroscopic[i, j] * y[j]
        force[i] = imbalance * shaft.imbalance[i] + shaft.weight[i] + rate * (y[i] + v[i]) + a[i]
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
        start, rate, free = 0j, 0j, 0j
        for k in range(y.size):
            start += shapes[p, k] * state.motion[0, k]
            rate += shapes[p, k] * state.motion[1, k]
            free += psi[p, k] * y[k]
        work.start[0, p], work.start[1, p], work.free[p] = start, rate, free
        for c in range(p + 1):
            moved = 0j
            for k in range(y.size):
                moved += psi[p, k] * psi[c, k] * compliance[k]
            H[p, c] = H[c, p] = moved
    for r in range(rings.mass.size):
        j, k = shapes.shape[0] + r, y.size + r
        position, rate, acceleration = state.motion[0, k], state.motion[1, k], state.motion[2, k]
        work.start[0, j], work.start[1, j] = position, rate
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
) -> bool:
    # Newmark step, beta = 1/4, gamma = 1/2, to the angle and speed of the state; False if a shorter step is needed
    shaft, films, rings = parts
    _modes_without_forces(shaft, matrices, level, state, work)
    _bodies_without_forces(shaft, rings, matrices, level, state, work)
    h, n, is_last = matrices.steps[level], shaft.points.shape[0], level == matrices.steps.size - 1
    if constraints is not None and not is_last and _needs_shorter_step(constraints, h, work.start, h):
        return False
    if not solve(films, constraints, h, level, state, work):
        return False
    if constraints is not None and not is_last and _needs_shorter_step(constraints, h, work.bodies, 0.0):
        return False
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
) -> bool:
    # One step of the caller in 4^level substeps
    interval = work.interval
    pieces = 4**level
    for piece in range(1, pieces + 1):
        state.angle[0] = interval[0, 0] + (interval[1, 0] - interval[0, 0]) * piece / pieces
        state.speed[0] = interval[0, 1] + (interval[1, 1] - interval[0, 1]) * piece / pieces
        if not _step(parts, constraints, matrices, level, state, work):
            return False
    return True


@compiler.compiled
def integrate(
    parts: Parts,
    constraints: Constraints | None,
    matrices: NewmarkMatrices,
    state: MotionState,
    angles: FloatArray,
    speeds: FloatArray,
    outputs: FloatArray,
    displacement: ComplexArray,
) -> int:
    """Integrate the motion along ``angles`` and ``speeds`` with equal time steps.

    If the shaft turns too far in a step, touches a wall, or Newton's method does not converge, the step is divided by
    four, repeatedly.

    Parameters
    ----------
    parts, constraints, matrices : Parts, Constraints or None, NewmarkMatrices
        The system and its time step.
    state : MotionState
        State of the motion; changed in place.
    angles, speeds : ndarray of float64, shape (n,)
        Angle, rad, and speed, rad/s, of the shaft at the ends of the steps.
    outputs : ndarray of float64, shape (n_outputs, m)
        Mode shapes at the output stations.
    displacement : ndarray of complex128, shape (n_outputs, n)
        Receives the displacement at the output stations, m.

    Returns
    -------
    int
        ``NO_FAILURE``, or the index of the step that failed at the shortest length: the motion reached a wall.
    """
    shaft = parts.shaft
    work = _workspace(shaft.squared_frequencies.size, shaft.points.shape[0], parts.rings.mass.size)
    interval, last = work.interval, matrices.steps.size - 1
    for n in range(angles.size):
        interval[0, 0], interval[0, 1] = state.angle[0], state.speed[0]
        interval[1, 0], interval[1, 1] = angles[n], speeds[n]
        level, fastest = 0, max(interval[0, 1], interval[1, 1])
        while matrices.steps[level] * fastest > MAX_SUBSTEP_ANGLE and level < last:
            level += 1
        _copy(state.motion, work.saved)
        while not _substeps(parts, constraints, matrices, level, state, work):
            _copy(work.saved, state.motion)
            state.level[0] = NO_LEVEL
            level += 1
            if level > last:
                return n
        for row in range(outputs.shape[0]):
            displacement[row, n] = 0j
            for k in range(outputs.shape[1]):
                displacement[row, n] += outputs[row, k] * state.motion[0, k]
    return NO_FAILURE
