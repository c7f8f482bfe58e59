"""Chapter 3 of the thesis: equilibria, cavities and oil flow, with and without the two calibrations.

Stated numbers without force balance (zeros of the pressure difference at 187 and 343 degrees, starvation
speeds, flows of 6, 7 and 8e-4 kg/s) are listed as not reproduced in ``studies.thesis.chapter_3`` and not tested here.
"""

import numpy as np
import pytest

from model.films.lubrication import nominal_lubrication, thesis_like_lubrication

LOADS = (10.0, 20.0, 30.0)  # N


def test_ring_speed_is_that_of_the_drag_balance_of_table_3_1() -> None:
    assert nominal_lubrication().bearing.ring_speed_ratio == pytest.approx(0.5931, abs=5e-5)


@pytest.mark.parametrize(
    ("inlet_pressure", "speeds"),
    [(1e5, (119, 327, 586)), (2e5, (84, 235, 427)), (3e5, (69, 192, 351))],
)
def test_nominal_outer_film_is_complete_above_these_speeds(inlet_pressure: float, speeds: tuple[float, ...]) -> None:
    found = [nominal_lubrication().cavity_free_speed(load, inlet_pressure) for load in LOADS]
    assert found == pytest.approx(speeds, abs=1)


@pytest.mark.parametrize(
    ("inlet_pressure", "speeds"),
    [(1e5, (1222, 3329, 6017)), (2e5, (896, 2436, 4378)), (3e5, (744, 2034, 3651))],
)
def test_thesis_like_outer_film_is_complete_above_these_speeds(
    inlet_pressure: float, speeds: tuple[float, ...]
) -> None:
    found = [thesis_like_lubrication().cavity_free_speed(load, inlet_pressure) for load in LOADS]
    assert found == pytest.approx(speeds, abs=1)


@pytest.mark.parametrize("load", LOADS)
def test_cavity_free_speed_is_where_the_equilibrium_becomes_complete(load: float) -> None:
    for lubrication in (nominal_lubrication(), thesis_like_lubrication()):
        threshold = lubrication.cavity_free_speed(load, 1e5)
        assert not lubrication.equilibrium(load, threshold - 1, 1e5).outer.is_complete
        assert lubrication.equilibrium(load, threshold + 1, 1e5).outer.is_complete


@pytest.mark.parametrize(
    ("load", "eccentricity", "attitude", "stated_attitude", "rupture"),
    [(10.0, 0.12, 89.7, 90, 349.6), (20.0, 0.23, 88.6, 89, 338.1), (30.0, 0.35, 86.3, 87, 324.9)],
)
def test_thesis_like_journal_has_the_equilibrium_of_figure_3_3(
    load: float, eccentricity: float, attitude: float, stated_attitude: float, rupture: float
) -> None:
    film = thesis_like_lubrication().equilibrium(load, 1000.0, 1e5).inner
    assert film.eccentricity == pytest.approx(eccentricity, abs=0.005)
    assert np.degrees(film.attitude) == pytest.approx(attitude, abs=0.06)
    assert np.degrees(film.attitude) == pytest.approx(stated_attitude, abs=0.8)
    assert film.rupture is not None
    assert np.degrees(film.rupture) == pytest.approx(rupture, abs=0.1)
    assert 324.5 <= np.degrees(film.rupture) <= 360  # the axis of Fig. 3.6


def test_nominal_eccentricities_are_those_of_the_table_taken_literally() -> None:
    rests = [nominal_lubrication().equilibrium(load, 1000.0, 1e5) for load in LOADS]
    assert [rest.inner.eccentricity for rest in rests] == pytest.approx([0.0089, 0.0177, 0.0266], abs=5e-5)
    assert [rest.outer.eccentricity for rest in rests] == pytest.approx([0.142, 0.280, 0.415], abs=5e-4)
    faster = [nominal_lubrication().equilibrium(load, 3000.0, 1e5).outer.eccentricity for load in LOADS]
    assert faster == pytest.approx([0.047, 0.094, 0.140], abs=6e-4)


def test_thesis_like_outer_film_ruptures_near_the_stated_280_degrees() -> None:
    film = thesis_like_lubrication().equilibrium(30.0, 3000.0, 2e5).outer
    assert film.rupture is not None
    assert film.reformation is not None
    assert np.degrees(film.rupture) == pytest.approx(290.4, abs=0.5)
    assert np.degrees(film.reformation) == pytest.approx(339.0, abs=0.5)


def test_inner_film_always_has_a_cavity_as_figure_3_6_states() -> None:
    for speed in (1000.0, 3500.0, 6000.0):
        for load in LOADS:
            assert not thesis_like_lubrication().equilibrium(load, speed, 1e5).inner.is_complete


def test_outer_attitude_approaches_90_degrees_with_inlet_pressure_and_speed() -> None:
    speeds = (1000.0, 2000.0, 3000.0, 4000.0)
    attitudes = [thesis_like_lubrication().equilibrium(20.0, speed, 1e5).outer.attitude for speed in speeds]
    assert np.all(np.diff(attitudes) > 0)
    by_pressure = [
        thesis_like_lubrication().equilibrium(30.0, 3000.0, pressure).outer.attitude for pressure in (1e5, 2e5, 3e5)
    ]
    assert np.all(np.diff(by_pressure) > 0)
    eccentricities = [thesis_like_lubrication().equilibrium(20.0, speed, 1e5).outer.eccentricity for speed in speeds]
    assert np.all(np.diff(eccentricities) < 0)


def test_flow_over_a_turn_has_extremes_near_the_stated_15_and_40_degrees() -> None:
    angles = np.arange(0.0, 60.0, 0.25)
    flow = thesis_like_lubrication().equilibrium(10.0, 3000.0, 2e5).flow(np.radians(angles))
    assert angles[np.argmax(flow)] == pytest.approx(10, abs=1)
    assert angles[np.argmin(flow)] == pytest.approx(40, abs=1)


def test_nominal_flow_is_inwards_at_all_loads_and_speeds() -> None:
    for speed in (1000.0, 3000.0, 6000.0):
        for load in LOADS:
            assert nominal_lubrication().equilibrium(load, speed, 1e5).mean_flow() > 0


def test_nominal_flows_at_1000_rad_s_have_the_ratio_2_to_6_to_8() -> None:
    sums = [
        nominal_lubrication().equilibrium(30.0, 1000.0, p).mean_flow() / nominal_lubrication().flow_scale
        for p in (1e5, 2e5, 3e5)
    ]
    assert sums == pytest.approx([737, 2155, 2886], rel=0.005)
