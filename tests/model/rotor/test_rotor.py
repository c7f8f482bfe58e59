from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from model.rotor.gj90c import gj90c_rotor
from model.rotor.rotor import (
    Beam,
    Disc,
    Rotor,
    Segment,
    ShaftMass,
    mass_element,
    rotary_inertia_element,
    shear_coefficient,
    stiffness_element,
)

STEEL = Segment(length=20e-3, radius=4e-3, youngs_modulus=2e11, density=7800.0)


def two_stations(**changes: object) -> Rotor:
    discs = (Disc(1, 0.1, 1e-6, 2e-6), Disc(2, 0.2, 1e-6, 2e-6))
    sizes: dict[str, object] = {"segments": (STEEL,), "discs": discs, "bearing_stations": (1, 2)}
    return Rotor(**{**sizes, **changes})  # type: ignore[arg-type]  # the cases below are wrong on purpose


def rigid_motions(rotor: Rotor) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rotation = np.ravel(np.column_stack((rotor.positions, np.ones(rotor.stations))))
    return rotor.translation, rotation


@pytest.mark.parametrize("beam", list(Beam))
def test_stiffness_of_a_free_shaft_vanishes_for_rigid_body_motion(beam: Beam) -> None:
    stiffness = replace(gj90c_rotor(), beam=beam).stiffness_matrix()
    for motion in rigid_motions(gj90c_rotor()):
        assert np.abs(stiffness @ motion).max() < 1e-9 * stiffness.max()


def test_matrices_carry_masses_and_inertias_by_station() -> None:
    rotor = gj90c_rotor()
    assert np.diag(rotor.mass_matrix())[[0, 1, 8, 9]] == pytest.approx([0.01, 0.2e-6, 0.07, 8e-6])
    assert np.diag(rotor.gyroscopic_matrix())[[0, 1, 8, 9]] == pytest.approx([0, 0.1e-6, 0, 14e-6])
    assert rotor.journals == (4, 6)
    assert rotor.mass == pytest.approx(0.185)


@pytest.mark.parametrize("beam", list(Beam))
@pytest.mark.parametrize("shaft_mass", [ShaftMass.LUMPED, ShaftMass.CONSISTENT])
def test_shaft_has_mass_and_inertias_of_a_tube_for_every_mass_distribution(beam: Beam, shaft_mass: ShaftMass) -> None:
    tube = replace(STEEL, inner_radius=2e-3)
    rotor = two_stations(segments=(tube, tube, tube), shaft_mass=shaft_mass, beam=beam, discs=())
    mass = 7800 * np.pi * (4e-3**2 - 2e-3**2) * 60e-3
    about_axis = mass * (4e-3**2 + 2e-3**2) / 2
    about_end = mass * ((4e-3**2 + 2e-3**2) / 4 + 60e-3**2 / 3)
    translation, rotation = rigid_motions(rotor)
    assert rotor.mass == pytest.approx(mass)
    assert translation @ rotor.mass_matrix() @ translation == pytest.approx(mass)
    assert rotation @ rotor.gyroscopic_matrix() @ rotation == pytest.approx(about_axis)
    if shaft_mass is ShaftMass.CONSISTENT:
        assert rotation @ rotor.mass_matrix() @ rotation == pytest.approx(about_end)
    else:  # mass lumped at four points is further from the centre than distributed mass
        assert about_end < rotation @ rotor.mass_matrix() @ rotation < 1.08 * about_end


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"segments": ()}, r"segments: none, expected one or more"),
        ({"discs": (Disc(1, 0.1, 1e-6, 2e-6),)}, r"disc: none at station 2, expected one at every station"),
        ({"discs": (Disc(3, 0.1, 1e-6, 2e-6),)}, r"disc: station 3, expected 1 to 2"),
        ({"bearing_stations": (2, 1)}, r"bearing_stations: \(2, 1\), expected two different stations from 1 to 2"),
        ({"bearing_stations": (1, 3)}, r"bearing_stations: \(1, 3\)"),
        (
            {"segments": (replace(STEEL, density=0.0),), "shaft_mass": ShaftMass.LUMPED},
            r"density: 0 kg/m³ in segment 1, expected above 0 with shaft_mass lumped",
        ),
    ],
)
def test_invalid_rotor_is_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        two_stations(**changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"length": -0.1}, r"length: -0.1 m, expected a finite value above 0"),
        ({"radius": float("nan")}, r"radius: nan m"),
        ({"youngs_modulus": 0.0}, r"youngs_modulus: 0 Pa"),
        ({"inner_radius": 4e-3}, r"inner_radius: 0.004 m, expected 0 to less than 0.004 m"),
        ({"density": -1.0}, r"density: -1 kg/m³"),
        ({"poissons_ratio": 0.6}, r"poissons_ratio: 0.6, expected 0 to 0.5"),
    ],
)
def test_invalid_segment_is_refused_with_quantity_value_and_unit(changes: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(STEEL, **changes)


@pytest.mark.parametrize(
    ("sizes", "message"),
    [
        ((0.0, 1e-6, 1e-6), r"mass of the disc at station 1: 0 kg, expected a finite value above 0"),
        ((0.1, -1e-6, 1e-6), r"diametral_inertia of the disc at station 1: -1e-06 kg m²"),
        ((0.1, 1e-6, 0.0), r"polar_inertia of the disc at station 1: 0 kg m²"),
    ],
)
def test_invalid_disc_is_refused(sizes: tuple[float, float, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Disc(1, *sizes)


def test_station_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ValueError, match="station: 7, expected 1 to 6"):
        gj90c_rotor().displacement(7)


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
