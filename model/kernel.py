"""The compiled inner loop: film forces and the implicit march in time.

All compiled code stands in this one file: a compiled cache on disk is renewed when its own source file changes, not
when a file that it imports does. Nothing is compiled when the file is imported, only at the first call.

Complex numbers are vectors in the bench's plane, ``X + i Y``.
"""

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

from model.system import NO_LEVEL, Films, Levels, Shaft, State, Work

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

P = ParamSpec("P")
R = TypeVar("R")

WALL = 1e-4  # smallest 1 - eccentricity² that is computed: beyond it the film's equations lose their digits
NEWTON_ITERATIONS = 25
NO_FAILURE = -1
LARGEST_TURN = 2 * np.pi / 48  # that the shaft may make in one step, rad


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function at its first call, keep it on disk, and release the interpreter's lock while it runs."""
    return _compiled(function, forceinline=False)


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function into those that call it, so that its arrays' references are not counted: a third faster."""
    return _compiled(function, forceinline=True)


def _compiled(function: Callable[P, R], *, forceinline: bool) -> Callable[P, R]:
    # The one place where numba's decorator, which carries no types, meets typed code.
    decorate = cast("Callable[..., Any]", numba.njit)
    options = {"nogil": True, "error_model": "numpy", "forceinline": forceinline}
    try:
        return cast("Callable[P, R]", decorate(function, cache=True, **options))
    except RuntimeError:  # no folder to keep it in, neither beside the source nor in the user's cache
        return cast("Callable[P, R]", decorate(function, **options))


@compiled
def capone_force(
    position: complex, velocity: complex, clearance: float, surface_speed: float, factor: float
) -> complex:
    """Return the force of a short film, cavitated where its pressure falls below zero, on the inner body, N.

    Capone's closed form, thesis eq. (4.38), with one correction: F = q / (1 - q²). The printed q / (1 - x² - y²) is
    equal only without squeeze and wrong by up to fifteen times at large velocities.

    Parameters
    ----------
    position : complex
        Of the inner body from the outer one, m; less than the clearance.
    velocity : complex
        Of the inner body against the outer one, m/s.
    clearance : float
        Radial, m.
    surface_speed : float
        Sum of the angular speeds of both surfaces, rad/s.
    factor : float
        mu R L³ / (4 C²), N s.

    Returns
    -------
    complex
        N; 0 where nothing moves.
    """
    x, y = position.real / clearance, position.imag / clearance
    A = surface_speed * x - 2 * velocity.imag / clearance
    B = surface_speed * y + 2 * velocity.real / clearance
    s = np.sqrt(A * A + B * B)
    if s == 0.0:
        return 0j
    cos_a, sin_a = -A / s, -B / s  # alpha = arctan(B/A) - pi/2 sign(B/A) - pi/2 sign(B), without its 0/0
    u = 1 - x * x - y * y
    root = np.sqrt(u)
    p = y * cos_a - x * sin_a
    q = x * cos_a + y * sin_a
    G = 2 / root * (0.5 * np.pi + np.arctan(p / root))
    V = (2 + p * G) / u
    F = q / (1 - q * q)  # printed q / (1 - x² - y²)
    scale = -factor * s / u
    return complex(
        scale * (3 * x * V - sin_a * G - 2 * cos_a * F),
        scale * (3 * y * V + cos_a * G - 2 * sin_a * F),
    )  # Eq. (4.38)


@compiled
def film_stiffness(
    position: complex, velocity: complex, drag: complex, clearance: float, surface_speed: float, factor: float
) -> tuple[complex, complex]:
    """Return the change of a film's force with the position in X and in Y, N/m, by finite differences.

    Parameters
    ----------
    position, velocity, clearance, surface_speed, factor : complex and float
        As for ``capone_force``.
    drag : complex
        Change of velocity per change of position, 1/s: 2 / step in the march, i Omega in the turning frame.
    """
    start = capone_force(position, velocity, clearance, surface_speed, factor)
    in_x = -1e-7 * clearance if position.real > 0 else 1e-7 * clearance  # never towards the wall
    in_y = -1e-7 * clearance if position.imag > 0 else 1e-7 * clearance
    of_x = capone_force(position + in_x, velocity + drag * in_x, clearance, surface_speed, factor)
    of_y = capone_force(position + 1j * in_y, velocity + drag * 1j * in_y, clearance, surface_speed, factor)
    return (of_x - start) / in_x, (of_y - start) / in_y


