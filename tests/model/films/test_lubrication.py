"""Equilibrium of journal and ring, and oil flow through the holes of the ring."""

import math
from dataclasses import replace

import numpy as np
import pytest

from model.errors import EquilibriumError
from model.films.long_film import film_equilibrium
from model.films.lubrication import Lubrication, nominal_lubrication, table_3_1, thesis_like_lubrication

STEP = math.radians(0.5)
PSI = np.arange(720) * STEP
TURN = 2 * math.pi


@pytest.mark.parametrize(
    "lubrication", [nominal_lubrication(), thesis_like_lubrication()], ids=["nominal", "thesis_like"]
)
@pytest.mark.parametrize("load", [10.0, 30.0])
@pytest.mark.parametrize("speed", [300.0, 1000.0, 4000.0])
@pytest.mark.parametrize("inlet_pressure", [0.0, 2e5])
def test_pressures_of_both_films_balance_their_loads(
    lubrication: Lubrication, load: float, speed: float, inlet_pressure: float
) -> None:
    bearing = lubrication.bearing
    rest = lubrication.equilibrium(load, speed, inlet_pressure)
    weight = bearing.ring_mass * lubrication.gravity
    films = (
        (rest.inner, lubrication.load_factor * load, bearing.journal_radius),
        (rest.outer, lubrication.load_factor * load + weight, bearing.ring_outer_radius),
    )
    for film, surface_flow, radius in films:
        pressure = film.pressure(PSI)
        element = bearing.length * radius * STEP
        assert -np.sum(pressure * np.cos(PSI)) * element == pytest.approx(surface_flow, rel=2e-3)
        assert np.sum(pressure * np.sin(PSI)) * element == pytest.approx(0.0, abs=2e-3 * surface_flow)
        assert np.min(pressure) >= 0


def test_equilibria_have_load_and_inlet_pressure_at_300_random_loads() -> None:
    rng = np.random.default_rng(11)
    psi = np.linspace(0, TURN, 18000, endpoint=False)
    found = 0
    for _ in range(300):
        load, scale, area = 10 ** rng.uniform(-2, 4), 10 ** rng.uniform(4, 8), 10 ** rng.uniform(-5, -3)
        inlet_pressure = 0.0 if rng.random() < 0.3 else 10 ** rng.uniform(2, 7)
        try:
            film = film_equilibrium(load, scale, area, inlet_pressure)
        except EquilibriumError:
            continue
        found += 1
        pressure = film.pressure(psi)
        element = area * TURN / psi.size
        assert -np.sum(pressure * np.cos(psi)) * element == pytest.approx(load, rel=2e-3)
        assert np.sum(pressure * np.sin(psi)) * element == pytest.approx(0.0, abs=2e-3 * load)
        assert float(film.pressure(0.0)) == pytest.approx(inlet_pressure, abs=1e-6 * float(np.max(pressure)))
        assert 0 < film.eccentricity <= 0.999
    assert found > 200


def test_pressure_at_the_top_is_the_inlet_pressure_outside_and_zero_inside() -> None:
    for speed in (500.0, 3000.0, 9000.0):  # ruptured and complete
        rest = thesis_like_lubrication().equilibrium(20.0, speed, 2e5)
        assert float(rest.outer.pressure(0.0)) == pytest.approx(2e5, rel=1e-8)
        assert float(rest.outer.pressure(TURN)) == pytest.approx(2e5, rel=1e-8)
        assert float(rest.inner.pressure(0.0)) == pytest.approx(0.0, abs=1e-3)


def test_pressure_is_zero_exactly_between_rupture_and_reformation() -> None:
    film = thesis_like_lubrication().equilibrium(30.0, 3000.0, 2e5).outer
    assert film.rupture is not None
    assert film.reformation is not None
    cavity = np.linspace(film.rupture + 1e-6, film.reformation - 1e-6, 50)
    elsewhere = np.linspace(film.reformation + 1e-3, film.rupture + TURN - 1e-2, 200)
    assert np.all(film.pressure(cavity) == 0)
    assert np.all(film.pressure(elsewhere) > 0)


@pytest.mark.parametrize("load", [10.0, 20.0, 30.0])
def test_outer_film_is_continuous_at_the_cavity_free_speed(load: float) -> None:
    lubrication = thesis_like_lubrication()
    threshold = lubrication.cavity_free_speed(load, 1e5)
    below = lubrication.equilibrium(load, threshold * (1 - 1e-6), 1e5).outer
    above = lubrication.equilibrium(load, threshold * (1 + 1e-6), 1e5).outer
    assert not below.is_complete
    assert above.is_complete
    assert below.eccentricity == pytest.approx(above.eccentricity, rel=1e-4)
    assert below.attitude == pytest.approx(math.pi / 2, abs=1e-3)
    assert below.pressure(PSI) == pytest.approx(above.pressure(PSI), abs=1e-3 * float(np.max(above.pressure(PSI))))


