"""Independent equations of motion for explicit solvers: compiled, and in NumPy.

They use the modes and film parameters of the program, but not its time step, matrices or film kernel.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from model.compiling import Compiler
from model.dynamics import modal_system
from model.dynamics.modal_system import Films, ModalShaft, ModalSystem, Rings
from model.rotor.parameters import ModelParameters

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Rates = Callable[[float, FloatArray], FloatArray]

compiler = Compiler(modal_system)


@compiler.compiled
def _film(z: complex, v: complex, clearance: float, spin: float, factor: float) -> complex:
    x, y = z.real / clearance, z.imag / clearance
    a, b = spin * x - 2 * v.imag / clearance, spin * y + 2 * v.real / clearance
    s = math.hypot(a, b)
    if s == 0:
        return 0j
    alpha = math.atan2(-b, -a)
    u = 1 - x * x - y * y
    p, q = y * math.cos(alpha) - x * math.sin(alpha), x * math.cos(alpha) + y * math.sin(alpha)
    g = 2 / math.sqrt(u) * (math.pi / 2 + math.atan(p / math.sqrt(u)))
    turned = 3 * complex(x, y) * (2 + p * g) / u + complex(-math.sin(alpha), math.cos(alpha)) * g
    return -factor * s / u * (turned - 2 * complex(math.cos(alpha), math.sin(alpha)) * q / (1 - q * q))


@compiler.compiled
def _rates(
    time: float, state: ComplexArray, speed: float, shaft: ModalShaft, films: Films, rings: Rings
) -> ComplexArray:
    squared_frequencies, gyroscopic, journals, _, imbalance, weight, _, _ = shaft
    m, n = squared_frequencies.size, state.size // 2  # modes; modes and rings
    inner_factor, outer_factor, inner_c, outer_c, inner_spin, outer_spin, _ = films
    out = np.empty(state.size, np.complex128)
    turning = speed * speed * complex(math.cos(speed * time), math.sin(speed * time))
    for k in range(m):
        out[k] = state[n + k]
        force = turning * imbalance[k] + weight[k] - squared_frequencies[k] * state[k]
        for j in range(m):
            force += 1j * speed * gyroscopic[k, j] * state[n + j]
        out[n + k] = force
    for b in range(2):
        z, v = 0j, 0j
        for k in range(m):
            z += journals[b, k] * state[k]
            v += journals[b, k] * state[n + k]
        ring, rate = state[m + b], state[n + m + b]
        inner = _film(z - ring, v - rate, inner_c, inner_spin * speed, inner_factor)
        outer = _film(ring, rate, outer_c, outer_spin * speed, outer_factor)
        for k in range(m):
            out[n + k] += journals[b, k] * inner
        out[m + b] = rate
        out[n + m + b] = (outer - inner) / rings.mass[b] - 1j * rings.gravity[b]
    return out


def compiled_rates(parameters: ModelParameters, speed: float, modes: int = 6) -> Rates:
    """Return d(state)/dt at a constant speed, compiled; the state holds modes and rings, then their velocities."""
    system = ModalSystem.from_parameters(parameters, modes)
    films = system.films
    assert films is not None

    def rates(time: float, flat: FloatArray) -> FloatArray:
        found: ComplexArray = _rates(time, flat.view(np.complex128), speed, system.shaft, films, system.rings)
        return found.view(np.float64)

    return rates


@compiler.compiled
def _hold(
    out: ComplexArray, state: ComplexArray, m: int, shapes: FloatArray, matrices: FloatArray, rings: FloatArray
) -> None:
    # linear supports; rings: index, mass and gravity for each support, index < 0 for none
    n = state.size // 2
    for s in range(shapes.shape[0]):
        z, v = 0j, 0j
        for k in range(m):
            z += shapes[s, k] * state[k]
            v += shapes[s, k] * state[n + k]
        r = m + int(rings[s, 0])
        if rings[s, 0] >= 0:
            z, v = z - state[r], v - state[n + r]
        x, y, xr, yr = z.real, z.imag, v.real, v.imag
        K, C = matrices[s, 0], matrices[s, 1]
        pull_x = -(K[0, 0] * x + K[0, 1] * y + C[0, 0] * xr + C[0, 1] * yr)
        pull_y = -(K[1, 0] * x + K[1, 1] * y + C[1, 0] * xr + C[1, 1] * yr)
        for k in range(m):
            out[n + k] += shapes[s, k] * complex(pull_x, pull_y)
        if rings[s, 0] >= 0:
            x, y, xr, yr = state[r].real, state[r].imag, state[n + r].real, state[n + r].imag
            K, C = matrices[s, 2], matrices[s, 3]
            pull_x = -(K[0, 0] * x + K[0, 1] * y + C[0, 0] * xr + C[0, 1] * yr) - pull_x
            pull_y = -(K[1, 0] * x + K[1, 1] * y + C[1, 0] * xr + C[1, 1] * yr) - pull_y
            out[r] = state[n + r]
            out[n + r] = complex(pull_x, pull_y) / rings[s, 1] - 1j * rings[s, 2]


@compiler.compiled
def _rub(out: ComplexArray, state: ComplexArray, m: int, speed: float, shapes: FloatArray, walls: FloatArray) -> None:
    # walls: clearance, stiffness, radius, friction, damping of each
    n = state.size // 2
    for w in range(shapes.shape[0]):
        z, v = 0j, 0j
        for k in range(m):
            z += shapes[w, k] * state[k]
            v += shapes[w, k] * state[n + k]
        clearance, stiffness, radius, friction, damping = walls[w]
        depth = math.hypot(z.real, z.imag) - clearance
        if depth > 0:
            angle = math.atan2(z.imag, z.real)
            inwards = v.real * math.cos(angle) + v.imag * math.sin(angle)
            along = v.imag * math.cos(angle) - v.real * math.sin(angle) + speed * radius
            press = max(stiffness * depth * (1 + damping * inwards), 0.0)
            drag = friction * press * along / math.hypot(along, 1e-3)
            pull_x = -press * math.cos(angle) + drag * math.sin(angle)
            pull_y = -press * math.sin(angle) - drag * math.cos(angle)
            for k in range(m):
                out[n + k] += shapes[w, k] * complex(pull_x, pull_y)


def constrained_rates(parameters: ModelParameters, speed: float, modes: int) -> Rates:
    """Return d(state)/dt with linear supports and walls; rings of supports follow the floating rings."""
    system = ModalSystem.from_parameters(parameters, modes)
    supports, rubs = parameters.supports, parameters.rubs
    supported = system.stations[[one.station - 1 for one in supports]]
    matrices = np.zeros((len(supports), 4, 2, 2))
    rings, last = np.full((len(supports), 3), -1.0), 1
    for s, one in enumerate(supports):
        matrices[s, :2] = one.inner.stiffness, one.inner.damping
        if one.outer is not None:
            last += 1
            matrices[s, 2:] = one.outer.stiffness, one.outer.damping
            rings[s] = last, one.ring_mass, parameters.gravity
    films = system.films
    assert films is not None
    touched = system.stations[[one.station - 1 for one in rubs]]
    walls = np.array([(w.clearance, w.stiffness, w.radius, w.friction, w.damping) for w in rubs]).reshape(-1, 5)

    def rates(time: float, flat: FloatArray) -> FloatArray:
        state = flat.view(np.complex128)
        found: ComplexArray = _rates(time, state, speed, system.shaft, films, system.rings)
        _hold(found, state, modes, supported, matrices, rings)
        _rub(found, state, modes, speed, touched, walls)
        return found.view(np.float64)

    return rates


def numpy_rates(parameters: ModelParameters, speed: float, modes: int = 6) -> Rates:
    """Return d(state)/dt in plain NumPy."""
    system = ModalSystem.from_parameters(parameters, modes)
    shaft, films = system.shaft, system.films
    assert films is not None

    def film(z: ComplexArray, v: ComplexArray, clearance: float, spin: float, factor: float) -> ComplexArray:
        place, rate = z / clearance, v / clearance
        turning = spin * place + 2j * rate
        s, alpha = np.abs(turning), np.angle(-turning)
        u = 1 - np.abs(place) ** 2
        along = np.exp(1j * alpha)
        q, p = (place * along.conj()).real, (place * along.conj()).imag
        g = 2 / np.sqrt(u) * (np.pi / 2 + np.arctan(p / np.sqrt(u)))
        force = 3 * place * (2 + p * g) / u + 1j * along * g - 2 * along * q / (1 - q**2)
        return np.asarray(-factor * s / u * force)

    def rates(time: float, flat: FloatArray) -> FloatArray:
        with np.errstate(invalid="ignore", divide="ignore"):  # an explicit solver tries steps into the wall
            return rates_within(time, flat)

    def rates_within(time: float, flat: FloatArray) -> FloatArray:
        q, rings, v, ring_rates = np.split(flat.view(np.complex128), [modes, modes + 2, 2 * modes + 2])
        apart, closing = shaft.journals @ q - rings, shaft.journals @ v - ring_rates
        inner = film(apart, closing, films.inner_clearance, films.inner_speed * speed, films.inner_factor)
        outer = film(rings, ring_rates, films.outer_clearance, films.outer_speed * speed, films.outer_factor)
        pushed = speed**2 * np.exp(1j * speed * time) * shaft.imbalance + shaft.weight + shaft.journals.T @ inner
        bend = pushed + 1j * speed * shaft.gyroscopic @ v - shaft.squared_frequencies * q
        ring_pull = (outer - inner) / system.rings.mass - 1j * system.rings.gravity
        return np.concatenate((v, ring_rates, bend, ring_pull)).view(np.float64)

    return rates


def at_rest(modes: int = 6, rings: int = 2) -> FloatArray:
    """Return the state of a rotor at rest in the bearing centre."""
    return np.zeros(4 * (modes + rings))
