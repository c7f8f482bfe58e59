import numpy as np
import pytest

from analysis.signals import FloatArray
from model.linear.campbell import campbell
from model.linear.linear_system import LinearSystem, WhirlModes, linear_system, whirl_modes
from model.linear.modes import critical_speed_map, critical_speeds
from model.linear.response import imbalance_response, static_deflection
from model.rotor.gj90c import gj90c_rotor
from model.rotor.parameters import Imbalance
from model.rotor.supports import StaticLoad, Support, SupportCoefficients
from tests.model.linear.springs import critical_speeds_on_springs, natural_frequencies

SPEEDS = np.arange(0.0, 8001.0, 500.0)
NEARLY = SupportCoefficients(((1e4, 0.0), (0.0, 1e4 * (1 + 1e-12))))  # uses the general eigenproblem


def shape_agreement(first: WhirlModes, second: WhirlModes) -> FloatArray:
    """Modal assurance criterion of all pairs of modes, 0 to 1."""
    return np.asarray(np.abs(first.vectors.conj() @ second.vectors.T) ** 2, np.float64)


def on(coefficients: SupportCoefficients) -> LinearSystem:
    return linear_system(gj90c_rotor(), [Support(3, coefficients), Support(4, coefficients)])


@pytest.fixture
def soft() -> LinearSystem:
    return on(SupportCoefficients.isotropic(1e4))


def test_symmetric_problem_and_general_one_have_the_same_modes(soft: LinearSystem) -> None:
    assert soft.is_undamped_isotropic
    assert not on(NEARLY).is_undamped_isotropic
    for speed in (0.0, 4000.0):
        expected = natural_frequencies(gj90c_rotor(), 1e4, speed)
        (plain,), (general,) = whirl_modes(soft, [speed]), whirl_modes(on(NEARLY), [speed])
        assert np.sort(plain.frequencies) == pytest.approx(expected, rel=1e-6, abs=1e-4)
        assert np.abs(general.frequencies) == pytest.approx(np.sort(np.abs(expected)), rel=1e-6, abs=1e-4)
        if speed:
            assert np.array_equal(np.sign(general.frequencies), np.sign(plain.frequencies))
            assert plain.forward == pytest.approx(np.sign(plain.frequencies)[:, None] * np.ones((24, 6)))


def test_shapes_fulfil_the_equations_of_motion() -> None:
    film = SupportCoefficients(((3e6, 8e5), (-8e5, 2e6)), ((120.0, 10.0), (10.0, 90.0)))
    rotor, speed = gj90c_rotor(), 3000.0
    ringed = Support(4, film, SupportCoefficients.isotropic(1e6, 50.0), 0.02)
    system = linear_system(rotor, [Support(3, film), ringed])
    (modes,) = whirl_modes(system, [speed])
    damping = system.damping + speed * system.gyroscopic
    for frequency, growth, shape in zip(modes.frequencies, modes.growth_rates, modes.shapes, strict=True):
        s = growth + 1j * abs(frequency)
        dynamic = system.stiffness + s * damping + s**2 * system.mass
        *_, vh = np.linalg.svd(dynamic / np.abs(dynamic).max(axis=1, keepdims=True))
        null = np.asarray(system.displacements(vh[-1].conj()))
        alike = abs(np.vdot(null, shape)) / (np.linalg.norm(null) * np.linalg.norm(shape))
        assert alike == pytest.approx(1, abs=1e-4)


def test_overdamped_modes_are_omitted() -> None:
    stiff_damper = on(SupportCoefficients.isotropic(1e5, 1e6))
    (modes,) = whirl_modes(stiff_damper, [0.0])
    assert modes.frequencies.size < 24
    assert np.all(modes.growth_rates <= 0)


def test_free_rotor_has_its_free_frequencies() -> None:
    (modes,) = whirl_modes(linear_system(gj90c_rotor(), []), [0.0])
    frequencies = np.abs(modes.frequencies) / (2 * np.pi)
    assert frequencies[:4] == pytest.approx(np.zeros(4), abs=0.5)
    assert frequencies[4:8] == pytest.approx([1730.2, 1730.2, 5044.9, 5044.9], abs=0.5)


