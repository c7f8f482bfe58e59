"""Speed without a tacho."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.resampling.angular_record import angular_record, angular_record_from_codes
from analysis.signals.errors import AmbiguousTachoError, RecordTooShortError
from analysis.signals.probes import ProbePair
from analysis.signals.units import MICROMETRE
from analysis.spectra.order_map import order_map
from analysis.spectra.tacholess_speed import angular_record_without_tacho, speed_from_ridge
from analysis.vectors.order_track import track_order
from analysis.whirl.tracks import subsynchronous_tracks

if TYPE_CHECKING:
    from tests.analysis.conftest import Bench

FloatArray = NDArray[np.float64]
RATE, DURATION = 2_000.0, 8.0
TIME = np.arange(int(RATE * DURATION)) / RATE
TURN_RATE = 100.0 + 10.0 * TIME
TURNS = 100.0 * TIME + 5.0 * TIME**2
LOWEST, HIGHEST = 2 * np.pi * 80.0, 2 * np.pi * 250.0


def motion(noise: float = 0.5, one: float = 20.0) -> FloatArray:
    z = one * MICROMETRE * np.exp(2j * np.pi * TURNS) + 5 * MICROMETRE * np.exp(2j * np.pi * 0.47 * TURNS)
    noises = noise * MICROMETRE * np.random.default_rng(0).standard_normal((2, TIME.size))
    return np.asarray(np.stack([z.real, z.imag]) + noises)


def test_ridge_of_1x_gives_the_speed_of_a_run_up() -> None:
    found = speed_from_ridge(motion(), RATE, LOWEST, HIGHEST)
    truth = 2 * np.pi * np.interp(found.times, TIME, TURN_RATE)
    assert np.abs(found.speeds / truth - 1.0).max() < 0.002
    assert found.confidence[:80].min() > 0.9
    assert found.confidence.min() > 0.5  # the whirl comes into the searched range at the end
    assert (found.sigma > 0.0).all()


def test_orders_from_the_ridge_are_marked_as_not_measured() -> None:
    angle = speed_from_ridge(motion(), RATE, LOWEST, HIGHEST).angle()
    record = angular_record(motion(), RATE, angle, ProbePair(0.0, np.pi / 2), points=16)
    amplitudes = np.abs(order_map(record, highest_order=3.0).spectrum[0, :, 16])
    assert not record.is_measured
    assert np.median(amplitudes) == pytest.approx(20 * MICROMETRE, rel=0.02)


def test_run_without_tacho_has_amplitudes_but_no_phases(make_bench: Callable[..., "Bench"]) -> None:
    bench = make_bench()
    codes = bench.codes(
        bench.ramp(90.0, 150.0, 5.0), bench.circles((20 * MICROMETRE, 1.0, 0.4), (6 * MICROMETRE, 0.47, 0.0)), 5.0
    )
    codes[2] = 0
    with pytest.raises(AmbiguousTachoError, match="0 tacho pulses"):
        angular_record_from_codes(bench.acquisition, codes)
    record, ridge = angular_record_without_tacho(bench.acquisition, codes, 2 * np.pi * 75.0, 2 * np.pi * 200.0)
    assert not record.is_measured
    assert record.pulses is None
    truth = 2 * np.pi * (90.0 + 12.0 * ridge.times)
    assert np.abs(ridge.speeds / truth - 1.0).max() < 0.003
    track = track_order(record, 1.0)
    assert np.median(np.abs(track.vectors)) == pytest.approx(20 * MICROMETRE, rel=0.02)
    np.testing.assert_allclose(track.phase_sigma, np.pi / np.sqrt(3.0))  # that of an unknown phase
    assert np.isnan(track.speed_sigma).all()  # the uncertainty is in the ridge
    whirl = subsynchronous_tracks(order_map(record))[0]
    assert whirl.order == pytest.approx(0.47, abs=0.003)


def test_noise_has_no_confidence_and_no_angle() -> None:
    found = speed_from_ridge(motion(noise=20.0, one=0.0), RATE, LOWEST, HIGHEST)
    assert np.median(found.confidence) < 0.3
    with pytest.raises(AmbiguousTachoError, match="confidence"):
        found.angle()


def test_misuse_is_refused() -> None:
    with pytest.raises(RecordTooShortError):
        speed_from_ridge(motion()[:, :500], RATE, LOWEST, HIGHEST)
    with pytest.raises(ValueError, match="rising"):
        speed_from_ridge(motion(), RATE, HIGHEST, LOWEST)
    with pytest.raises(ValueError, match="finite"):
        speed_from_ridge(np.full((2, 9000), np.nan), RATE, LOWEST, HIGHEST)


def test_zero_signal_gives_no_warning() -> None:
    assert np.isfinite(speed_from_ridge(np.zeros((2, 9_000)), RATE, LOWEST, HIGHEST).speeds).all()
