import inspect
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from model.films.film import Film, bearing_films
from model.films.film_kernels import FORCE_LAWS, FORCES, film_force, film_slopes
from model.rotor.gj90c import gj90c
from model.rotor.parameters import FilmModel

UNIT = Film(radius=1.0, length=1.0, clearance=1.0, viscosity=1.0)


def quadrature(position: complex, velocity: complex, surface_speed: float) -> complex:
    """Force of the positive half of the short film's pressure on the inner body, in UNIT's film.

    With h = 1 - x cos t - y sin t the Reynolds equation for axial flow gives, integrated over the length,
    -mu L³ / h³ (w/2 dh/dt + squeeze) = -mu L³ / (2 h³) (A sin t - B cos t). Gauss-Legendre quadrature on the half in
    which this is positive, in the Sommerfeld variable, in which 1/h³ is smooth.
    """
    x, y = position.real, position.imag
    A = surface_speed * x - 2 * velocity.imag
    B = surface_speed * y + 2 * velocity.real
    start = math.atan2(B, A) + math.pi  # A sin t - B cos t is negative over half a turn from here
    nodes, weights = NODES
    e, towards = abs(position), math.atan2(y, x)
    # u = t - pi - towards from the thickest position, h = 1 + e cos u; tan(f/2) = sqrt((1 - e)/(1 + e)) tan(u/2)
    root = math.sqrt(1 - e * e)

    def spread(u: float) -> float:
        turns = math.floor((u + math.pi) / (2 * math.pi))
        u -= 2 * math.pi * turns
        return (
            2 * math.atan2(math.sqrt(1 - e) * math.sin(u / 2), math.sqrt(1 + e) * math.cos(u / 2)) + 2 * math.pi * turns
        )

    first, last = spread(start - towards - math.pi), spread(start - towards)
    f = first + (last - first) * (nodes + 1) / 2
    h = root * root / (1 - e * np.cos(f))
    u = 2 * np.arctan2(math.sqrt(1 + e) * np.sin(f / 2), math.sqrt(1 - e) * np.cos(f / 2))
    t = u + towards + math.pi
    pressure = -(A * np.sin(t) - B * np.cos(t)) / (2 * h**3)
    density = weights * (last - first) / 2 * h / root  # du = h / root df
    return complex(-np.sum(density * pressure * np.exp(1j * t)))


NODES: tuple[NDArray[np.float64], NDArray[np.float64]] = np.polynomial.legendre.leggauss(400)


def random_states(count: int) -> list[tuple[complex, complex, float]]:
    rng = np.random.default_rng(2012)
    states = []
    for _ in range(count):
        position = 0.95 * math.sqrt(rng.uniform()) * np.exp(2j * np.pi * rng.uniform())
        velocity = 10 ** rng.uniform(-3, 1) * np.exp(2j * np.pi * rng.uniform())
        states.append((complex(position), complex(velocity), rng.uniform(0, 5)))
    return states


def test_capone_force_is_the_integral_of_the_films_positive_pressure() -> None:
    worst = 0.0
    for position, velocity, surface_speed in random_states(1000):
        expected = quadrature(position, velocity, surface_speed)
        worst = max(worst, abs(UNIT.force(position, velocity, surface_speed) - expected) / abs(expected))
    assert worst < 1e-9


def test_printed_force_term_is_not_the_integral() -> None:
    # The thesis prints F = q / (1 - x² - y²); this state distinguishes the two.
    position, velocity = 0.5 + 0.3j, -0.8 + 0.4j
    x, y = position.real, position.imag
    A, B = x - 2 * velocity.imag, y + 2 * velocity.real
    s = math.hypot(A, B)
    cos_a, sin_a = -A / s, -B / s
    q, u = x * cos_a + y * sin_a, 1 - x * x - y * y
    change = UNIT.factor * s / u * 2 * (q / u - q / (1 - q * q)) * complex(cos_a, sin_a)
    printed = UNIT.force(position, velocity, 1.0) + change
    expected = quadrature(position, velocity, 1.0)
    assert abs(printed - expected) > 0.01 * abs(expected)


def test_film_force_rotates_with_the_state() -> None:
    turn = np.exp(0.7j)
    for position, velocity, surface_speed in random_states(20):
        turned = UNIT.force(complex(position * turn), complex(velocity * turn), surface_speed)
        assert turned == pytest.approx(UNIT.force(position, velocity, surface_speed) * turn, rel=1e-12)


def test_static_film_carries_ocvirks_load_at_ocvirks_attitude() -> None:
    e = 0.6
    force = UNIT.force(-1j * e, 0j, 1.0)
    sigma = UNIT.factor
    load = 4 * e / (1 - e * e) ** 2 * math.sqrt(e * e + (math.pi / 4) ** 2 * (1 - e * e))
    assert abs(force) == pytest.approx(sigma * load, rel=1e-12)
    attitude = math.atan2(math.pi * math.sqrt(1 - e * e), 4 * e)
    assert np.pi / 2 - np.angle(force) == pytest.approx(attitude, rel=1e-12)


