import numpy as np
import pytest

from model.gj90c import gj90c_rotor
from model.rotor import Rotor, beam_element


def two_stations(**changes: object) -> Rotor:
    sizes: dict[str, object] = {
        "masses": (0.1, 0.2),
        "diametral_inertias": (1e-6, 1e-6),
        "polar_inertias": (2e-6, 2e-6),
        "radii": (4e-3,),
        "lengths": (20e-3,),
        "youngs_modulus": 2e11,
        "bearing_stations": (1, 2),
    }
    return Rotor(**{**sizes, **changes})  # type: ignore[arg-type]  # the cases below are wrong on purpose


def test_beam_element_bends_a_cantilever_as_the_textbook_says() -> None:
    E, radius, length, force = 2e11, 5e-3, 0.1, 3.0
    second_moment = np.pi * radius**4 / 4
    free_end = np.linalg.solve(beam_element(E, radius, length)[2:, 2:], [force, 0.0])
    assert free_end[0] == pytest.approx(force * length**3 / (3 * E * second_moment), rel=1e-12)
    assert free_end[1] == pytest.approx(force * length**2 / (2 * E * second_moment), rel=1e-12)


def test_free_shaft_resists_neither_translation_nor_rotation() -> None:
    rotor = gj90c_rotor()
    stiffness = rotor.stiffness_matrix()
    places = np.concatenate(([0.0], np.cumsum(rotor.lengths)))
    translation = np.tile([1.0, 0.0], rotor.stations)
    rotation = np.ravel(np.column_stack((places, np.ones(rotor.stations))))
    assert np.abs(stiffness @ translation).max() < 1e-9 * stiffness.max()
    assert np.abs(stiffness @ rotation).max() < 1e-9 * stiffness.max()


def test_matrices_carry_masses_and_inertias_by_station() -> None:
    rotor = gj90c_rotor()
    assert np.diag(rotor.mass_matrix())[[0, 1, 8, 9]] == pytest.approx([0.01, 0.2e-6, 0.07, 8e-6])
    assert np.diag(rotor.gyroscopic_matrix())[[0, 1, 8, 9]] == pytest.approx([0, 0.1e-6, 0, 14e-6])
    assert rotor.journals == (4, 6)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"masses": (0.1, 0.0)}, r"masses: 0 kg, expected a finite value above 0"),
        ({"diametral_inertias": (1e-6, -1e-6)}, r"diametral_inertias: -1e-06 kg m²"),
        ({"polar_inertias": (1e-6,)}, r"polar_inertias: 1 values, expected 2"),
        ({"radii": (float("nan"),)}, r"radii: nan m"),
        ({"lengths": (0.02, 0.03)}, r"lengths: 2 values, expected 1"),
        ({"youngs_modulus": 0.0}, r"youngs_modulus: 0 Pa"),
        ({"bearing_stations": (2, 1)}, r"bearing_stations: \(2, 1\), expected two different stations from 1 to 2"),
        ({"bearing_stations": (1, 3)}, r"bearing_stations: \(1, 3\)"),
        ({"masses": (0.1,)}, r"masses: a rotor has two stations or more, got 1"),
    ],
)
def test_rotor_that_cannot_be_is_refused_with_quantity_value_and_unit(changes: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        two_stations(**changes)


def test_station_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ValueError, match="station: 7, expected 1 to 6"):
        gj90c_rotor().displacement(7)
