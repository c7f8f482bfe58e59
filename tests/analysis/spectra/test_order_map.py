"""Order spectra and order maps against closed forms."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis.resampling.angular_record import AngularRecord
from analysis.signals.errors import RecordTooShortError
from analysis.signals.units import MICROMETRE
from analysis.spectra.order_map import Scaling, order_map, order_spectrum, order_vectors
from analysis.spectra.windows import FLAT_TOP, WINDOWS, Window
from analysis.vectors.order_track import track_order

Maker = Callable[..., AngularRecord]
SHARED = [HealthCheck.function_scoped_fixture]


@pytest.mark.parametrize("window", list(WINDOWS.values()), ids=list(WINDOWS))
@pytest.mark.parametrize(
    ("scaling", "factor"), [(Scaling.PEAK, 1.0), (Scaling.RMS, 0.5**0.5), (Scaling.PEAK_TO_PEAK, 2.0)]
)
def test_line_has_its_amplitude_in_every_window_and_scaling(
    make_angular: Maker, window: Window, scaling: Scaling, factor: float
) -> None:
    amplitudes = order_map(make_angular((20.0, 1.0, 0.4)), window=window).amplitudes(scaling)
    np.testing.assert_allclose(amplitudes[:, :, 16], factor * 20.0, rtol=1e-9)


def test_flat_top_window_is_accurate_between_the_lines(make_angular: Maker) -> None:
    record = make_angular((20.0, 1.03125, 0.0))  # halfway between two lines
    assert order_map(record, window=FLAT_TOP).amplitudes().max() == pytest.approx(20.0, rel=0.002)
    assert order_map(record).amplitudes().max() == pytest.approx(17.0, rel=0.01)


@pytest.mark.parametrize("window", list(WINDOWS.values()), ids=list(WINDOWS))
def test_noise_matches_the_stated_bandwidth(make_angular: Maker, window: Window) -> None:
    record = make_angular(noise=1.0, revolutions=2000)
    spectrum = order_map(record, window=window, overlap=0.0).spectrum[:, :, 20:120]
    expected = np.sqrt(2.0 * window.noise_bandwidth / (16 * 64))
    assert np.std(spectrum.real) == pytest.approx(expected, rel=0.02)


def test_frames_have_speed_acceleration_time_and_first_revolution(make_angular: Maker) -> None:
    record = make_angular((1.0, 1.0, 0.0), revolutions=200)
    turns = np.arange(201)
    times = (np.sqrt(100.0**2 + 40.0 * turns) - 100.0) / 20.0  # 20 revolutions a second squared
    frames = order_map(replace(record, first_turn=7, times=times))
    assert frames.turns[0] == 7
    assert frames.turns[1] == 11
    np.testing.assert_allclose(frames.accelerations, 2 * np.pi * 20.0, rtol=0.01)
    np.testing.assert_allclose(frames.speeds, 2 * np.pi * (100.0 + 20.0 * frames.times), rtol=1e-3)


@settings(max_examples=20, deadline=None, suppress_health_check=SHARED)
@given(scale=st.floats(1e-3, 1e3), turn=st.floats(-np.pi, np.pi), constant=st.floats(-100.0, 100.0))
def test_vectors_scale_and_rotate_with_the_motion_and_ignore_a_constant(
    make_angular: Maker, scale: float, turn: float, constant: float
) -> None:
    base = make_angular((1.0, 1.0, 0.2), (0.4, 0.47, 0.0))
    other = make_angular((scale, 1.0, 0.2 + turn), (0.4 * scale, 0.47, 0.0), mean=(constant, -constant))
    for one, two in (
        (order_map(base).spectrum[:, :, 16], order_map(other).spectrum[:, :, 16]),
        (track_order(base, 1.0).vectors, track_order(other, 1.0).vectors),
    ):
        np.testing.assert_allclose(two, scale * one * np.exp(1j * turn), atol=2e-3 * scale + 1e-9)


def test_track_of_a_whole_order_is_the_line_of_the_map(make_angular: Maker) -> None:
    record = make_angular((20.0, 1.0, 0.4), (5.0, 2.0, 0.1), noise=0.1)
    np.testing.assert_allclose(track_order(record, 2.0).vectors, order_map(record).spectrum[:, :, 32], atol=1e-9)


@pytest.mark.parametrize("order", [0.47, 1.0, 1.31, 6.3])
def test_non_integer_order_is_tracked_with_continuous_phase(make_angular: Maker, order: float) -> None:
    track = track_order(make_angular((8.0, order, 0.7), (20.0, 3.0, 0.0)), order)
    truth = 8.0 * np.exp(0.7j) * np.array([1.0, -1.0j])[:, None]
    np.testing.assert_allclose(track.vectors, truth * np.ones_like(track.vectors), atol=0.02)
    assert track.order == order


def test_1x_beside_a_whirl_is_accurate_within_two_per_mille(make_angular: Maker) -> None:
    track = track_order(make_angular((20 * MICROMETRE, 1.0, 0.0), (8 * MICROMETRE, 0.47, 0.0), turn_rate=1000.0), 1.0)
    assert np.abs(np.abs(track.vectors) / (20 * MICROMETRE) - 1.0).max() < 0.002


@pytest.mark.parametrize("order", [0.3, 0.5, 1.0, 1.31])
def test_shortest_window_has_an_uncertainty(make_angular: Maker, order: float) -> None:
    quiet = track_order(make_angular(noise=0.1), order, revolutions=4)
    assert np.median(quiet.sigma) == pytest.approx(0.1 * np.sqrt(2 * 1.5 / 256), rel=0.25)
    assert (quiet.sigma > 0.0).all()


def test_tacho_jitter_raises_the_phase_uncertainty_of_high_orders(make_angular: Maker) -> None:
    record = make_angular((20.0, 1.0, 0.0), (20.0, 4.0, 0.0))
    shaky = replace(record, angle_jitter=1e-4)
    first, fourth = track_order(shaky, 1.0).phase_sigma[0, 0], track_order(shaky, 4.0).phase_sigma[0, 0]
    assert fourth == pytest.approx(4 * first, rel=0.01)
    assert first == pytest.approx(2 * np.pi * 100 * 1e-4 * np.sqrt(1.5 / 16), rel=0.01)


@pytest.mark.parametrize(
    "wrong", [{"revolutions": 0}, {"overlap": 1.0}, {"highest_order": 13.0}, {"highest_order": 0.0}]
)
def test_settings_out_of_range_are_refused(make_angular: Maker, wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="expected"):
        order_map(make_angular((1.0, 1.0, 0.0)), **wrong)  # type: ignore[arg-type]  # what a caller may get wrong


def test_record_shorter_than_a_frame_is_refused(make_angular: Maker) -> None:
    short = make_angular((1.0, 1.0, 0.0), revolutions=15)
    with pytest.raises(RecordTooShortError, match="15 revolutions"):
        order_map(short)
    with pytest.raises(RecordTooShortError, match="15 revolutions"):
        track_order(short, 1.0)
    with pytest.raises(ValueError, match="order 20"):
        track_order(short, 20.0)


def test_zero_signal_gives_zero_without_warnings(make_angular: Maker) -> None:
    silent = make_angular((0.0, 1.0, 0.0))
    assert order_map(silent).amplitudes().max() == 0.0
    track = track_order(silent, 1.0)
    assert np.abs(track.vectors).max() == 0.0
    np.testing.assert_allclose(track.phase_sigma, np.pi / np.sqrt(3.0))


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