@pytest.mark.parametrize(
    ("e", "stiffness", "damping"),
    [
        (0.1, (2.5308, 9.7577, -10.3811, 1.3284), (19.7905, -2.5325, 20.4872)),
        (0.5, (2.2099, 0.8577, -3.9766, 2.9233), (3.0539, -2.2450, 6.6148)),
        (0.9, (1.7294, -1.4213, -7.2637, 19.0955), (0.6869, -1.8059, 10.9978)),
    ],
)
def test_linear_coefficients_are_the_short_bearings_closed_forms(
    e: float, stiffness: tuple[float, ...], damping: tuple[float, ...]
) -> None:
    attitude = math.atan2(math.pi * math.sqrt(1 - e * e), 4 * e)
    position = e * complex(math.sin(attitude), -math.cos(attitude))
    load = abs(UNIT.force(position, 0j, 1.0))
    of_x, of_y = film_slopes(FORCE_LAWS[FilmModel.CAPONE], position, 0j, 1.0, 1.0, UNIT.factor, 0j)
    found = -np.array([of_x.real, of_y.real, of_x.imag, of_y.imag]) / load
    assert found == pytest.approx(np.array(stiffness), rel=2e-4, abs=2e-4)
    with_x, with_y = film_slopes(FORCE_LAWS[FilmModel.CAPONE], position, 0j, 1.0, 1.0, UNIT.factor, 1.0 + 0j)
    c_xx, c_xy, c_yy = -(with_x - of_x).real / load, -(with_y - of_y).real / load, -(with_y - of_y).imag / load
    assert (c_xx, c_xy, c_yy) == pytest.approx(damping, rel=2e-4, abs=2e-4)


def test_film_without_motion_has_no_force() -> None:
    assert UNIT.force(0.3 + 0.2j, 0j, 0.0) == 0
    assert UNIT.force(0j, 0j, 1.0) == 0


@pytest.mark.parametrize("model", list(FilmModel))
def test_compiled_force_equals_the_interpreted_one(model: FilmModel) -> None:
    law = FORCE_LAWS[model]
    interpreted = inspect.unwrap(FORCES[type(law)])
    assert interpreted is not FORCES[type(law)]
    for position, velocity, surface_speed in random_states(50):
        state = (position, velocity, 1.0, surface_speed, UNIT.factor)
        assert film_force(law, *state) == pytest.approx(interpreted(*state), rel=1e-12)


@pytest.mark.parametrize("position", [1.0 + 0j, 0.9 + 0.9j, complex(math.nan, 0)])
def test_position_at_or_beyond_the_wall_is_refused(position: complex) -> None:
    film = Film(radius=5e-3, length=10e-3, clearance=20e-6, viscosity=0.015)
    with pytest.raises(ValueError, match=r"position: .* µm from the centre, expected less than the clearance of 20 µm"):
        film.force(position * 20e-6, 0j, 100.0)


@pytest.mark.parametrize("name", ["radius", "length", "clearance", "viscosity"])
def test_film_refuses_a_size_that_is_not_positive(name: str) -> None:
    sizes = {"radius": 5e-3, "length": 10e-3, "clearance": 20e-6, "viscosity": 0.015, name: 0.0}
    with pytest.raises(ValueError, match=f"{name}: 0 "):
        Film(sizes["radius"], sizes["length"], sizes["clearance"], sizes["viscosity"])


def test_bearing_films_of_a_ring_are_in_series() -> None:
    pair = bearing_films(replace(gj90c().floating_ring, film_model=FilmModel.FULL_SOMMERFELD))
    assert {pair.inner.model, pair.outer.model} == {FilmModel.FULL_SOMMERFELD}
    assert pair.outer.radius == 9e-3
    assert pair.inner.clearance == 20e-6
    # centred whirl at half the sum of the surface speeds: 0.70X inner film, 0.20X outer film
    assert pair.inner_speed / 2 == pytest.approx(0.704, abs=1e-3)
    assert pair.outer_speed / 2 == pytest.approx(0.203, abs=1e-3)


@pytest.mark.parametrize("model", list(FilmModel))
def test_slopes_are_the_derivatives_of_the_force(model: FilmModel) -> None:
    rng = np.random.default_rng(3)
    for _ in range(100):
        position = 0.95 * rng.uniform() * np.exp(1j * rng.uniform(0, 2 * math.pi))
        velocity, ratio = complex(*rng.normal(size=2)), complex(*rng.normal(size=2))
        slopes = film_slopes(FORCE_LAWS[model], complex(position), velocity, 1.0, 1.0, 1.0, ratio)
        for slope, move in zip(slopes, (1e-6, 1e-6j), strict=True):
            ends = [
                film_force(FORCE_LAWS[model], complex(position + step), velocity + ratio * step, 1.0, 1.0, 1.0)
                for step in (-move, move)
            ]
            assert slope == pytest.approx((ends[1] - ends[0]) / 2e-6, rel=1e-6, abs=1e-7 * max(map(abs, slopes)))