def test_complete_film_has_neither_rupture_nor_reformation() -> None:
    film = nominal_lubrication().equilibrium(10.0, 3000.0, 1e5).outer
    assert film.is_complete
    assert film.rupture is None
    assert film.reformation is None
    assert film.attitude == pytest.approx(math.pi / 2)


def test_inner_film_does_not_depend_on_the_inlet_pressure() -> None:
    low, high = (thesis_like_lubrication().equilibrium(20.0, 2000.0, pressure).inner for pressure in (1e5, 3e5))
    assert low == high


def test_flow_repeats_every_sixty_degrees_of_the_ring() -> None:
    rest = thesis_like_lubrication().equilibrium(10.0, 3000.0, 2e5)
    angles = np.linspace(0, TURN, 50)
    flow = rest.flow(angles)
    assert np.ptp(flow) > 1e-3 * abs(np.mean(flow))
    assert rest.flow(angles + math.radians(60)) == pytest.approx(flow, rel=1e-9)
    assert rest.mean_flow() == pytest.approx(float(np.mean(rest.flow(np.linspace(0, TURN, 7201)[:-1]))), rel=1e-3)


def test_hole_flow_is_the_signed_root_of_the_pressure_difference() -> None:
    lubrication = replace(thesis_like_lubrication(), flow_scale=2.0)
    rest = lubrication.equilibrium(30.0, 3000.0, 2e5)
    holes = np.radians(10 + 60 * np.arange(6))
    difference = rest.outer.pressure(holes) - rest.inner.pressure(holes)
    assert np.min(difference) < 0 < np.max(difference)
    assert np.sign(rest.hole_flow(holes)) == pytest.approx(np.sign(difference))
    expected = sum(2.0 * math.copysign(math.sqrt(abs(d)), d) for d in difference)
    assert float(rest.flow(math.radians(10))) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("load", "speed", "inlet_pressure", "message"),
    [
        (0.0, 1000.0, 1e5, r"load: 0 N, expected"),
        (-5.0, 1000.0, 1e5, r"load: -5 N, expected"),
        (10.0, 0.0, 1e5, r"speed: 0 rad/s, expected"),
        (10.0, math.nan, 1e5, r"speed: nan rad/s, expected"),
        (10.0, 1000.0, -1.0, r"inlet_pressure: -1 Pa, expected a finite value, 0 or more"),
    ],
)
def test_equilibrium_refuses_invalid_values(load: float, speed: float, inlet_pressure: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        nominal_lubrication().equilibrium(load, speed, inlet_pressure)


@pytest.mark.parametrize("load", [1e6, 1e12])
def test_load_that_presses_the_journal_against_the_wall_is_an_error(load: float) -> None:
    with pytest.raises(EquilibriumError, match=r"load: 1e\+\d+ N presses the body to .* of its clearance, expected"):
        nominal_lubrication().equilibrium(load, 1000.0, 1e5)


def test_load_too_small_to_resolve_is_an_error() -> None:
    with pytest.raises(EquilibriumError, match=r"load: 1e-12 N displaces the body by less than"):
        nominal_lubrication().equilibrium(1e-12, 1000.0, 1e5)


def test_load_beyond_the_largest_eccentricity_is_an_error() -> None:
    with pytest.raises(
        EquilibriumError, match=r"presses the body to 0\.999\d+ of its clearance, expected .* within 0.999"
    ):
        film_equilibrium(400.0, 1e4, 5e-5, 0.0)


def test_cavity_free_speed_refuses_a_pressure_without_complete_film() -> None:
    for pressure in (1e-12, 1e12):
        with pytest.raises(EquilibriumError, match=r"inlet_pressure: .* of the load per length and radius, expected"):
            nominal_lubrication().cavity_free_speed(10.0, pressure)
    with pytest.raises(ValueError, match="inlet_pressure: 0 Pa"):
        nominal_lubrication().cavity_free_speed(10.0, 0.0)


@pytest.mark.parametrize("name", ["load_factor", "inner_capacity_factor", "flow_scale"])
def test_lubrication_refuses_a_calibration_that_is_not_positive(name: str) -> None:
    with pytest.raises(ValueError, match=f"{name}: 0"):
        Lubrication(table_3_1(), **{name: 0.0})


def test_lubrication_refuses_negative_gravity() -> None:
    with pytest.raises(ValueError, match=r"gravity: -1 m/s²"):
        Lubrication(table_3_1(), gravity=-1.0)


def test_film_equilibrium_refuses_a_size_that_is_not_positive() -> None:
    with pytest.raises(ValueError, match=r"area: 0 m²"):
        film_equilibrium(10.0, 1e6, 0.0, 0.0)
