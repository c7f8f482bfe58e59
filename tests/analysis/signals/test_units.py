"""Units and phase lag: closed forms, and one definition for all packages."""

import ast
import math
import re
from pathlib import Path

import numpy as np
import pytest

from analysis.signals import units
from analysis.signals.units import (
    MICROMETRE,
    MICROSECOND,
    MILLIMETRE,
    MILLISECOND,
    MILLIVOLT,
    RPM,
    phase_lag_degrees,
)

ROOT = Path(__file__).parents[3]
SOURCES = [
    path
    for package in ("analysis", "daq", "model", "recordings", "tests")
    for path in sorted((ROOT / package).rglob("*.py"))
    if path not in (Path(units.__file__), Path(__file__))
]
UNIT_NAME = re.compile(r"_*(TO_|PER_)?(RPM|MICRO|MILLI|MICROMETRE|MILLIMETRE|MICROSECOND|MILLISECOND|MILLIVOLT)")
RPM_LITERAL = re.compile(r"\b[36]0(\.0)? / \(?(2(\.0)? \* )?(math|np)\.pi|(math|np)\.pi( \* [\d_.]+)? / [36]0\b")


def test_constants_are_the_si_value_of_their_unit() -> None:
    assert math.isclose(60.0 * RPM, 2.0 * math.pi, rel_tol=1e-15)  # one revolution per second
    assert math.isclose(12_000.0 * RPM, 400.0 * math.pi, rel_tol=1e-15)
    assert (MILLIMETRE, MILLISECOND, MILLIVOLT) == (1e-3, 1e-3, 1e-3)
    assert (MICROMETRE, MICROSECOND) == (1e-6, 1e-6)


@pytest.mark.parametrize("lag", [0.0, 1.0, 90.0, 180.0, 270.0, 359.0])
def test_phase_lag_of_a_scalar_is_minus_its_argument(lag: float) -> None:
    vector = 3e-6 * complex(math.cos(math.radians(lag)), -math.sin(math.radians(lag)))
    assert phase_lag_degrees(vector) == pytest.approx(lag, abs=1e-12)
    assert isinstance(phase_lag_degrees(vector), float)


def test_phase_lag_of_an_array_has_its_shape() -> None:
    lags = np.arange(0.0, 360.0, 15.0).reshape(2, 3, 4)
    np.testing.assert_allclose(phase_lag_degrees(np.exp(-1j * np.radians(lags))), lags, atol=1e-12)


def test_phase_lag_stays_below_360_degrees() -> None:
    assert phase_lag_degrees(complex(1.0, 1e-20)) == 0.0
    assert phase_lag_degrees(complex(-1.0, -0.0)) == phase_lag_degrees(complex(-1.0, 0.0)) == 180.0


def test_phase_lag_is_nan_without_a_direction() -> None:
    vectors = np.array([0.0, complex(math.nan, 1.0), complex(math.inf, 0.0), 1.0])
    np.testing.assert_array_equal(phase_lag_degrees(vectors), [math.nan, math.nan, math.nan, 0.0])


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_units_are_defined_in_no_other_module(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    targets = [
        target
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Assign | ast.AnnAssign)
        for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
    ]
    names = [target.id for target in targets if isinstance(target, ast.Name)]
    assert not [name for name in names if UNIT_NAME.fullmatch(name)], "import it from analysis.signals.units"
    assert not RPM_LITERAL.search(text), "divide by or multiply with RPM of analysis.signals.units"
