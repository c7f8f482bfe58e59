import math
from dataclasses import replace

import numpy as np
import pytest

from model.dynamics.motion import ShaftMotion
from model.dynamics.stability import FilmName, Whirl, inner_shares, order_and_share, synchronous_orbit
from model.dynamics.synchronous import synchronous_response
from model.errors import ModelError
from model.rotor.gj90c import gj90c
from model.rotor.parameters import ModelParameters
from model.studies.motion import DEFAULT_PERTURBATION, SteppedMotion
from model.studies.run_up import RunUp, combinations


def test_growth_and_order_without_weight_are_those_of_the_rotating_frame(default: ModelParameters) -> None:
    parameters = replace(default, gravity=0.0)
    for speed in (500.0, 1900.0):
        turning = synchronous_response(parameters, speed)
        floquet = synchronous_orbit(parameters, speed)
        assert floquet.growth_rate == pytest.approx(turning.growth_rate, rel=0.02, abs=0.05)
        assert floquet.whirl_order == pytest.approx(turning.whirl_order, abs=0.002)


def test_unstable_orbit_is_periodic(default: ModelParameters) -> None:
    orbit = synchronous_orbit(default, 1900.0)
    assert orbit.growth_rate > 10
    motion = ShaftMotion(default, 1900.0, 1)
    motion.set_initial_state(orbit.initial_state)
    first, second = np.split(motion.integrate_turns(2), 2, axis=1)
    assert np.abs(first - second)[:, 1:].max() < 1e-12  # the state is exact from the first step on


def test_disturbance_grows_at_its_rate(default: ModelParameters) -> None:
    speed = 1900.0
    orbit = synchronous_orbit(default, speed)
    still, disturbed = ShaftMotion(default, speed, 1), ShaftMotion(default, speed, 1)
    still.set_initial_state(orbit.initial_state)
    disturbed.set_initial_state(orbit.initial_state + 1e-9 * orbit.disturbance)
    apart = np.abs(disturbed.integrate_turns(40) - still.integrate_turns(40)).max(axis=0).reshape(40, -1)
    growth = np.log(apart[30:40].max() / apart[5:15].max()) / (25 * 2 * math.pi / speed)
    assert growth == pytest.approx(orbit.growth_rate, rel=0.1)


def test_weight_stabilises_the_shaft_at_low_speed(default: ModelParameters) -> None:
    assert synchronous_orbit(default, 400.0).growth_rate < -1
    assert synchronous_orbit(replace(default, gravity=0.0), 400.0).growth_rate > 0


def test_start_from_a_neighbouring_speed_gives_the_same_orbit(default: ModelParameters) -> None:
    start = synchronous_orbit(default, 1000.0)
    assert synchronous_orbit(default, 1030.0, start).growth_rate == pytest.approx(
        synchronous_orbit(default, 1030.0).growth_rate, abs=0.02
    )


def test_orbit_at_speed_zero_is_refused(default: ModelParameters) -> None:
    with pytest.raises(ValueError, match="speed: 0 rad/s"):
        synchronous_orbit(default, 0.0)


def test_orbit_larger_than_the_clearance_is_an_error() -> None:
    with pytest.raises(ModelError, match=r"synchronous motion at 10\.0 rad/s: none found"):
        synchronous_orbit(gj90c(viscosity=1e-7), 10.0)


INNER, OUTER = FilmName.INNER, FilmName.OUTER
SPEEDS = np.array([1000.0, 1100.0])


@pytest.mark.parametrize("order", [0.7, 0.2, -0.62, 1.3])
@pytest.mark.parametrize("growth", [0.0, -0.3, 0.05])
def test_order_of_a_circle_has_its_direction_also_above_one(order: float, growth: float) -> None:
    theta = 2 * math.pi * np.arange(1, 65) / 64
    sense = 1 if order > 0 else -1
    # the real part is x = cos, y = ± sin, plus a component of half the size, one order away
    x = np.exp((growth + 1j * abs(order)) * theta)
    other = 0.3 * np.exp((growth + 1j * (abs(order) + 2)) * theta)
    sizes = np.array([0.3, 0.4, 0.0, 0.1])
    films = sizes[:, None, None] * np.stack((x + other, -1j * sense * x + 1j * sense * other))
    turned = (abs(order) + 0.5) % 1 - 0.5  # an eigenvalue gives the order modulo 1 only
    found, share = order_and_share(films, complex(growth, turned))
    assert found == pytest.approx(order, abs=1e-12)
    assert share == pytest.approx(0.5 / 0.6)


def test_share_without_motion_is_one_half() -> None:
    shares = inner_shares(np.array([[3.0, 0.0, 0.0], [4.0, 0.0, 1.0], [0.0, 0.0, 0.0], [5.0, 0.0, 0.0]]))
    assert shares.tolist() == [0.5, 0.5, 1.0]
    assert Whirl(1.0, 0.7, 0.9).film is INNER
    assert Whirl(1.0, 0.2, 0.02).film is OUTER


