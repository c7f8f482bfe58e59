"""Frequency spectra and the synchronous average."""

from collections.abc import Callable

import numpy as np
import pytest

from analysis.resampling.angular_record import AngularRecord, synchronous_average, synchronous_residual
from analysis.signals.errors import BandLimitError, RecordTooShortError
from analysis.spectra.frequency_spectrum import frequency_spectrum
from analysis.spectra.order_map import order_map
from analysis.spectra.windows import WINDOWS, Window

Maker = Callable[..., AngularRecord]
RATE = 1_000.0


@pytest.mark.parametrize("window", list(WINDOWS.values()), ids=list(WINDOWS))
def test_line_amplitude_and_noise_density_are_correct(window: Window) -> None:
    time = np.arange(200_000) / RATE
    wave = 3.0 * np.cos(2 * np.pi * 100.0 * time) + np.random.default_rng(0).standard_normal(time.size)
    spectrum = frequency_spectrum(wave, RATE, resolution=2.0, window=window)
    assert spectrum.amplitudes[50] == pytest.approx(3.0, rel=0.02)
    away = (np.abs(spectrum.frequencies - 100.0) > 20) & (spectrum.frequencies > 20) & (spectrum.frequencies < 490)
    assert np.mean(spectrum.density[away]) == pytest.approx(2.0 / RATE, rel=0.03)
    assert np.std(spectrum.amplitudes[away]) / np.mean(spectrum.amplitudes[away]) < 1.1 * spectrum.relative_sigma
    assert spectrum.frames > 700


def test_short_waveform_is_refused() -> None:
    with pytest.raises(RecordTooShortError):
        frequency_spectrum(np.zeros(100), RATE)


def test_resolution_beyond_a_quarter_of_the_rate_is_refused() -> None:
    with pytest.raises(BandLimitError, match="resolution"):
        frequency_spectrum(np.zeros(100), RATE, resolution=600.0)
    with pytest.raises(ValueError, match="resolution"):
        frequency_spectrum(np.zeros(100), RATE, resolution=0.0)


def test_synchronous_average_contains_what_repeats(make_angular: Maker) -> None:
    record = make_angular((20.0, 1.0, 0.4), (5.0, 3.0, 0.0), noise=0.5, revolutions=400, mean=(7.0, 0.0))
    average = synchronous_average(record)
    clean = make_angular((20.0, 1.0, 0.4), (5.0, 3.0, 0.0), revolutions=1, mean=(7.0, 0.0)).waveform[:, 0]
    assert average.sigma[0] == pytest.approx(0.5 / 20, rel=0.02)
    assert np.std(average.waveform - clean) == pytest.approx(float(average.sigma[0]), rel=0.15)


def test_synchronous_residual_contains_only_the_whirl(make_angular: Maker) -> None:
    record = make_angular((20.0, 1.0, 0.4), (5.0, 3.0, 0.0), (8.0, 0.47, 0.0), revolutions=200)
    lines = order_map(synchronous_residual(record, 17).section(20, 180)).amplitudes()
    whirl = order_map(record).amplitudes()
    assert lines[:, :, [16, 48]].max() < 0.05
    assert lines[:, :, 7:9].max() == pytest.approx(whirl[:, :, 7:9].max(), rel=0.06)
    with pytest.raises(RecordTooShortError):
        synchronous_residual(make_angular(revolutions=8))
    with pytest.raises(ValueError, match="revolutions"):
        synchronous_residual(record, 1)