def test_ring_in_series_is_equation_5_11() -> None:
    inner, outer, mass = 3e6, 1e6, 0.02
    film = SupportCoefficients.isotropic(inner)
    ringed = (
        Support(3, film, SupportCoefficients.isotropic(outer), mass),
        Support(4, film, SupportCoefficients.isotropic(outer), mass),
    )
    (modes,) = whirl_modes(linear_system(gj90c_rotor(), ringed), [2000.0])
    for frequency in modes.frequencies[:6]:
        outer_dynamic = outer - mass * float(frequency) ** 2
        spring = inner * outer_dynamic / (inner + outer_dynamic)
        M, J, K = on(SupportCoefficients.isotropic(1.0)).plane
        K = K.copy()
        for journal in gj90c_rotor().journals:
            K[journal, journal] += spring - 1.0
        singular = np.linalg.svd(K + frequency * 2000.0 * J - frequency**2 * M, compute_uv=False)
        assert singular[-1] / singular[0] < 1e-9


def test_branches_are_tracked_by_shape_through_crossings(soft: LinearSystem) -> None:
    found = campbell(soft, SPEEDS[::2], 10)
    hertz = found.frequencies / (2 * np.pi)
    # columns of Table 5.3: the conical mode rises and crosses the other one, which is constant
    rising = next(row for row in hertz if abs(row[0] - 20.4) < 0.1 and row[-1] > 0)
    level = next(row for row in hertz if abs(row[0] - 52.4) < 0.1 and row[-1] > 0)
    assert rising[-1] == pytest.approx(143.5, abs=0.1)
    assert level[-1] == pytest.approx(52.2, abs=0.1)
    assert np.abs(level - 52.4).max() < 3.0


def test_branches_veer_with_small_steps(soft: LinearSystem) -> None:
    low, high = (campbell(soft, np.linspace(0, 8000, 81), 4).frequencies / (2 * np.pi))[[1, 3]]
    assert low[[0, -1]] == pytest.approx([20.4, 52.2], abs=0.1)
    assert high[[0, -1]] == pytest.approx([52.4, 143.5], abs=0.1)
    assert np.all(high > low)


def test_equal_frequencies_are_numbered_by_their_slope_at_rest(soft: LinearSystem) -> None:
    at_rest, turning = (modes.frequencies for modes in whirl_modes(soft, [0.0, 1.0]))
    assert np.array_equal(np.sign(at_rest), np.sign(turning))
    assert np.all(at_rest[::2] < 0)
    assert at_rest[::2] == pytest.approx(-at_rest[1::2], rel=1e-9)


def test_equal_modes_of_a_damped_rotor_at_standstill_are_reverse_and_forward_circles() -> None:
    damped = on(SupportCoefficients.isotropic(1e4, 5.0))
    at_rest, turning = whirl_modes(damped, [0.0, 1.0])
    assert np.array_equal(np.sign(at_rest.frequencies), np.sign(turning.frequencies))
    assert at_rest.forward[::2] == pytest.approx(-1.0, abs=1e-4)
    assert at_rest.forward[1::2] == pytest.approx(1.0, abs=1e-4)
    assert shape_agreement(at_rest, turning).diagonal() == pytest.approx(1.0, abs=1e-3)


def test_rigid_body_modes_of_a_free_rotor_have_frequency_zero() -> None:
    free = linear_system(gj90c_rotor(), [])
    (at_rest,) = whirl_modes(free, [0.0])
    assert np.array_equal(at_rest.frequencies[:4], np.zeros(4))
    found = campbell(free, [0.0, 500.0, 1000.0], 6)
    for speed, column in zip(found.speeds, found.frequencies.T, strict=True):
        (modes,) = whirl_modes(free, [speed])
        assert np.sort(column) == pytest.approx(np.sort(modes.frequencies[:6]), rel=1e-9)