@inlined
def _nearest_wall(films: Films, journals: ComplexArray, rings: ComplexArray) -> float:
    # smallest 1 - eccentricity² of the four films at these positions
    nearest = 1.0
    for b in range(2):
        inner, outer = journals[b] - rings[b], rings[b]
        nearest = min(nearest, 1 - (inner.real**2 + inner.imag**2) / films.inner_clearance**2)
        nearest = min(nearest, 1 - (outer.real**2 + outer.imag**2) / films.outer_clearance**2)
    return nearest


@inlined
def _work(modes: int) -> Work:
    return Work(
        np.zeros((2, 2), np.complex128),
        np.zeros((2, 2), np.complex128),
        np.zeros((2, 2), np.complex128),
        np.zeros((2, 2), np.complex128),
        np.zeros((2, 2), np.complex128),
        np.zeros((2, 2), np.complex128),
        np.zeros((2, 2), np.complex128),
        np.zeros(8),
        np.zeros(8),
        np.zeros((3, modes), np.complex128),
        np.zeros((3, modes), np.complex128),
        np.zeros((3, 2), np.complex128),
    )


@inlined
def _film_forces(films: Films, speed: float, step: float, work: Work) -> None:
    # Velocities and forces where journals and rings are now.
    journals, rings, start_j, start_r = work.journals, work.rings, work.start_journals, work.start_rings
    for b in range(2):
        journals[1, b] = 2 / step * (journals[0, b] - start_j[0, b]) - start_j[1, b]
        rings[1, b] = 2 / step * (rings[0, b] - start_r[0, b]) - start_r[1, b]
        work.forces[0, b] = capone_force(
            journals[0, b] - rings[0, b],
            journals[1, b] - rings[1, b],
            films.inner_clearance,
            films.inner_speed * speed,
            films.inner_factor,
        )
        work.forces[1, b] = capone_force(
            rings[0, b], rings[1, b], films.outer_clearance, films.outer_speed * speed, films.outer_factor
        )


@inlined
def _newton_matrix(films: Films, speed: float, step: float, work: Work, matrix: FloatArray) -> None:
    # left half of ``augmented``: d(residual) / d(journals, rings)
    journals, rings = work.journals, work.rings
    rate, ring_factor = 2 / step, step * step / (4 * films.ring_mass)
    for j in range(8):
        for k in range(16):
            matrix[j, k] = 0.0
        matrix[j, j] = 1.0
    for c in range(2):
        inner = film_stiffness(
            journals[0, c] - rings[0, c],
            journals[1, c] - rings[1, c],
            rate + 0j,
            films.inner_clearance,
            films.inner_speed * speed,
            films.inner_factor,
        )
        outer = film_stiffness(
            rings[0, c], rings[1, c], rate + 0j, films.outer_clearance, films.outer_speed * speed, films.outer_factor
        )
        for k in range(2):
            column = 2 * c + k
            for b in range(2):
                through = work.receptance[b, c] * inner[k]
                matrix[2 * b, column] -= through.real
                matrix[2 * b + 1, column] -= through.imag
                matrix[2 * b, 4 + column] += through.real
                matrix[2 * b + 1, 4 + column] += through.imag
            matrix[4 + 2 * c, column] += ring_factor * inner[k].real
            matrix[5 + 2 * c, column] += ring_factor * inner[k].imag
            matrix[4 + 2 * c, 4 + column] -= ring_factor * (inner[k] + outer[k]).real
            matrix[5 + 2 * c, 4 + column] -= ring_factor * (inner[k] + outer[k]).imag


@inlined
def _invert(augmented: FloatArray) -> None:
    # Gauss and Jordan's method with row pivots: the right half becomes the inverse of the left.
    n = augmented.shape[0]
    for row in range(n):
        augmented[row, n + row] = 1.0
    for column in range(n):
        pivot = column
        for row in range(column + 1, n):
            if abs(augmented[row, column]) > abs(augmented[pivot, column]):
                pivot = row
        for k in range(2 * n):
            augmented[column, k], augmented[pivot, k] = augmented[pivot, k], augmented[column, k]
        scale = 1 / augmented[column, column]
        for k in range(2 * n):
            augmented[column, k] *= scale
        for row in range(n):
            factor = augmented[row, column]
            if row != column:
                for k in range(2 * n):
                    augmented[row, k] -= factor * augmented[column, k]


