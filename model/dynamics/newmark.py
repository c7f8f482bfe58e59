"""The implicit march in time, compiled: Newmark's steps, each condensed to where forces act on shaft and rings.

Nothing is compiled when the file is imported, only at the first call. Complex numbers are vectors in the bench's plane,
``X + i Y``.
"""

import numpy as np
from numpy.typing import NDArray

from model.compiling import Compiler
from model.dynamics import condensed, forces, modal_system, state
from model.dynamics.condensed import solve
from model.dynamics.modal_system import Constraints, Parts, Rings, Shaft
from model.dynamics.state import NO_LEVEL, Levels, State, Work
from model.films import capone_kernel

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

NO_FAILURE = -1
LARGEST_TURN = 2 * np.pi / 48  # that the shaft may make in one step, rad

compiler = Compiler(condensed, capone_kernel, forces, state, modal_system)


@compiler.inlined
def _work(modes: int, points: int, rings: int) -> Work:
    bodies = points + rings
    return Work(
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
def _unloaded(shaft: Shaft, levels: Levels, level: int, state: State, work: Work) -> None:
    # Where the modes, in diagonal coordinates, would come to without forces of bearings, and their compliances.
    h, speed, T = levels.steps[level], state.speed[0], levels.transforms[level]
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
        lag = speed * levels.gyroscopic[level, k]
        compliance[k] = complex(1, lag) / (1 + lag * lag)
        pushed = 0j
        for i in range(y.size):
            pushed += T[i, k] * force[i]
        y[k] = compliance[k] * pushed


@compiler.inlined
def _free_motion(shaft: Shaft, rings: Rings, levels: Levels, level: int, state: State, work: Work) -> None:
    # Where the bodies would come to without forces of bearings, and how such forces would move them.
    h, psi, shapes, H = levels.steps[level], levels.points[level], shaft.points, work.receptance
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
        place, rate, acceleration = state.motion[0, k], state.motion[1, k], state.motion[2, k]
        work.start[0, j], work.start[1, j] = place, rate
        work.free[j] = place + h * rate + h * h / 4 * (acceleration - 1j * rings.gravity[r])
        H[j, j] = h * h / (4 * rings.mass[r]) + 0j


@compiler.inlined
def _is_too_long(constraints: Constraints, step: float, bodies: ComplexArray, ahead: float) -> bool:
    # Whether a wall is touched now, or a time ``ahead``, and a step of this length would not follow it
    for w in range(constraints.touching.size):
        if step > constraints.longest_steps[w]:
            p, clearance = constraints.touching[w], constraints.walls[w, 0]
            if abs(bodies[0, p]) > clearance or abs(bodies[0, p] + ahead * bodies[1, p]) > clearance:
                return True
    return False


@compiler.inlined
def _step(parts: Parts, constraints: Constraints | None, levels: Levels, level: int, state: State, work: Work) -> bool:
    # Newmark's step, beta = 1/4, gamma = 1/2, to the state's angle and speed; False where a shorter one is needed
    shaft, films, rings = parts
    _unloaded(shaft, levels, level, state, work)
    _free_motion(shaft, rings, levels, level, state, work)
    h, n, is_last = levels.steps[level], shaft.points.shape[0], level == levels.steps.size - 1
    if constraints is not None and not is_last and _is_too_long(constraints, h, work.start, h):
        return False
    if not solve(films, constraints, h, level, state, work):
        return False
    if constraints is not None and not is_last and _is_too_long(constraints, h, work.bodies, 0.0):
        return False
    _newmark_end(levels, level, n, state, work)
    for r in range(rings.mass.size):
        j, k = n + r, work.modal.shape[1] + r
        state.motion[0, k], state.motion[1, k] = work.bodies[0, j], work.bodies[1, j]
        state.motion[2, k] = work.forces[j] / rings.mass[r] - 1j * rings.gravity[r]
    return True


@compiler.inlined
def _newmark_end(levels: Levels, level: int, n: int, state: State, work: Work) -> None:
    # The modes at the end of the step, the forces on the shaft's n points known
    h, T, psi, y, compliance = (
        levels.steps[level],
        levels.transforms[level],
        levels.points[level],
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
    # In loops: an assignment of slices takes ten times as long to compile.
    for row in range(source.shape[0]):
        for column in range(source.shape[1]):
            target[row, column] = source[row, column]


@compiler.inlined
def _follow(
    parts: Parts, constraints: Constraints | None, levels: Levels, level: int, state: State, work: Work
) -> bool:
    # One step of the caller's in 4^level parts
    course = work.course
    pieces = 4**level
    for piece in range(1, pieces + 1):
        state.angle[0] = course[0, 0] + (course[1, 0] - course[0, 0]) * piece / pieces
        state.speed[0] = course[0, 1] + (course[1, 1] - course[0, 1]) * piece / pieces
        if not _step(parts, constraints, levels, level, state, work):
            return False
    return True


@compiler.compiled
def march(
    parts: Parts,
    constraints: Constraints | None,
    levels: Levels,
    state: State,
    angles: FloatArray,
    speeds: FloatArray,
    seen: FloatArray,
    displacement: ComplexArray,
) -> int:
    """Follow the shaft through ``angles`` and ``speeds`` at equal steps.

    Where the shaft turns too far in a step, touches a wall, or Newton's method finds no way, the step is divided by
    four, repeatedly.

    Parameters
    ----------
    parts, constraints, levels : Parts, Constraints or None, Levels
        The system and its step.
    state : State
        Where the motion stands; changed.
    angles, speeds : ndarray of float64, shape (n,)
        The shaft's angle, rad, and speed, rad/s, at the ends of the steps.
    seen : ndarray of float64, shape (n_seen, m)
        Mode shapes at the stations that are looked at.
    displacement : ndarray of complex128, shape (n_seen, n)
        Filled with the displacement there, m.

    Returns
    -------
    int
        ``NO_FAILURE``, or the step at which no division helped: the motion reached a wall.
    """
    shaft = parts.shaft
    work = _work(shaft.squares.size, shaft.points.shape[0], parts.rings.mass.size)
    course, last = work.course, levels.steps.size - 1
    for n in range(angles.size):
        course[0, 0], course[0, 1] = state.angle[0], state.speed[0]
        course[1, 0], course[1, 1] = angles[n], speeds[n]
        level, fastest = 0, max(course[0, 1], course[1, 1])
        while levels.steps[level] * fastest > LARGEST_TURN and level < last:
            level += 1
        _copy(state.motion, work.kept)
        while not _follow(parts, constraints, levels, level, state, work):
            _copy(work.kept, state.motion)
            state.level[0] = NO_LEVEL
            level += 1
            if level > last:
                return n
        for row in range(seen.shape[0]):
            displacement[row, n] = 0j
            for k in range(seen.shape[1]):
                displacement[row, n] += seen[row, k] * state.motion[0, k]
    return NO_FAILURE
