from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from model.rotor.gj90c import gj90c_rotor
from model.rotor.rotor import Beam, Disc, Rotor, Segment, ShaftMass

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
