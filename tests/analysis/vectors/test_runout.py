"""Run-out measured at slow roll and subtracted from records."""

from collections.abc import Callable

import numpy as np
import pytest

from analysis.resampling.angular_record import AngularRecord
from analysis.signals.errors import RecordTooShortError
from analysis.signals.units import MICROMETRE
from analysis.vectors.order_track import track_order
from analysis.vectors.runout import SlowRoll, slow_roll

Maker = Callable[..., AngularRecord]
RUNOUT = (6 * np.cos(2 * np.pi * np.arange(64) / 64 + 1.0) - 4 * (np.arange(64) == 20)) * MICROMETRE  # and a scratch


def with_runout(record: AngularRecord) -> AngularRecord:
    return record.with_waveform(record.waveform + RUNOUT)


def rolled(make_angular: Maker) -> SlowRoll:
    slow = with_runout(make_angular(turn_rate=5.0, revolutions=40, noise=0.1 * MICROMETRE, mean=(1e-4, 2e-4)))
    return slow_roll(slow, 2 * np.pi * 3.0, 2 * np.pi * 8.0)


def test_slow_roll_waveform_is_measured_with_its_uncertainty(make_angular: Maker) -> None:
    roll = rolled(make_angular)
    assert np.std(roll.waveform - (RUNOUT - RUNOUT.mean())) == pytest.approx(float(roll.sigma[0]), rel=0.2)
    assert roll.sigma[0] == pytest.approx(0.1 * MICROMETRE / np.sqrt(40), rel=0.1)
    assert roll.revolutions == 40
    assert roll.peak_to_peak[0] == pytest.approx(np.ptp(RUNOUT), rel=0.03)
    assert roll.is_valid(2 * np.pi * 200.0)
    assert not roll.is_valid(2 * np.pi * 20.0)
    assert roll.exceeds_api_670(20 * MICROMETRE)
    assert not roll.exceeds_api_670(100 * MICROMETRE)


def test_subtracting_the_waveform_leaves_only_the_motion(make_angular: Maker) -> None:
    true = make_angular((10 * MICROMETRE, 1.0, 0.3), (3 * MICROMETRE, 2.0, 0.0), revolutions=40)
    clean = rolled(make_angular).subtract_waveform(with_runout(true))
    error = clean.waveform - true.waveform
    assert (error - error.mean()).std() < 0.03 * MICROMETRE


def test_subtracting_the_vector_gives_the_true_order_and_a_larger_uncertainty(make_angular: Maker) -> None:
    track = track_order(with_runout(make_angular((10 * MICROMETRE, 1.0, 0.3), noise=0.1 * MICROMETRE)), 1.0)
    clean = rolled(make_angular).subtract_vectors(track)
    np.testing.assert_allclose(clean.vectors[0], 10 * MICROMETRE * np.exp(0.3j), atol=5 * clean.sigma.max())
    assert (clean.sigma > track.sigma).all()
    assert clean.phase_sigma.max() < 0.02
    with pytest.raises(ValueError, match="whole order"):
        rolled(make_angular).subtract_vectors(track_order(make_angular((1.0, 0.5, 0.0)), 0.5))


def test_slow_roll_of_a_vibrating_shaft_is_invalid(make_angular: Maker) -> None:
    slow = with_runout(make_angular((4 * MICROMETRE, 1.02, 0.0), turn_rate=5.0, revolutions=40))
    roll = slow_roll(slow, 0.0, 100.0)
    assert roll.drift > 0.2
    assert not roll.is_valid(2 * np.pi * 200.0)


def test_misuse_is_refused(make_angular: Maker) -> None:
    with pytest.raises(RecordTooShortError, match="at least 8"):
        slow_roll(make_angular(turn_rate=100.0), 0.0, 10.0)
    roll = rolled(make_angular)
    with pytest.raises(ValueError, match="order"):
        roll.vectors(0)
    with pytest.raises(ValueError, match="points"):
        roll.subtract_waveform(make_angular(points=32))
