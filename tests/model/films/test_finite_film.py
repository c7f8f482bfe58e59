"""Film of finite length: order of convergence, limits, boundary condition."""

import math

import numpy as np
import pytest

from model.films.film import Film
from model.films.finite_film import Flow, Grid, Groove, pressure_unit, slenderness, solve_reynolds, thickness
from model.films.long_film import bearing_angle, ruptured_film

SPEED = 1000.0
CLEARANCE = 20e-6
HALF_WAY = 0.5 * CLEARANCE + 0j


def film(ratio: float) -> Film:
    """Film with this ratio of length to diameter."""
    return Film(radius=5e-3, length=ratio * 10e-3, clearance=CLEARANCE, viscosity=0.012)


@pytest.mark.parametrize("cavitates", [False, True])
def test_force_converges_in_second_order(*, cavitates: bool) -> None:
    def force(around: int) -> complex:
        grid = Grid(around, around // 12)
        return solve_reynolds(film(1.0), HALF_WAY, 2e-3 + 1e-3j, SPEED, grid, cavitates=cavitates).force

    forces = [force(around) for around in (48, 96, 192, 384)]
    steps = np.abs(np.diff(forces))
    assert np.log2(steps[:-1] / steps[1:]) == pytest.approx([2, 2], abs=0.15)
    assert steps[-1] < 3e-4 * abs(forces[-1])


@pytest.mark.parametrize("velocity", [0j, 3e-3 - 2e-3j])
def test_force_converges_to_the_short_film_with_decreasing_length(velocity: complex) -> None:
    deviations = []
    for ratio in (0.2, 0.1, 0.05, 0.025):
        short = film(ratio).force(HALF_WAY, velocity, SPEED)
        found = solve_reynolds(film(ratio), HALF_WAY, velocity, SPEED, Grid(720, 8))
        deviations.append(abs(found.force - short) / abs(short))
    ratios = np.array(deviations[:-1]) / np.array(deviations[1:])
    assert np.all(ratios > 3.3)  # proportional to the square of the length
    assert deviations[-1] < 1.5e-3


def test_force_converges_to_the_long_film_with_increasing_length() -> None:
    shape = ruptured_film(0.5, 0.95)
    start = float(bearing_angle(shape.start, 0.5))  # a groove at zero pressure at the start of the long film
    deviations = []
    for ratio in (4.0, 8.0, 16.0, 32.0):
        found = solve_reynolds(film(ratio), HALF_WAY, 0j, SPEED, Grid(180, 32), groove=Groove(start + math.pi, 0.0))
        unit = 6 * pressure_unit(film(ratio)) * SPEED * film(ratio).length * film(ratio).radius
        deviations.append(found.force / (unit * complex(*shape.force)) - 1)
    assert np.abs(deviations[:-1]) / np.abs(deviations[1:]) == pytest.approx(
        [2, 2, 2], abs=0.2
    )  # two end effects, D/L each
    assert abs(2 * deviations[-1] - deviations[-2]) < 3e-3  # limit of an infinite length


def test_axial_flow_alone_is_the_short_film_at_any_length() -> None:
    for around, tolerance in ((360, 4e-5), (720, 1e-5)):
        grid = Grid(around, 2, first_angle=math.pi / around)
        found = solve_reynolds(film(1.0), HALF_WAY, 0j, SPEED, grid, flow=Flow.AXIAL)
        short = film(1.0).force(HALF_WAY, 0j, SPEED)
        assert found.force == pytest.approx(short, rel=tolerance)


def test_pressure_is_never_negative_and_positive_in_the_full_film() -> None:
    found = solve_reynolds(film(0.7), HALF_WAY * np.exp(1j), 1e-3j, SPEED, Grid())
    assert np.min(found.pressure) == 0
    assert np.array_equal(found.pressure[:-1] > 0, found.is_full_film)
    assert np.all(found.pressure[-1] == 0)
    assert 0.3 < np.mean(found.is_full_film) < 0.7


def test_pressure_equals_projected_relaxation() -> None:
    grid = Grid(32, 4)
    found = solve_reynolds(film(1.0), HALF_WAY, 2e-3j, SPEED, grid)
    h_faces, h_nodes, squeeze = thickness(film(1.0), HALF_WAY, 2e-3j, grid)
    matrix = grid.flow_matrix(h_nodes**3, h_faces**3, slenderness(film(1.0)), Flow.BOTH).toarray()
    source = grid.surface_flow(SPEED * h_faces, squeeze)
    pressure = np.zeros(source.size)
    for _ in range(400):
        for volume in range(source.size):
            outflow = matrix[volume] @ pressure + source[volume]
            pressure[volume] = max(0.0, pressure[volume] - 1.5 * outflow / matrix[volume, volume])
    expected = pressure_unit(film(1.0)) * pressure.reshape(grid.along, grid.around)
    assert found.pressure[:-1] == pytest.approx(expected, abs=1e-8 * float(np.max(expected)))


def test_pressure_gradient_is_zero_at_rupture_and_not_at_reformation() -> None:
    found = solve_reynolds(film(2.0), -HALF_WAY, 0j, SPEED, Grid(720, 12))  # thickest at angle 0
    middle = found.pressure[0]
    slope = np.diff(middle, append=middle[:1])
    last = np.flatnonzero((middle > 0) & (np.roll(middle, -1) == 0))[0]
    assert abs(slope[last]) < 2e-2 * np.max(np.abs(slope))
    assert math.pi < found.grid.angles[last] < 1.5 * math.pi


def test_pressure_without_cavitation_is_odd_about_the_line_of_centres() -> None:
    found = solve_reynolds(film(1.0), HALF_WAY, 0j, SPEED, Grid(96, 8), cavitates=False)
    assert found.pressure[:, 1:] == pytest.approx(-found.pressure[:, :0:-1], abs=1e-9 * float(np.max(found.pressure)))
    assert found.iterations == 1


def test_force_rotates_with_the_position() -> None:
    grid = Grid(96, 8)
    upright = solve_reynolds(film(1.0), HALF_WAY, 1e-3 + 0j, SPEED, grid).force
    turned = solve_reynolds(film(1.0), 1j * HALF_WAY, 1e-3j, SPEED, grid).force
    assert turned == pytest.approx(1j * upright, rel=1e-10)


def test_groove_holds_its_pressure_along_the_film() -> None:
    found = solve_reynolds(film(1.0), HALF_WAY, 0j, SPEED, Grid(96, 8), groove=Groove(math.pi / 3, 2e5))
    assert found.grid.angles[0] == math.pi / 3
    assert found.pressure[:-1, 0] == pytest.approx(np.full(8, 2e5))


def test_force_is_zero_without_motion() -> None:
    assert solve_reynolds(film(1.0), HALF_WAY, 0j, 0.0, Grid(48, 4)).force == 0
    assert solve_reynolds(film(1.0), 0j, 0j, SPEED, Grid(48, 4)).force == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    ("position", "velocity", "speed", "message"),
    [
        (CLEARANCE + 0j, 0j, SPEED, r"position: 20 µm from the centre, expected less than the clearance of 20 µm"),
        (complex(math.nan, 0), 0j, SPEED, r"position: nan µm"),
        (HALF_WAY, complex(0, math.inf), SPEED, r"velocity: .* m/s, expected a finite value"),
        (HALF_WAY, 0j, math.nan, r"surface_speed: nan rad/s, expected a finite value"),
        (0.999 * CLEARANCE + 0j, 0j, SPEED, r"around: 180 nodes, expected at least \d+ to resolve the film at 0.999"),
    ],
)
def test_solver_refuses_an_invalid_state(position: complex, velocity: complex, speed: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        solve_reynolds(film(1.0), position, velocity, speed, Grid())


def test_grid_refuses_invalid_numbers() -> None:
    with pytest.raises(ValueError, match="around: 7 intervals, expected an even number, 8 or more"):
        Grid(around=7)
    with pytest.raises(ValueError, match="along: 5 intervals, expected an even number, 2 or more"):
        Grid(along=5)
    with pytest.raises(ValueError, match="first_angle: nan rad"):
        Grid(first_angle=math.nan)


def test_groove_refuses_invalid_values() -> None:
    with pytest.raises(ValueError, match="pressure: -1 Pa, expected a finite value, 0 or more"):
        Groove(0.0, -1.0)
    with pytest.raises(ValueError, match="angle: inf rad"):
        Groove(math.inf, 0.0)
