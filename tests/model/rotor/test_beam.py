"""Element matrices against integrals of independent shape functions."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from model.rotor.beam import mass_element, rotary_inertia_element, shear_coefficient, stiffness_element

LENGTH = 0.07


def shapes(shear: float) -> tuple[list[Polynomial], list[Polynomial]]:
    """Displacement and rotation of the section along a segment, for a unit of each of its four coordinates.

    A segment loaded at its ends bends as a cubic. The rotation of the section is the slope minus the constant shear
    angle: w' - phi = -w''' shear l² / 12.
    """
    displacements, rotations = [], []
    for unit in np.eye(4):
        rows = []
        for place in (0.0, LENGTH):
            cubic = np.array([1, place, place**2, place**3])
            slope = np.array([0, 1, 2 * place, 3 * place**2])
            sheared = np.array([0, 0, 0, 6 * shear * LENGTH**2 / 12])
            rows += [cubic, slope + sheared]
        w = Polynomial(np.linalg.solve(np.array(rows), unit))
        displacements.append(w)
        rotations.append(w.deriv() + w.deriv(3) * (shear * LENGTH**2 / 12))
    return displacements, rotations


def integrals(functions: list[Polynomial]) -> NDArray[np.float64]:
    products = [[(a * b).integ() for b in functions] for a in functions]
    return np.array([[float(one(LENGTH) - one(0.0)) for one in row] for row in products])


@pytest.mark.parametrize("shear", [0.0, 0.3, 2.0])
def test_masses_and_inertias_are_the_integrals_of_the_shape_functions(shear: float) -> None:
    displacements, rotations = shapes(shear)
    assert mass_element(3.0, LENGTH, shear) == pytest.approx(3 * integrals(displacements), rel=1e-9, abs=1e-15)
    assert rotary_inertia_element(2e-3, LENGTH, shear) == pytest.approx(
        2e-3 * integrals(rotations), rel=1e-9, abs=1e-15
    )


@pytest.mark.parametrize("shear", [0.0, 0.3, 2.0])
def test_stiffness_is_the_integral_of_bending_and_shear(shear: float) -> None:
    displacements, rotations = shapes(shear)
    bending = 40.0 * integrals([one.deriv() for one in rotations])
    angles = [w.deriv() - turn for w, turn in zip(displacements, rotations, strict=True)]
    of_shear = 12 * 40.0 / (shear * LENGTH**2) * integrals(angles) if shear else np.zeros((4, 4))
    assert stiffness_element(40.0, LENGTH, shear) == pytest.approx(bending + of_shear, rel=1e-9)


def test_cantilever_deflection_is_the_textbook_value() -> None:
    force, bending_stiffness, shear = 3.0, 40.0, 0.3
    free_end = np.linalg.solve(stiffness_element(bending_stiffness, LENGTH, shear)[2:, 2:], [force, 0.0])
    bent = force * LENGTH**3 / (3 * bending_stiffness)
    assert free_end[0] == pytest.approx(bent * (1 + shear / 4), rel=1e-12)
    assert free_end[1] == pytest.approx(force * LENGTH**2 / (2 * bending_stiffness), rel=1e-12)


def test_shear_coefficient_is_that_of_cowper() -> None:
    assert shear_coefficient(0.3, 1.0) == pytest.approx(0.886, abs=5e-4)  # solid: 6 (1 + nu) / (7 + 6 nu)
    assert shear_coefficient(0.3, 1.0, 0.9999) == pytest.approx(0.531, abs=2e-3)  # thin tube: 2 (1 + nu) / (4 + 3 nu)
