"""The simulated card's converter: scaling and codes."""

import numpy as np
import pytest

from analysis.signals.header import CODE_MAX, CODE_MIN
from daq.drivers.simulation.card import quantized, scaling_polynomial


@pytest.mark.parametrize("full_range", [0.1, 1.0, 5.0, 10.0])
def test_codes_invert_the_scaling_to_half_a_step(full_range: float) -> None:
    polynomial = scaling_polynomial(full_range)
    volts = np.linspace(-full_range, full_range, 100_001)
    back = np.polynomial.polynomial.polyval(quantized(volts, polynomial).astype(np.float64), polynomial)
    assert np.abs(back - volts).max() <= 0.5001 * polynomial[1]


def test_every_code_survives_a_round_trip_through_its_voltage() -> None:
    every = np.arange(CODE_MIN, CODE_MAX + 1).astype(np.int16)
    volts = np.asarray(
        np.polynomial.polynomial.polyval(every.astype(np.float64), scaling_polynomial(10.0)), dtype=np.float64
    )
    np.testing.assert_array_equal(quantized(volts, scaling_polynomial(10.0)), every)


def test_scaling_is_nonlinear_by_more_than_a_code_over_the_range() -> None:
    """A program that assumes range over codes fails with this converter."""
    offset, gain, square, cube = scaling_polynomial(10.0)
    assert abs(offset) > gain
    assert abs(square * 32768**2) + abs(cube * 32768**3) > gain


def test_codes_are_clipped_at_the_rails() -> None:
    held = quantized(np.array([-25.0, 25.0]), scaling_polynomial(10.0))
    np.testing.assert_array_equal(held, np.array([CODE_MIN, CODE_MAX], dtype=np.int16))
