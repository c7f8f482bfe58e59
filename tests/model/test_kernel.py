import inspect
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import FunctionType, ModuleType

import numpy as np
import pytest
from numpy.typing import NDArray

import model.kernel as kernel_module
from model.kernel import LARGEST_TURN, NO_FAILURE, compiled, march
from model.parameters import ModelParameters
from model.system import ModalSystem

ROOT = Path(__file__).parents[2]


def interpreted(module: ModuleType) -> Callable[..., int]:
    """The kernel's march with everything it calls run by the interpreter instead of compiled code."""
    names = vars(module).copy()
    for name, value in list(names.items()):
        plain = inspect.unwrap(value) if callable(value) and hasattr(value, "py_func") else None
        if isinstance(plain, FunctionType):
            names[name] = FunctionType(plain.__code__, names, name, plain.__defaults__)
    found = names["march"]
    assert isinstance(found, FunctionType)
    return found


def run(
    marching: Callable[..., int], system: ModalSystem, speeds: NDArray[np.float64], step: float
) -> tuple[int, NDArray[np.complex128]]:
    state = system.at_rest(angle=0.0, speed=float(speeds[0]))
    path = np.zeros(speeds.size, np.complex128)
    result = marching(system.shaft, system.films, system.levels(step), state, np.cumsum(speeds) * step, speeds, path)
    return result, path


def test_compiled_march_equals_the_interpreted_one(default: ModelParameters) -> None:
    system = ModalSystem.of(default)
    speeds = np.linspace(900, 1100, 60)
    fine = 0.5 * LARGEST_TURN / 1100
    for step in (fine, 3 * fine):  # the second is divided inside
        expected = run(march, system, speeds, step)
        found = run(interpreted(kernel_module), system, speeds, step)
        assert found[0] == expected[0] == NO_FAILURE
        assert found[1] == pytest.approx(expected[1], rel=1e-6, abs=1e-13)


def test_march_without_a_way_on_says_at_which_step(default: ModelParameters) -> None:
    system = ModalSystem.of(default)
    dry = ModalSystem(system.shaft, system.films._replace(inner_factor=1e-12, outer_factor=1e-12))
    expected = run(march, dry, np.full(400, 10.0), 1e-3)
    found = run(interpreted(kernel_module), dry, np.full(400, 10.0), 1e-3)
    assert 0 <= expected[0] < 400
    assert found[0] == expected[0]


def test_nothing_is_compiled_when_the_kernel_is_imported() -> None:
    # in a fresh interpreter: this one has compiled already
    code = "import model.kernel as k; print([len(f.signatures) for f in (k.march, k.capone_force, k.film_stiffness)])"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert shown.stdout.strip() == "[0, 0, 0]"


def test_function_that_cannot_be_kept_on_disk_is_compiled_all_the_same() -> None:
    names: dict[str, Callable[[float], float]] = {}
    exec("def double(x):\n    return 2 * x", names)  # noqa: S102  # a function without a file has nowhere to be kept
    double = compiled(names["double"])
    assert double is not names["double"]
    assert double(1.5) == 3.0
