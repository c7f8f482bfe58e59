"""Calibration fits: a probe's curve, and the state levels of a tacho signal."""

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.preflight.calibration import SignalLevels, default_order, find_state_levels, fit_calibration
from analysis.signals.errors import CalibrationFitError

TRUE = (12e-6, 96.5e-6, 0.55e-6, -0.03e-6)
VOLTS = np.linspace(0.5, 9.5, 10)
GAPS = np.asarray(np.polynomial.polynomial.polyval(VOLTS, TRUE), dtype=np.float64)


def test_fit_finds_the_polynomial_of_the_points_in_any_sequence() -> None:
    shuffled = np.random.default_rng(1).permutation(VOLTS.size)
    fit = fit_calibration(GAPS[shuffled], VOLTS[shuffled], 3)
    assert fit.coefficients == pytest.approx(TRUE, rel=1e-6, abs=1e-12)
    assert (fit.volts_low, fit.volts_high, fit.order) == (0.5, 9.5, 3)
    assert fit.residual < 1e-12


def test_residual_is_the_largest_deviation_of_a_point() -> None:
    moved = GAPS.copy()
    moved[4] += 5e-6
    fit = fit_calibration(moved, VOLTS, 3)
    values = np.polynomial.polynomial.polyval(VOLTS, fit.coefficients)
    assert fit.residuals == pytest.approx(values - moved, abs=1e-12)
    assert fit.residual == pytest.approx(np.max(np.abs(values - moved)), rel=1e-6)
    assert 1e-6 < fit.residual < 5e-6
    assert int(np.argmax(np.abs(fit.residuals))) == 4


def test_fit_of_too_low_an_order_shows_a_residual() -> None:
    assert fit_calibration(GAPS, VOLTS, 1).residual > 10 * fit_calibration(GAPS, VOLTS, 3).residual


def test_default_order_is_lower_with_few_points() -> None:
    assert [default_order(n) for n in (2, 3, 4, 5, 20)] == [1, 1, 2, 3, 3]


@pytest.mark.parametrize(
    ("gaps", "volts", "order", "message"),
    [
        (GAPS[:4], VOLTS[:4], 3, "4 points, expected at least 5"),
        (GAPS, -VOLTS, 1, "expected a voltage that rises with the gap"),
        (np.full(10, 1e-4), VOLTS, 1, "expected a voltage that rises with the gap"),
        (np.where(np.arange(10) == 3, np.nan, GAPS), VOLTS, 1, "not a finite number"),
        (np.array([0, 1, 2, 3, 9, 9.1, 9.2, 9.3]) * 1e-6, np.arange(8.0), 5, "try a lower order"),
    ],
    ids=["few", "falls", "one gap", "nan", "wiggles"],
)
def test_points_without_a_valid_calibration_are_refused(
    gaps: NDArray[np.float64], volts: NDArray[np.float64], order: int, message: str
) -> None:
    with pytest.raises(CalibrationFitError, match=message):
        fit_calibration(gaps, volts, order)


def test_wrong_arguments_are_a_misuse() -> None:
    with pytest.raises(ValueError, match="order 8, expected 1 to 7"):
        fit_calibration(GAPS, VOLTS, 8)
    with pytest.raises(ValueError, match="expected the same"):
        fit_calibration(GAPS, VOLTS[:5], 1)


def test_misread_step_is_named_by_its_gaps() -> None:
    swapped = VOLTS.copy()
    swapped[[4, 5]] = swapped[[5, 4]]
    with pytest.raises(CalibrationFitError, match=r"^5\.500 V at 454\.\d+ µm, 4\.500 V at 554\.\d+ µm"):
        fit_calibration(GAPS, swapped, 3)


def test_outlying_point_is_named() -> None:
    gaps = 1e-4 * np.arange(1.0, 8.0)
    volts = 1e4 * gaps
    beyond = np.append(gaps, 50e-4), np.append(volts, 8.4)
    with pytest.raises(CalibrationFitError, match="try a lower order, or leave out the point at 5000 µm"):
        fit_calibration(*beyond, 3)


FloatArray = NDArray[np.float64]

N = 20_000
TIME = np.arange(N) / N
RNG = np.random.default_rng(7)


def square(
    *, high: float = 4.2, low: float = 0.1, duty: float = 0.5, turns: float = 20.0, noise: float = 0.01
) -> FloatArray:
    return np.where(turns * TIME % 1.0 < duty, high, low) + noise * RNG.standard_normal(N)


@pytest.mark.parametrize("duty", [0.02, 0.1, 0.5, 0.9, 0.98])
def test_levels_of_a_square_wave_are_found_for_any_duty_cycle(duty: float) -> None:
    found = find_state_levels(square(duty=duty))
    assert found is not None
    assert (found.low, found.high) == pytest.approx((0.1, 4.2), abs=0.01)
    assert found.scatter == pytest.approx(0.01, rel=0.2)
    assert found.high_fraction == pytest.approx(duty, abs=0.005)


def test_slow_edges_do_not_shift_the_levels() -> None:
    edges = np.clip(np.abs((20 * TIME % 1.0) - 0.5) * 12 - 2.5, 0.0, 1.0)
    found = find_state_levels(4.0 * edges)
    assert found is not None
    assert (found.low, found.high) == pytest.approx((0.0, 4.0), abs=1e-6)


@pytest.mark.parametrize(
    "volts",
    [
        np.full(N, 2.0),
        2.0 + 0.5 * np.sin(40 * np.pi * TIME),
        RNG.standard_normal(N),
        RNG.uniform(0.0, 5.0, N),
        5.0 * TIME,
        2.0 + 0.02 * np.sign(np.sin(40 * np.pi * TIME)),
    ],
    ids=["constant", "sine", "normal", "uniform", "ramp", "tiny"],
)
def test_voltage_that_does_not_switch_has_no_levels(volts: FloatArray) -> None:
    assert find_state_levels(volts) is None


def test_hysteresis_grows_with_noise_and_stays_within_the_swing() -> None:
    assert SignalLevels(0.0, 4.0, 0.01, 0.5).hysteresis == 1.0
    assert SignalLevels(0.0, 4.0, 0.2, 0.5).hysteresis == pytest.approx(1.6)
    assert SignalLevels(0.0, 4.0, 0.6, 0.5).hysteresis == pytest.approx(2.4)
    assert SignalLevels(1.0, 4.0, 0.0, 0.5).middle == 2.5


def test_levels_of_no_samples_are_refused() -> None:
    with pytest.raises(ValueError, match="volts: shape"):
        find_state_levels(np.empty(0))
