"""The search for components below 1X on known components."""

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.probes import ProbePair
from analysis.signals.snapshot import Whirl
from analysis.spectra.order_map import order_spectrum
from analysis.whirl.components import find_whirl, find_whirls, noise_floor, without_synchronous

FloatArray = NDArray[np.float64]
PAIR = ProbePair(0.0, np.pi / 2)
THETA = 2 * np.pi * np.arange(16 * 64) / 64


def whirl_of(z: NDArray[np.complex128], noise: float = 0.01) -> Whirl | None:
    random = np.random.default_rng(7).standard_normal((2, z.size))
    waveform = np.stack([z.real, z.imag]) + noise * random
    _, spectrum = order_spectrum(waveform - waveform.mean(axis=1, keepdims=True), 16)
    spectrum = spectrum[:, : 8 * 16 + 1]
    return find_whirl(spectrum, 16, noise_floor(spectrum, 16), PAIR)


@pytest.mark.parametrize("order", [0.14, 0.17, 0.28, 0.33, 0.4375, 0.47, 0.49, 0.62, 0.75])
@pytest.mark.parametrize("phase", [0.0, 1.5, 3.0])
def test_order_and_amplitude_are_found_beside_a_large_1x(order: float, phase: float) -> None:
    z = 20 * np.exp(1j * THETA) + 8 * np.exp(1j * (order * THETA + phase))
    whirl = whirl_of(z)
    assert whirl is not None
    assert whirl.order == pytest.approx(order, abs=0.002)
    assert whirl.amplitude == pytest.approx(8, rel=0.02)
    assert whirl.is_forward
    assert whirl.backward < 0.02 * whirl.forward


def test_backward_whirl_is_recognised() -> None:
    whirl = whirl_of(20 * np.exp(1j * THETA) + 5 * np.exp(-0.41j * THETA) + 2 * np.exp(0.41j * THETA))
    assert whirl is not None
    assert not whirl.is_forward
    assert (whirl.forward, whirl.backward) == pytest.approx((2, 5), rel=0.01)


def test_strongest_of_two_components_is_returned() -> None:
    whirl = whirl_of(20 * np.exp(1j * THETA) + 8 * np.exp(0.49j * THETA) + 12 * np.exp(0.17j * THETA))
    assert whirl is not None
    assert whirl.order == pytest.approx(0.17, abs=0.005)


@pytest.mark.parametrize("seed", range(40))
def test_noise_and_1x_are_no_whirl(seed: int) -> None:
    noise = np.random.default_rng(seed).standard_normal((2, THETA.size))
    z = 5 * np.exp(1j * THETA) + np.exp(2j * THETA) + noise[0] + 1j * noise[1]
    assert whirl_of(z, noise=0.0) is None


def test_changing_1x_and_gap_drift_are_no_whirl() -> None:
    part = np.linspace(0.0, 1.0, THETA.size)
    z = (20 + 4 * part) * np.exp(1j * (THETA + 0.2 * part**2)) + 3 * part + 1j * part
    assert whirl_of(z) is None


def test_zero_spectrum_has_no_whirl() -> None:
    assert whirl_of(np.zeros(THETA.size, dtype=np.complex128), noise=0.0) is None


def test_noise_floor_is_the_median_between_the_orders() -> None:
    noise = np.random.default_rng(0).standard_normal((2, THETA.size))
    _, spectrum = order_spectrum(50 * np.cos(THETA) + 20 * np.cos(2 * THETA) + noise, 16)
    sigma = np.sqrt(2 * 1.5 / THETA.size)  # of either part of a Hann line
    assert noise_floor(spectrum[:, :129], 16) == pytest.approx(1.177 * sigma, rel=0.1)


def test_subtracting_1x_leaves_no_residual() -> None:
    _, spectrum = order_spectrum(np.stack([3 * np.cos(THETA + 1), np.sin(THETA)]), 16)
    assert np.abs(without_synchronous(spectrum, 16)).max() < 1e-13


def test_sidebands_of_1x_from_tacho_scatter_are_rejected() -> None:
    waveform = np.stack([20 * np.cos(THETA) + 0.3 * np.cos(0.7 * THETA), 20 * np.sin(THETA)])
    _, spectrum = order_spectrum(waveform, 16)
    assert find_whirls(spectrum[:, :129], 16, 0.0, PAIR) != ()
    assert find_whirls(spectrum[:, :129], 16, 0.0, PAIR, scatter=0.05) == ()


def test_all_components_are_found_with_uncertainty_the_strongest_first() -> None:
    expected = [(0.17, 12.0), (0.49, 8.0), (-0.75, 2.0)]
    z = 20 * np.exp(1j * THETA) + sum(size * np.exp(1j * order * THETA) for order, size in expected)
    noise = np.random.default_rng(3).standard_normal((2, THETA.size))
    _, spectrum = order_spectrum(np.stack([z.real, z.imag]) + 0.1 * noise, 16)
    whirls = find_whirls(spectrum[:, :129], 16, noise_floor(spectrum[:, :129], 16), PAIR)
    assert [whirl.order for whirl in whirls] == pytest.approx([abs(order) for order, _ in expected], abs=0.002)
    assert [whirl.amplitude for whirl in whirls] == pytest.approx([size for _, size in expected], rel=0.02)
    assert [whirl.is_forward for whirl in whirls] == [True, True, False]
    sigma = 0.1 * np.sqrt(2 * 1.5 / THETA.size)
    assert [whirl.sigma for whirl in whirls] == pytest.approx([sigma] * 3, rel=0.25)
    assert all(0.0 < whirl.order_sigma < 0.002 for whirl in whirls)


def test_line_without_neighbours_is_not_interpolated() -> None:
    spectrum = np.zeros((2, 33), dtype=np.complex128)
    spectrum[:, 7] = 1e-6, -1e-6j
    with np.errstate(all="raise"):
        whirl = find_whirl(spectrum, 16, 0.0, PAIR)
    assert whirl is not None
    assert abs(whirl.order * 16 - 7) <= 0.5
