"""Constants of the spectral windows, each against the weights themselves."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal.windows import flattop

from analysis.signals.header import WindowName
from analysis.spectra.order_map import order_spectrum
from analysis.spectra.windows import FLAT_TOP, HANN, UNIFORM, WINDOWS, Window

POINTS = 1024
every_window = pytest.mark.parametrize("window", list(WINDOWS.values()), ids=list(WINDOWS))


def lines_of(window: Window, offset: float, count: int) -> NDArray[np.complex128]:
    """Return the ``count`` lines from 100 on of a component of amplitude 1 at line 100 + ``offset``."""
    wave = np.exp(2j * np.pi * (100 + offset) * np.arange(POINTS) / POINTS)
    return np.asarray(np.fft.fft(window.weights(POINTS) * wave)[100 : 100 + count], dtype=np.complex128)


def test_every_name_has_a_window() -> None:
    assert list(WINDOWS) == list(WindowName)


@every_window
def test_weights_sum_to_one_are_periodic_and_have_the_stated_noise_bandwidth(window: Window) -> None:
    weights = window.weights(POINTS)
    assert weights.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(weights[1:], weights[:0:-1], atol=1e-15)
    assert POINTS * np.sum(weights**2) == pytest.approx(window.noise_bandwidth, rel=1e-4)
    assert not weights.flags.writeable


def test_weights_are_those_of_the_published_windows() -> None:
    reference = flattop(POINTS, sym=False)
    np.testing.assert_allclose(FLAT_TOP.weights(POINTS), reference / reference.sum(), atol=1e-15)
    np.testing.assert_allclose(HANN.weights(8) * 4, np.sin(np.pi * np.arange(8) / 8) ** 2, atol=1e-15)
    np.testing.assert_allclose(UNIFORM.weights(8), 1 / 8)


@every_window
def test_component_on_a_line_reaches_the_side_lines_only(window: Window) -> None:
    lines = lines_of(window, 0.0, 8)
    expected = np.zeros(8)
    expected[: window.main_lobe] = 1.0, *window.side_lines
    np.testing.assert_allclose(lines, expected, atol=1e-12)


@every_window
@pytest.mark.parametrize("offset", [-0.5, -0.3, 0.0, 0.2, 0.5])
def test_response_is_the_size_of_a_line_of_a_component_between_the_lines(window: Window, offset: float) -> None:
    away = np.asarray(offset - np.arange(6), dtype=np.float64)
    lines = lines_of(window, offset, 6)
    np.testing.assert_allclose(lines, window.response(away) * np.exp(1j * np.pi * away), atol=5e-3)


@pytest.mark.parametrize("offset", [0.0, 0.1, 0.3, 0.5])
def test_hann_interpolation_finds_offset_and_amplitude(offset: float) -> None:
    peak, neighbour = np.abs(lines_of(HANN, offset, 2))
    found = HANN.interpolation.offset(np.array([peak]), np.array([neighbour]))
    assert found[0] == pytest.approx(offset, abs=1e-5)
    assert peak / HANN.interpolation.gain(found)[0] == pytest.approx(1.0, abs=1e-5)


def test_stronger_line_has_a_more_accurate_offset() -> None:
    peak, neighbour, sigma = np.array([1.0, 10.0]), np.array([0.8, 8.0]), np.array([0.1, 0.1])
    weak, strong = HANN.interpolation.offset_sigma(peak, neighbour, sigma)
    assert weak == pytest.approx(10 * strong)


def test_offset_sigma_is_the_scatter_of_the_offset_in_noise() -> None:
    random = np.random.default_rng(0)
    component = np.exp(2j * np.pi * 100.3 * np.arange(POINTS) / POINTS)
    noise = random.standard_normal((4000, POINTS, 2)) @ [1.0, 1.0j]
    lines = np.abs(np.fft.fft(HANN.weights(POINTS) * (component + noise), axis=1)[:, 100:102])
    offsets = HANN.interpolation.offset(lines[:, 0], lines[:, 1])
    peak, neighbour = np.abs(lines_of(HANN, 0.3, 2))
    sigma = np.sqrt(HANN.noise_bandwidth / POINTS)  # of the real or imaginary part of a line
    stated = HANN.interpolation.offset_sigma(np.array([peak]), np.array([neighbour]), np.array([sigma]))[0]
    assert np.std(offsets) == pytest.approx(stated, rel=0.05)


def test_window_without_interpolation_is_refused() -> None:
    with pytest.raises(ValueError, match="window: flat top"):
        _ = FLAT_TOP.interpolation


@pytest.mark.parametrize(
    ("window", "revolutions", "expected"),
    [(HANN, 8, [3, 4, 5]), (UNIFORM, 8, [2, 3, 4, 5, 6]), (FLAT_TOP, 16, [6, 7, 8, 9, 10]), (FLAT_TOP, 8, [4])],
)
def test_clear_lines_lie_beyond_the_main_lobes(window: Window, revolutions: int, expected: list[int]) -> None:
    assert np.flatnonzero(window.clear_lines(revolutions + 1, revolutions)).tolist() == expected


@pytest.mark.parametrize("order", [0.17, 0.43, 0.49, 0.5, 0.80, 1.0, 1.21875])
def test_component_between_lines_has_its_order_and_amplitude(order: float) -> None:
    waveform = 41.6 * np.cos(2 * np.pi * order * np.arange(16 * 64) / 64 + 0.4)
    sizes = np.abs(order_spectrum(waveform, 16)[1])
    line = int(np.argmax(sizes))
    offset, size = HANN.component(sizes, line)
    assert (line + offset) / 16 == pytest.approx(order, abs=0.002)
    assert size == pytest.approx(41.6, rel=0.01)
    assert FLAT_TOP.component(sizes, line) == (0.0, sizes[line])
