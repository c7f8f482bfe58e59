import inspect
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import FunctionType

import numpy as np
import pytest
from numpy.typing import NDArray

import model.dynamics.condensed as condensed_module
import model.dynamics.condensed as forces_module
import model.dynamics.newmark as kernel_module
import model.films.film_kernels as film_module
from model.compiling import Compiler
from model.dynamics.modal_system import ModalSystem
from model.dynamics.newmark import MAX_SUBSTEP_ANGLE, NO_FAILURE, integrate
from model.rotor.parameters import ModelParameters
from model.rotor.supports import Rub, Support, SupportCoefficients

ROOT = Path(__file__).parents[3]


def interpreted() -> Callable[..., int]:
    """`newmark.integrate` with all functions it calls, interpreted instead of compiled."""
    names: dict[str, object] = {}
    for module in (film_module, forces_module, condensed_module, kernel_module):
        names |= vars(module)
    for name, value in list(names.items()):
        plain = inspect.unwrap(value) if callable(value) and hasattr(value, "py_func") else None
        if isinstance(plain, FunctionType):
            names[name] = FunctionType(plain.__code__, names, name, plain.__defaults__)
    found = names["integrate"]
    assert isinstance(found, FunctionType)
    return found


def run(
    integrate: Callable[..., int], system: ModalSystem, speeds: NDArray[np.float64], step: float
) -> tuple[int, NDArray[np.complex128]]:
    state = system.at_rest(angle=0.0, speed=float(speeds[0]))
    path = np.zeros((system.stations.shape[0], speeds.size), np.complex128)
    history = np.stack((np.cumsum(speeds) * step, speeds))
    result = integrate(system.parts, system.constraints, system.matrices(step), state, history, system.stations, path)
    return result, path


@pytest.mark.parametrize("constrained", [False, True])
def test_compiled_integration_equals_the_interpreted_one(default: ModelParameters, *, constrained: bool) -> None:
    film = SupportCoefficients(((1e5, 2e4), (0.0, 1e5)), ((20.0, 0.0), (0.0, 20.0)))
    supports = (Support(1, film), Support(6, film, film, 0.01))
    parameters = replace(default, supports=supports, rubs=(Rub(5, 1e-6, 1e6, 0.02, 0.1, 0.5),))
    system = ModalSystem.from_parameters(parameters if constrained else default)
    speeds = np.linspace(900, 1100, 60)
    fine = 0.5 * MAX_SUBSTEP_ANGLE / 1100
    for step in (fine, 3 * fine):  # the second is divided internally
        expected = run(integrate, system, speeds, step)
        found = run(interpreted(), system, speeds, step)
        assert found[0] == expected[0] == NO_FAILURE
        assert found[1] == pytest.approx(expected[1], rel=1e-6, abs=1e-13)
        assert np.abs(found[1][4]).max() > 1e-6  # contact with the wall


def test_failed_integration_returns_the_index_of_the_step(default: ModelParameters) -> None:
    system = ModalSystem.from_parameters(default)
    assert system.films is not None
    dry = replace(system, films=system.films._replace(inner_factor=1e-12, outer_factor=1e-12))
    expected = run(integrate, dry, np.full(400, 10.0), 1e-3)
    found = run(interpreted(), dry, np.full(400, 10.0), 1e-3)
    assert 0 <= expected[0] < 400
    assert found[0] == expected[0]


def test_nothing_is_compiled_on_import() -> None:
    # in a fresh interpreter: this one has compiled already
    code = (
        "import model.dynamics.newmark as k, model.dynamics.rotating_frame as c; "
        "functions = k.integrate, c.rotating_motion, c.disturbance, c.film_derivatives; "
        "print([len(f.signatures) for f in functions])"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert shown.stdout.strip() == "[0, 0, 0, 0]"


def test_function_without_cache_is_compiled() -> None:
    names: dict[str, Callable[[float], float]] = {}
    exec("def double(x):\n    return 2 * x", names)  # noqa: S102  # a function without a file cannot be cached
    double = Compiler().compiled(names["double"])
    assert double is not names["double"]
    assert double(1.5) == 3.0
