"""The equations of motion written out again, for explicit solvers: compiled, and in NumPy alone.

Nothing of the program's step, matrices or film kernel is in here: only its modes and its films' numbers.
"""

import math
from collections.abc import Callable

import numba
import numpy as np
from numpy.typing import NDArray

from model.parameters import ModelParameters
from model.system import Films, ModalSystem, Shaft

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Rates = Callable[[float, FloatArray], FloatArray]


@numba.njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator, unused-ignore]  # numba has no types
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


@numba.njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator, unused-ignore]  # numba has no types
def _rates(time: float, state: ComplexArray, speed: float, shaft: Shaft, films: Films) -> ComplexArray:
    squares, gyroscopic, journals, _, imbalance, weight = shaft
    m = squares.size
    inner_factor, outer_factor, inner_c, outer_c, inner_spin, outer_spin, mass, gravity = films
    out = np.empty(state.size, np.complex128)
    turning = speed * speed * complex(math.cos(speed * time), math.sin(speed * time))
    for k in range(m):
        out[k] = state[m + 2 + k]
        force = turning * imbalance[k] + weight[k] - squares[k] * state[k]
        for j in range(m):
            force += 1j * speed * gyroscopic[k, j] * state[m + 2 + j]
        out[m + 2 + k] = force
    for b in range(2):
        z, v = 0j, 0j
        for k in range(m):
            z += journals[b, k] * state[k]
            v += journals[b, k] * state[m + 2 + k]
        ring, rate = state[m + b], state[2 * m + 2 + b]
        inner = _film(z - ring, v - rate, inner_c, inner_spin * speed, inner_factor)
        outer = _film(ring, rate, outer_c, outer_spin * speed, outer_factor)
        for k in range(m):
            out[m + 2 + k] += journals[b, k] * inner
        out[m + b] = rate
        out[2 * m + 2 + b] = (outer - inner) / mass - 1j * gravity
    return out


def compiled_rates(parameters: ModelParameters, speed: float, modes: int = 6) -> Rates:
    """Return d(state)/dt at a steady speed, compiled; the state is that of modes and rings, then their velocities."""
    system = ModalSystem.of(parameters, modes)

    def rates(time: float, flat: FloatArray) -> FloatArray:
        found: ComplexArray = _rates(time, flat.view(np.complex128), speed, system.shaft, system.films)
        return found.view(np.float64)

    return rates


def numpy_rates(parameters: ModelParameters, speed: float, modes: int = 6) -> Rates:
    """Return the same in NumPy, as one writes it first."""
    system = ModalSystem.of(parameters, modes)
    shaft, films = system.shaft, system.films

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
        bend = pushed + 1j * speed * shaft.gyroscopic @ v - shaft.squares * q
        return np.concatenate((v, ring_rates, bend, (outer - inner) / films.ring_mass - 1j * films.gravity)).view(
            np.float64
        )

    return rates


def at_rest(modes: int = 6) -> FloatArray:
    """Return the state of a rotor at rest in the bearings' centre."""
    return np.zeros(4 * (modes + 2))
