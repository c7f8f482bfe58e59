"""Order spectra against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.spectra.order_spectrum import order_spectrum, order_vectors


def angles(revolutions: int, points: int) -> np.ndarray:
    return 2 * np.pi * np.arange(revolutions * points) / points


def test_order_spectrum_gives_peak_amplitude_and_phase_of_each_order() -> None:
    theta = angles(16, 64)
    waveform = 3.0 * np.cos(theta + 0.4) + 1.5 * np.cos(2 * theta - 1.2) + 0.25 * np.cos(7.5 * theta)
    orders, spectrum = order_spectrum(waveform, 16)
    assert orders[16] == 1.0
    assert spectrum[16] == pytest.approx(3.0 * np.exp(0.4j), rel=1e-12)
    assert spectrum[32] == pytest.approx(1.5 * np.exp(-1.2j), rel=1e-12)
    assert spectrum[120] == pytest.approx(0.25, rel=1e-11)


def test_order_spectrum_scales_order_zero_and_the_nyquist_line() -> None:
    waveform = 2.0 + 0.5 * np.cos(np.pi * np.arange(8 * 16))
    _, spectrum = order_spectrum(waveform, 8)
    assert spectrum[0] == pytest.approx(2.0)
    assert spectrum[-1] == pytest.approx(0.5)


def test_order_spectrum_keeps_leading_axes() -> None:
    theta = angles(4, 32)
    waveform = np.stack([np.cos(theta), 2 * np.sin(theta), np.zeros_like(theta)])[None]
    orders, spectrum = order_spectrum(waveform, 4)
    assert spectrum.shape == (1, 3, orders.size)
    np.testing.assert_allclose(spectrum[0, :, 4], [1, -2j, 0], atol=1e-14)


def test_order_spectrum_of_1x_beside_whirl_is_accurate_within_two_per_mille() -> None:
    theta = angles(16, 64)
    for phase in np.linspace(0, 2 * np.pi, 9):
        waveform = 20 * np.cos(theta) + 8 * np.cos(0.47 * theta + phase)
        _, spectrum = order_spectrum(waveform, 16)
        assert abs(spectrum[16] - 20) / 20 < 0.002


@pytest.mark.parametrize(("n", "revolutions"), [(0, 1), (31, 16), (64, 0)])
def test_order_spectrum_refuses_frames_that_are_too_short(n: int, revolutions: int) -> None:
    with pytest.raises(ValueError, match="revolutions"):
        order_spectrum(np.zeros(n), revolutions)


@given(
    scale=st.floats(-1e3, 1e3),
    seed=st.integers(0, 2**32 - 1),
)
def test_order_spectrum_is_linear(scale: float, seed: int) -> None:
    a, b = np.random.default_rng(seed).standard_normal((2, 4 * 16))
    _, together = order_spectrum(a + scale * b, 4)
    _, one = order_spectrum(a, 4)
    _, other = order_spectrum(b, 4)
    np.testing.assert_allclose(together, one + scale * other, atol=1e-12 * (1 + abs(scale)))


def test_order_vectors_are_whole_orders_and_zero_beyond_the_axis() -> None:
    theta = angles(4, 16)
    _, spectrum = order_spectrum(np.stack([np.cos(theta), 2 * np.cos(2 * theta)]), 4)
    vectors = order_vectors(spectrum[:, :10], 4, 3)
    np.testing.assert_allclose(vectors, [[1, 0], [0, 2], [0, 0]], atol=1e-14)