def test_branches_are_complete_and_contain_each_mode_once(soft: LinearSystem) -> None:
    followed = campbell(soft, SPEEDS).frequencies
    for speed, column in zip(SPEEDS, followed.T, strict=True):
        assert np.sort(column) == pytest.approx(natural_frequencies(gj90c_rotor(), 1e4, speed), rel=1e-6, abs=1e-3)
    one, other = whirl_modes(soft, [1000.0, 1010.0])
    assert shape_agreement(one, other).max(axis=1).min() > 0.9


def test_branches_of_a_damped_rotor_contain_each_mode_once() -> None:
    slow = SupportCoefficients(((1e4, 2e3), (-2e3, 3e4)), ((60.0, 0.0), (0.0, 20.0)))
    found = campbell(on(slow), np.linspace(0, 8000, 81))
    for speed, column in zip(found.speeds[::20], found.frequencies.T[::20], strict=True):
        (modes,) = whirl_modes(on(slow), [speed])
        there = column[~np.isnan(column)]
        assert np.unique(there).size == there.size
        assert set(there) <= set(modes.frequencies)


@pytest.mark.parametrize(
    ("speeds", "branches", "message"),
    [
        ([], None, r"speeds: \[\], rad/s, expected one or more, rising"),
        ([2.0, 1.0], None, r"speeds: \[2\. 1\.\], rad/s"),
        ([1.0], 25, r"branches: 25, expected 1 to 24"),
        ([float("nan")], None, r"speeds: \[nan\], rad/s, expected a list of finite values"),
    ],
)
def test_invalid_campbell_arguments_are_refused(
    soft: LinearSystem, speeds: list[float], branches: int | None, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        campbell(soft, speeds, branches)


@pytest.mark.parametrize("stiffness", [1e4, 1e7, 1e10])
def test_critical_speeds_of_both_functions_are_equal(stiffness: float) -> None:
    expected = critical_speeds_on_springs(gj90c_rotor(), stiffness, 8000)
    nearly = SupportCoefficients(((stiffness, 0.0), (0.0, stiffness * (1 + 1e-9))))
    for coefficients in (SupportCoefficients.isotropic(stiffness), nearly):
        found = critical_speeds(on(coefficients), 8000)
        assert found.forward == pytest.approx(expected.forward, rel=1e-5)
        assert found.reverse == pytest.approx(expected.reverse, rel=1e-5)


def test_response_peaks_at_the_forward_critical_speeds_and_not_at_the_reverse_ones(soft: LinearSystem) -> None:
    speeds = critical_speeds(soft, 1000)
    imbalances = [Imbalance(5, 1e-7)]
    beside, at, reverse = imbalance_response(
        soft, imbalances, [0.9 * speeds.forward[0], (1 + 1e-6) * speeds.forward[0], (1 + 1e-6) * speeds.reverse[0]]
    )
    assert np.abs(at).max() > 1e4 * np.abs(beside).max()
    assert np.abs(reverse).max() < np.abs(beside).max()


def test_anisotropic_springs_split_the_critical_speeds() -> None:
    system = on(SupportCoefficients(((2e4, 0.0), (0.0, 1e4))))
    found = critical_speeds(system, 8000)
    speeds = sorted(found.forward + found.reverse)
    assert len(speeds) == 5
    shaken = imbalance_response(system, [Imbalance(5, 1e-7)], [(1 + 1e-7) * speed for speed in speeds])
    usual = imbalance_response(system, [Imbalance(5, 1e-7)], [1.1 * speed for speed in speeds])
    # on such springs imbalance excites reverse and forward critical speeds
    assert np.all(np.abs(shaken).max(axis=(1, 2)) > 100 * np.abs(usual).max(axis=(1, 2)))


def test_critical_speed_map_rises_to_the_pinned_rotor() -> None:
    found = critical_speed_map(gj90c_rotor(), np.geomspace(1e4, 1e10, 7))
    assert np.all(np.diff(found.forward, axis=1) > -1e-6 * found.forward[:, 1:])
    assert np.all(np.diff(found.forward, axis=0) > 0)
    assert found.forward[0, -1] == pytest.approx(7525.9, abs=0.1)
    assert found.reverse[0, 0] == pytest.approx(121.5, abs=0.1)
    elsewhere = critical_speed_map(gj90c_rotor(), [1e7], [1, 6])
    assert elsewhere.forward[0, 0] != pytest.approx(found.forward[0, 3], rel=0.01)


def test_unsupported_rotor_has_no_critical_speeds_and_no_deflection() -> None:
    free = linear_system(gj90c_rotor(), [])
    with pytest.raises(ValueError, match="supports: they leave the rotor free to move"):
        critical_speeds(free, 8000)
    with pytest.raises(ValueError, match="supports: they leave the rotor free to move"):
        static_deflection(free, gravity=9.81)


def test_imbalance_response_is_linear_with_phase(soft: LinearSystem) -> None:
    one, turned = (imbalance_response(soft, [Imbalance(5, 1e-7, phase)], [700.0]) for phase in (0.0, 1.0))
    assert turned == pytest.approx(one * np.exp(1j), rel=1e-9)
    assert one[0, 1] == pytest.approx(-1j * one[0, 0], rel=1e-9)  # a forward circle: y lags by a quarter turn
    other = imbalance_response(soft, [Imbalance(2, 3e-7, 2.0)], [700.0])
    both = imbalance_response(soft, [Imbalance(5, 1e-7), Imbalance(2, 3e-7, 2.0)], [700.0])
    assert both == pytest.approx(one + other, rel=1e-9)


def test_weight_and_loads_are_carried_by_the_springs() -> None:
    film, outer = SupportCoefficients(((2e6, 0.0), (0.0, 1e6))), SupportCoefficients.isotropic(3e6)
    system = linear_system(gj90c_rotor(), [Support(3, film, outer, 0.02), Support(4, film)])
    sag = static_deflection(system, [StaticLoad(1, 4.0, -2.0)], gravity=9.81)
    spring_y = 1 / (1 / 1e6 + 1 / 3e6)
    # the ring weight acts on the outer film only
    below = sag[1, 2] + 0.02 * 9.81 / 3e6
    assert spring_y * below + 1e6 * sag[1, 3] == pytest.approx(-(0.185 * 9.81 + 2.0), rel=1e-6)
    spring_x = 1 / (1 / 2e6 + 1 / 3e6)
    assert spring_x * sag[0, 2] + 2e6 * sag[0, 3] == pytest.approx(4.0, rel=1e-6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: linear_system(gj90c_rotor(), [Support(7, NEARLY)]), "support: station 7, expected 1 to 6"),
        (lambda: imbalance_response(on(NEARLY), [Imbalance(7, 1e-7)], [1.0]), "imbalance: station 7, expected 1 to 6"),
        (lambda: static_deflection(on(NEARLY), [StaticLoad(0, 1, 1)]), "load: station 0, expected 1 to 6"),
        (lambda: SupportCoefficients.isotropic(0.0), "stiffness: 0 N/m, expected a finite value above 0"),
        (lambda: SupportCoefficients(((1.0, float("inf")), (0.0, 1.0))), "stiffness: inf N/m, expected finite values"),
        (lambda: Support(3, NEARLY, NEARLY), "ring_mass: 0 kg, expected a finite value above 0"),
        (lambda: Support(3, NEARLY, ring_mass=0.1), "ring_mass: 0.1 kg, expected none"),
        (lambda: StaticLoad(3, float("nan"), 0.0), "load: nan N at station 3"),
        (lambda: critical_speed_map(gj90c_rotor(), []), r"stiffnesses: \[\], N/m"),
    ],
)
def test_invalid_arguments_are_refused(make: object, message: str) -> None:
    assert callable(make)
    with pytest.raises(ValueError, match=message):
        make()
