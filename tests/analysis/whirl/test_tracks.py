"""Tracks of components below 1X, and their classification as whirl or whip."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.resampling.angular_record import AngularRecord
from analysis.signals.units import MICROMETRE
from analysis.spectra.order_map import order_map
from analysis.spectra.windows import FLAT_TOP
from analysis.whirl.tracks import Behaviour, SubsynchronousTrack, subsynchronous_tracks

Maker = Callable[..., AngularRecord]
FloatArray = NDArray[np.float64]
POINTS = 64


def run_up(make_angular: Maker, frequency: Callable[[FloatArray], FloatArray], onset: float = 0.0) -> AngularRecord:
    """Return a run-up from 100 to 500 revolutions per second with 1X and a component of given frequency, Hz."""
    revolutions = 3000
    turns = np.arange(revolutions * POINTS + 1) / POINTS
    speed = np.sqrt(100.0**2 + (500.0**2 - 100.0**2) * turns / revolutions)  # an even rise in time
    time = np.concatenate([[0.0], np.cumsum(1.0 / (0.5 * (speed[1:] + speed[:-1]) * POINTS))])
    wave = frequency(speed)
    phase = np.concatenate([[0.0], np.cumsum(0.5 * (wave[1:] + wave[:-1]) * np.diff(time))])
    z = 20 * MICROMETRE * np.exp(2j * np.pi * turns) + 8 * MICROMETRE * (speed >= onset) * np.exp(2j * np.pi * phase)
    motion = np.stack([z.real, z.imag])[:, :-1].reshape(2, revolutions, POINTS)
    motion += 0.1 * MICROMETRE * np.random.default_rng(0).standard_normal(motion.shape)
    return AngularRecord(motion, 0, time[::POINTS], make_angular().pair, 0.0, np.zeros(revolutions + 1))


def strongest(record: AngularRecord) -> SubsynchronousTrack:
    return max(subsynchronous_tracks(order_map(record)), key=lambda track: track.amplitudes.sum())


def test_whirl_has_a_constant_order(make_angular: Maker) -> None:
    track = strongest(run_up(make_angular, lambda speed: 0.47 * speed, onset=250.0))
    assert track.behaviour is Behaviour.WHIRL
    assert track.exponent == pytest.approx(1.0, abs=0.02)
    assert track.order == pytest.approx(0.47, abs=0.001)
    assert track.onset_speed / (2 * np.pi) == pytest.approx(250.0, abs=4.0)
    assert track.end_speed / (2 * np.pi) == pytest.approx(500.0, abs=4.0)
    assert np.median(track.amplitudes) == pytest.approx(8 * MICROMETRE, rel=0.01)
    assert track.is_forward


def test_whip_has_a_constant_frequency(make_angular: Maker) -> None:
    track = strongest(run_up(make_angular, lambda speed: np.full_like(speed, 85.0), onset=150.0))
    assert track.behaviour is Behaviour.WHIP
    assert track.exponent == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("lock", [130.0, 150.0, 200.0, 300.0, 400.0, 450.0])
def test_whirl_to_whip_has_a_lock_speed_in_any_part_of_its_range(make_angular: Maker, lock: float) -> None:
    track = strongest(run_up(make_angular, lambda speed: np.minimum(0.47 * speed, 0.47 * lock)))
    assert track.behaviour is Behaviour.WHIRL_TO_WHIP
    assert track.lock_speed / (2 * np.pi) == pytest.approx(lock, rel=3e-4)
    assert 0.0 < track.lock_speed_sigma < 1e-3 * track.lock_speed


def test_frequency_with_the_root_of_the_speed_is_neither_whirl_nor_whip(make_angular: Maker) -> None:
    track = strongest(run_up(make_angular, lambda speed: 6.8 * np.sqrt(speed)))
    assert track.behaviour is Behaviour.NEITHER
    assert np.isnan(track.lock_speed)


def test_all_components_at_constant_speed_are_found(make_angular: Maker) -> None:
    record = make_angular(
        (20 * MICROMETRE, 1.0, 0.0),
        (8 * MICROMETRE, 0.47, 0.0),
        (3 * MICROMETRE, -0.21, 0.0),
        (1.5 * MICROMETRE, 0.75, 0.0),
        revolutions=200,
        noise=0.1 * MICROMETRE,
    )
    tracks = sorted(subsynchronous_tracks(order_map(record)), key=lambda track: track.order)
    assert [track.order for track in tracks] == pytest.approx([0.21, 0.47, 0.75], abs=0.003)
    assert [track.amplitudes.mean() / MICROMETRE for track in tracks] == pytest.approx([3.0, 8.0, 1.5], rel=0.05)
    assert [track.is_forward for track in tracks] == [False, True, True]
    assert {track.behaviour for track in tracks} == {Behaviour.UNKNOWN}


def test_1x_and_noise_give_no_component(make_angular: Maker) -> None:
    record = make_angular(
        (20 * MICROMETRE, 1.0, 0.0), (5 * MICROMETRE, 2.0, 0.0), revolutions=2000, noise=0.3 * MICROMETRE
    )
    assert subsynchronous_tracks(order_map(record)) == ()


def test_successive_components_are_separate_tracks(make_angular: Maker) -> None:
    one = make_angular((20 * MICROMETRE, 1.0, 0.0), (5 * MICROMETRE, 0.4, 0.0), revolutions=160, noise=0.1 * MICROMETRE)
    quiet = make_angular((20 * MICROMETRE, 1.0, 0.0), revolutions=160, noise=0.1 * MICROMETRE)
    waveform = np.concatenate([one.waveform, quiet.waveform, one.waveform], axis=1)
    record = AngularRecord(waveform, 0, np.arange(481) / 100.0, one.pair, 0.0, np.zeros(481))
    tracks = subsynchronous_tracks(order_map(record))
    assert len(tracks) == 2
    assert all(a.times[-1] < b.times[0] for a, b in pairwise(tracks))


def test_unsuitable_windows_and_frames_are_refused(make_angular: Maker) -> None:
    record = make_angular((20 * MICROMETRE, 1.0, 0.0))
    with pytest.raises(ValueError, match="order_map"):
        subsynchronous_tracks(order_map(record, window=FLAT_TOP))
    with pytest.raises(ValueError, match="order_map"):
        subsynchronous_tracks(order_map(record, revolutions=4))