@inlined
def _miss(films: Films, step: float, work: Work) -> float:
    # Residual at the present journals and rings; returns its largest part, m.
    ring_factor = step * step / (4 * films.ring_mass)
    journals, forces, H = work.journals, work.forces, work.receptance
    size = 0.0
    for b in range(2):
        of_journal = journals[0, b] - work.free[0, b] - H[b, 0] * forces[0, 0] - H[b, 1] * forces[0, 1]
        of_ring = work.rings[0, b] - work.free[1, b] - ring_factor * (forces[1, b] - forces[0, b])
        work.residual[2 * b], work.residual[2 * b + 1] = of_journal.real, of_journal.imag
        work.residual[4 + 2 * b], work.residual[5 + 2 * b] = of_ring.real, of_ring.imag
    for j in range(8):
        size = max(size, abs(work.residual[j]))
    return size


@inlined
def _move(films: Films, augmented: FloatArray, work: Work) -> bool:
    # Newton's step, halved while it would lead to the wall
    journals, rings, change = work.journals, work.rings, work.change
    room = max(WALL, 0.2 * _nearest_wall(films, journals[0], rings[0]))
    for j in range(8):
        change[j] = 0.0
        for k in range(8):
            change[j] -= augmented[j, 8 + k] * work.residual[k]
    fraction = 1.0
    for _ in range(30):
        for b in range(2):
            journals[0, b] += fraction * complex(change[2 * b], change[2 * b + 1])
            rings[0, b] += fraction * complex(change[4 + 2 * b], change[5 + 2 * b])
        if _nearest_wall(films, journals[0], rings[0]) >= room:
            return True
        fraction = -0.5 * fraction if fraction > 0 else 0.5 * fraction  # walk back half of the way
    return False


@inlined
def _solve_films(films: Films, levels: Levels, level: int, state: State, work: Work) -> bool:
    # Find journals and rings, positions and velocities, at the end of the step.
    step, speed = levels.steps[level], state.speed[0]
    journals, rings, start_j, start_r = work.journals, work.rings, work.start_journals, work.start_rings
    for b in range(2):
        journals[0, b], rings[0, b] = start_j[0, b] + step * start_j[1, b], start_r[0, b] + step * start_r[1, b]
    if _nearest_wall(films, journals[0], rings[0]) < WALL:
        for b in range(2):
            journals[0, b], rings[0, b] = start_j[0, b], start_r[0, b]
    last = np.inf
    for _ in range(NEWTON_ITERATIONS):
        _film_forces(films, speed, step, work)
        size = _miss(films, step, work)
        if size < 1e-9 * films.inner_clearance:
            return True
        if state.level[0] != level or size > 0.3 * last:
            _newton_matrix(films, speed, step, work, state.augmented)
            _invert(state.augmented)
            state.level[0] = level
        last = size
        if not _move(films, state.augmented, work):
            return False
    return False


@inlined
def _free_motion(shaft: Shaft, films: Films, levels: Levels, level: int, state: State, work: Work) -> None:
    # Where journals and rings would come to without film forces, and how film forces would move them.
    h, psi = levels.steps[level], levels.journals[level]
    y, compliance = work.modal[1], work.modal[2]
    for b in range(2):
        start, rate, free, own, other = 0j, 0j, 0j, 0j, 0j
        for k in range(y.size):
            start += shaft.journals[b, k] * state.modal[0, k]
            rate += shaft.journals[b, k] * state.modal[1, k]
            free += psi[b, k] * y[k]
            own += psi[b, k] * psi[b, k] * compliance[k]
            other += psi[b, k] * psi[1 - b, k] * compliance[k]
        work.start_journals[0, b], work.start_journals[1, b] = start, rate
        work.free[0, b] = free
        work.receptance[b, b], work.receptance[b, 1 - b] = own, other
        place, rate, acceleration = state.rings[0, b], state.rings[1, b], state.rings[2, b]
        work.start_rings[0, b], work.start_rings[1, b] = place, rate
        work.free[1, b] = place + h * rate + h * h / 4 * (acceleration - 1j * films.gravity)


