"""Cost of a turn of the shaft: the compiled Newmark integration and SciPy's LSODA on the same equations."""

import math
import time

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from analysis.signals.header import AnalysisSettings
from analysis.signals.units import RPM
from model.dynamics.modal_system import ModalSystem
from model.dynamics.motion import STEPS_PER_TURN, ShaftMotion
from model.films.film_kernels import capone_force
from model.prediction.prediction_map import compute_prediction_map, default_map_speeds
from model.rotor.gj90c import gj90c

SPEED = 1100.0
TURNS = 10


def lsoda(system: ModalSystem, turns: int) -> float:
    """Return the CPU time of SciPy's LSODA with NumPy matrices and the compiled film force, s."""
    shaft, films, rings = system.shaft, system.films, system.rings
    assert films is not None
    modes = shaft.squared_frequencies.size

    def rates(time_now: float, flat: NDArray[np.float64]) -> NDArray[np.float64]:
        q, z, v, u = np.split(flat.view(np.complex128), [modes, modes + 2, 2 * modes + 2])
        places, velocities = shaft.journals @ q, shaft.journals @ v
        forces = np.empty((2, 2), np.complex128)
        for b in range(2):
            inner = places[b] - z[b], velocities[b] - u[b], films.inner_clearance, films.inner_speed * SPEED
            outer = z[b], u[b], films.outer_clearance, films.outer_speed * SPEED
            forces[0, b] = capone_force(*inner, films.inner_factor)
            forces[1, b] = capone_force(*outer, films.outer_factor)
        pushed = SPEED**2 * np.exp(1j * SPEED * time_now) * shaft.imbalance + shaft.weight
        bend = pushed + shaft.journals.T @ forces[0] + 1j * SPEED * shaft.gyroscopic @ v - shaft.squared_frequencies * q
        ring = (forces[1] - forces[0]) / rings.mass - 1j * rings.gravity
        return np.concatenate((v, u, bend, ring)).view(np.float64)

    begin = time.process_time()
    span = (0.0, turns * 2 * math.pi / SPEED)
    solution = solve_ivp(rates, span, np.zeros(4 * (modes + 2)), "LSODA", rtol=1e-6, atol=1e-11)
    assert solution.success
    return time.process_time() - begin


@pytest.mark.benchmark
def test_newmark_is_100_times_faster_than_lsoda() -> None:
    parameters = gj90c()
    motion = ShaftMotion(parameters, SPEED, 10)
    march = math.inf
    for _ in range(5):
        begin = time.process_time()
        motion.integrate_turns(TURNS * 20)
        march = min(march, (time.process_time() - begin) / 20)
    scipy = min(lsoda(ModalSystem.from_parameters(parameters), TURNS) for _ in range(2))
    step = march / (TURNS * STEPS_PER_TURN)
    print(f"\n{TURNS} turns: march {march * 1e3:.2f} ms ({step * 1e6:.2f} µs a step), LSODA {scipy * 1e3:.0f} ms")
    print(f"ratio {scipy / march:.0f}")
    assert scipy / march > 100


@pytest.mark.benchmark
def test_default_map_takes_less_than_30_seconds() -> None:
    compute_prediction_map(gj90c(), np.array([500.0, 510.0]), AnalysisSettings(), lambda _done, _total: None)
    begin = time.process_time()
    found = compute_prediction_map(
        gj90c(), default_map_speeds(20_000 * RPM), AnalysisSettings(), lambda _done, _total: None
    )
    used = time.process_time() - begin
    begin = time.perf_counter()
    for speed in np.linspace(100.0, 2000.0, 1000):
        found.at(speed)
    looked_up = (time.perf_counter() - begin) / 1000
    print(f"\n{found.speeds.size} speeds: {used:.1f} s of one core; a lookup {looked_up * 1e6:.0f} µs")
    assert used < 30
    assert looked_up < 1e-3