def test_whirls_without_weight_are_those_of_the_rotating_frame(default: ModelParameters) -> None:
    parameters = replace(default, gravity=0.0)
    for speed in (1000.0, 1900.0):
        turning, floquet = synchronous_response(parameters, speed).whirls, synchronous_orbit(parameters, speed).whirls
        assert [one.film for one in turning] == [one.film for one in floquet] == [OUTER, INNER]
        for one, other in zip(turning, floquet, strict=True):
            assert one.order == pytest.approx(other.order, abs=0.003)
            assert one.inner_share == pytest.approx(other.inner_share, abs=0.01)
            assert one.growth_rate == pytest.approx(other.growth_rate, rel=0.02, abs=0.05)


def test_inner_share_in_time_equals_that_of_the_eigenvector(default: ModelParameters) -> None:
    for speed, film in ((1000.0, INNER), (1700.0, OUTER)):
        whirl = synchronous_orbit(default, speed).whirls[0]
        assert whirl.film is film
        stepped = SteppedMotion(default, 10 * DEFAULT_PERTURBATION)
        stepped.settle_at(speed, 0)
        seen = stepped.record(64)
        near = np.abs(seen.orders - whirl.order) < 0.02
        inner, outer = seen.films[:, near].max(axis=1)
        assert inner / (inner + outer) == pytest.approx(whirl.inner_share, abs=0.02)


def test_films_are_distinguished_independently_of_the_orders() -> None:
    # a thin ring turns at 0.795 of the shaft's speed; half the speeds of the surfaces are 0.40 and 0.90
    quick = replace(gj90c(), gravity=0.0)
    quick = replace(quick, bearing=replace(quick.floating_ring, ring_outer_radius=5.05e-3))
    ring = quick.floating_ring.ring_speed_ratio
    orders = {whirl.film: whirl.order for whirl in synchronous_response(quick, 300.0).whirls}
    assert orders[INNER] == pytest.approx((1 + ring) / 2, abs=0.005)
    assert orders[OUTER] == pytest.approx(ring / 2, abs=0.035)  # it grows fast


def _run_up(*lines: tuple[float, float, float]) -> RunUp:
    """Return a run-up with given lines: order, and amplitude in the inner and in the outer film."""
    orders = np.arange(0.0, 3.0, 1 / 64)
    films, spectrum = np.full((2, 2, orders.size), 1e-9), np.full((2, orders.size), 1e-12)
    for order, inner, outer in lines:
        place = int(np.argmin(np.abs(orders - order)))
        films[:, :, place] = inner, outer
        spectrum[:, place] = (inner * 20 + outer * 80) * 1e-6
    still = np.zeros((2, 2, 8))
    return RunUp(SPEEDS, orders, spectrum, still, np.zeros(2), still, films)


def test_combination_with_1x_is_no_whirl() -> None:
    inner_alone = _run_up((1.0, 0.02, 0.03), (0.703, 0.46, 0.09), (0.297, 0.001, 0.02), (0.1875, 0.001, 0.005))
    # 1X minus the whirl; three times 1X minus four times the whirl
    assert inner_alone.onset(INNER) == 1000.0
    assert math.isnan(inner_alone.onset(OUTER))
    outer_alone = _run_up((1.0, 0.02, 0.03), (0.203, 0.01, 0.72), (0.594, 0.005, 0.01), (0.797, 0.02, 0.015))
    assert outer_alone.onset(OUTER) == 1000.0
    assert math.isnan(outer_alone.onset(INNER))
    both = _run_up((1.0, 0.02, 0.03), (0.703, 0.3, 0.07), (0.203, 0.001, 0.1), (0.297, 0.001, 0.02))
    assert [both.onset(film) for film in FilmName] == [1000.0, 1000.0]
    assert [float(both.whirl(film)[0][0]) for film in FilmName] == pytest.approx([0.703, 0.203], abs=0.008)
    assert [both.end(film) for film in FilmName] == [1100.0, 1100.0]


def test_large_component_at_a_combination_order_is_a_whirl() -> None:
    # with a ring at half the shaft speed, 0.75X and 0.25X are combinations of each other
    both = _run_up((1.0, 0.02, 0.03), (0.75, 0.4, 0.08), (0.25, 0.001, 0.2))
    assert [both.onset(film) for film in FilmName] == [1000.0, 1000.0]
    assert np.abs(combinations(0.75) - 0.25).min() < 1e-12


def test_whirl_is_nan_after_wall_contact() -> None:
    found = _run_up((1.0, 0.02, 0.03), (0.703, 0.46, 0.09))
    films, spectrum = found.films.copy(), found.spectrum.copy()
    films[0], spectrum[0] = np.nan, np.nan
    order, size = replace(found, films=films, spectrum=spectrum).whirl(INNER)
    assert np.isnan([order[0], size[0]]).all()
    assert order[1] == pytest.approx(0.703, abs=0.008)


def test_whirl_is_no_bending_mode_that_the_steps_alias() -> None:
    """At 500 rad/s a bending mode that 64 steps a turn do not resolve decays more slowly than the outer whirl."""
    inner, outer = synchronous_orbit(gj90c(), 500.0).whirls
    assert [one.film for one in (inner, outer)] == [FilmName.INNER, FilmName.OUTER]
    assert [one.order for one in (inner, outer)] == pytest.approx([0.70, 0.228], abs=0.01)
    assert outer.growth_rate < -40