@inlined
def _step(shaft: Shaft, films: Films, levels: Levels, level: int, state: State, work: Work) -> bool:
    # Newmark's step, beta = 1/4, gamma = 1/2, to the state's angle and speed; False where it has no solution
    h, speed, T = levels.steps[level], state.speed[0], levels.transforms[level]
    q, v, a = state.modal[0], state.modal[1], state.modal[2]
    force, y, compliance = work.modal[0], work.modal[1], work.modal[2]
    imbalance = speed * speed * complex(np.cos(state.angle[0]), np.sin(state.angle[0]))
    rate = 2 / h
    for k in range(q.size):
        y[k] = rate * q[k] + v[k]
    for i in range(q.size):
        turned = 0j
        for j in range(q.size):
            turned += shaft.gyroscopic[i, j] * y[j]
        force[i] = imbalance * shaft.imbalance[i] + shaft.weight[i] + rate * (y[i] + v[i]) + a[i]
        force[i] += speed * complex(turned.imag, -turned.real)  # - i Omega G
    for k in range(q.size):
        lag = speed * levels.gyroscopic[level, k]
        compliance[k] = complex(1, lag) / (1 + lag * lag)
        pushed = 0j
        for i in range(q.size):
            pushed += T[i, k] * force[i]
        y[k] = compliance[k] * pushed
    _free_motion(shaft, films, levels, level, state, work)
    if not _solve_films(films, levels, level, state, work):
        return False
    for k in range(q.size):
        pushed = levels.journals[level, 0, k] * work.forces[0, 0] + levels.journals[level, 1, k] * work.forces[0, 1]
        y[k] += compliance[k] * pushed
    _newmark_end(h, T, y, state)
    for b in range(2):
        state.rings[0, b], state.rings[1, b] = work.rings[0, b], work.rings[1, b]
        state.rings[2, b] = (work.forces[1, b] - work.forces[0, b]) / films.ring_mass - 1j * films.gravity
    return True


@inlined
def _newmark_end(h: float, T: FloatArray, y: ComplexArray, state: State) -> None:
    q, v, a = state.modal[0], state.modal[1], state.modal[2]
    for i in range(q.size):
        end = 0j
        for k in range(q.size):
            end += T[i, k] * y[k]
        change = end - q[i]
        a[i] = 2 / h * (2 / h * change - 2 * v[i]) - a[i]
        v[i] = 2 / h * change - v[i]
        q[i] = end


@inlined
def _copy(source: ComplexArray, target: ComplexArray) -> None:
    # In loops: an assignment of slices takes ten times as long to compile.
    for row in range(source.shape[0]):
        for column in range(source.shape[1]):
            target[row, column] = source[row, column]


@inlined
def _follow(
    shaft: Shaft, films: Films, levels: Levels, level: int, state: State, course: FloatArray, work: Work
) -> bool:
    # One step of the caller's in 4^level parts; course: angle and speed at start and end, (2, 2)
    parts = 4**level
    for part in range(1, parts + 1):
        state.angle[0] = course[0, 0] + (course[1, 0] - course[0, 0]) * part / parts
        state.speed[0] = course[0, 1] + (course[1, 1] - course[0, 1]) * part / parts
        if not _step(shaft, films, levels, level, state, work):
            return False
    return True


@compiled
def march(
    shaft: Shaft,
    films: Films,
    levels: Levels,
    state: State,
    angles: FloatArray,
    speeds: FloatArray,
    displacement: ComplexArray,
) -> int:
    """Follow the shaft through ``angles`` and ``speeds`` at equal steps.

    Where the shaft turns too far in a step, or Newton's method finds no way, the step is divided by four, repeatedly.

    Parameters
    ----------
    shaft, films, levels : Shaft, Films, Levels
        The system and its step.
    state : State
        Where the motion stands; changed.
    angles, speeds : ndarray of float64, shape (n,)
        The shaft's angle, rad, and speed, rad/s, at the ends of the steps.
    displacement : ndarray of complex128, shape (n,)
        Filled with the displacement at the probes' station, m.

    Returns
    -------
    int
        ``NO_FAILURE``, or the step at which no division helped: the motion reached a wall.
    """
    work = _work(shaft.probe.size)
    course = np.empty((2, 2))
    for n in range(angles.size):
        course[0, 0], course[0, 1] = state.angle[0], state.speed[0]
        course[1, 0], course[1, 1] = angles[n], speeds[n]
        level, fastest = 0, max(course[0, 1], course[1, 1])
        while levels.steps[level] * fastest > LARGEST_TURN and level < levels.steps.size - 1:
            level += 1
        _copy(state.modal, work.kept_modal)
        _copy(state.rings, work.kept_rings)
        while not _follow(shaft, films, levels, level, state, course, work):
            _copy(work.kept_modal, state.modal)
            _copy(work.kept_rings, state.rings)
            state.level[0] = NO_LEVEL
            level += 1
            if level == levels.steps.size:
                return n
        displacement[n] = 0j
        for k in range(shaft.probe.size):
            displacement[n] += shaft.probe[k] * state.modal[0, k]
    return NO_FAILURE
