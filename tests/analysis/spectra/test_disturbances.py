"""Drift and mains hum of a record."""

from collections.abc import Callable

import numpy as np
import pytest

from analysis.resampling.angular_record import AngularRecord
from analysis.signals.errors import RecordTooShortError
from analysis.spectra.disturbances import drift, mains_hum

Maker = Callable[..., AngularRecord]
RATE = 5_000.0
TIME = np.arange(20_000) / RATE


def test_drift_is_measured_with_its_uncertainty() -> None:
    noise = np.random.default_rng(0).standard_normal(TIME.size)
    found = drift(3.0 + 0.5 * TIME + noise, RATE)
    assert found.slope == pytest.approx(0.5, abs=3 * found.sigma)
    assert found.total == pytest.approx(2.0, rel=0.1)
    assert found.is_significant
    assert not drift(3.0 + noise, RATE).is_significant


def test_hum_is_separated_from_the_shaft_orders(make_angular: Maker) -> None:
    shaft = 20.0 * np.cos(2 * np.pi * 33.0 * TIME)
    hum = mains_hum(shaft + 0.7 * np.cos(2 * np.pi * 50.0 * TIME), RATE, make_angular(revolutions=131, turn_rate=33.0))
    assert (hum.frequency, hum.is_separable) == (50.0, True)
    assert hum.amplitude == pytest.approx(0.7, rel=0.05)
    own = mains_hum(20.0 * np.cos(2 * np.pi * 50.0 * TIME), RATE, make_angular(revolutions=199, turn_rate=50.0))
    assert not own.is_separable
    assert mains_hum(0.7 * np.cos(2 * np.pi * 60.0 * TIME), RATE).frequency == 60.0


def test_misuse_is_refused() -> None:
    with pytest.raises(RecordTooShortError):
        drift(np.zeros(100), RATE)
    with pytest.raises(ValueError, match="finite"):
        drift(np.full(1000, np.nan), RATE)
