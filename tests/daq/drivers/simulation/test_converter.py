"""The simulated card's converter: clocks, ranges, codes."""

import numpy as np
import pytest

from analysis.signals.header import CODE_MAX, CODE_MIN
from daq.config.devices import DEVICES
from daq.drivers.simulation.converter import codes, coerced_rate, convert_rate, scaling


@pytest.mark.parametrize("full_range", [0.1, 1.0, 5.0, 10.0])
def test_codes_invert_the_scaling_to_half_a_step(full_range: float) -> None:
    polynomial = scaling(full_range)
    volts = np.linspace(-full_range, full_range, 100_001)
    back = np.polynomial.polynomial.polyval(codes(volts, polynomial).astype(np.float64), polynomial)
    assert np.abs(back - volts).max() <= 0.5001 * polynomial[1]


def test_every_code_survives_a_round_trip_through_its_voltage() -> None:
    every = np.arange(CODE_MIN, CODE_MAX + 1).astype(np.int16)
    volts = np.asarray(np.polynomial.polynomial.polyval(every.astype(np.float64), scaling(10.0)), dtype=np.float64)
    np.testing.assert_array_equal(codes(volts, scaling(10.0)), every)


def test_scaling_is_nonlinear_by_more_than_a_code_over_the_range() -> None:
    """A program that assumes range over codes fails with this converter."""
    offset, gain, square, cube = scaling(10.0)
    assert abs(offset) > gain
    assert abs(square * 32768**2) + abs(cube * 32768**3) > gain


def test_codes_are_clipped_at_the_rails() -> None:
    held = codes(np.array([-25.0, 25.0]), scaling(10.0))
    np.testing.assert_array_equal(held, np.array([CODE_MIN, CODE_MAX], dtype=np.int16))


@pytest.mark.parametrize(
    ("product", "rate", "channels", "expected"),
    [
        ("USB-6251", 1e3, 3, 1 / 11e-6),
        ("USB-6251", 250e3, 4, 1e6),
        ("USB-6251", 100e3, 2, 2e5),
        ("USB-6211", 1e3, 3, 1 / 14e-6),
        ("USB-6211", 80e3, 3, 20e6 / 83),
        ("PCIe-6321", 1e3, 3, 1 / 14e-6),
        ("PCIe-6321", 80e3, 3, 100e6 / 416),
    ],
)
def test_convert_clock_is_padded_if_the_sample_interval_allows_it(
    product: str, rate: float, channels: int, expected: float
) -> None:
    assert convert_rate(DEVICES[product], rate, channels) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("product", "expected"), [("USB-6251", 20e6 / 667), ("USB-6211", 20e6 / 667), ("PCIe-6321", 100e6 / 3333)]
)
def test_rate_is_coerced_to_the_timebase_of_the_card(product: str, expected: float) -> None:
    assert coerced_rate(DEVICES[product], 30e3) == expected
