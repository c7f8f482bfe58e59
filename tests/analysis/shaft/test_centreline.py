"""The shaft centreline."""

from collections.abc import Callable

import numpy as np
import pytest

from analysis.resampling.angular_record import AngularRecord
from analysis.shaft.centreline import centreline
from analysis.signals.errors import RecordTooShortError
from analysis.signals.units import MICROMETRE

Maker = Callable[..., AngularRecord]


def test_shaft_lifts_from_its_rest_position(make_angular: Maker) -> None:
    record = make_angular(
        (20 * MICROMETRE, 1.0, 0.0), noise=0.5 * MICROMETRE, mean=(-500 * MICROMETRE, -480 * MICROMETRE)
    )
    line = centreline(record, np.array([-520 * MICROMETRE, -540 * MICROMETRE]), 100 * MICROMETRE)
    np.testing.assert_allclose(line.positions[0], 20 * MICROMETRE, atol=0.05 * MICROMETRE)
    np.testing.assert_allclose(line.positions[1], -40 * MICROMETRE, atol=0.05 * MICROMETRE)
    np.testing.assert_allclose(line.eccentricity_ratio, np.hypot(0.2, 0.4), atol=1e-3)
    np.testing.assert_allclose(line.attitude, np.arctan2(20, 40), atol=2e-3)
    assert line.is_inside.all()
    assert line.sigma.mean() == pytest.approx(0.5 * MICROMETRE / np.sqrt(16 * 64), rel=0.3)
    assert line.speeds.size == 4
    np.testing.assert_allclose(np.hypot(*line.circle()), 100 * MICROMETRE)


def test_wrong_rest_position_shows_as_a_shaft_outside_its_clearance(make_angular: Maker) -> None:
    line = centreline(
        make_angular(mean=(0.0, 0.0)), np.zeros(2), 100 * MICROMETRE, rest_position=(0.0, -150 * MICROMETRE)
    )
    assert not line.is_inside.any()


def test_misuse_is_refused(make_angular: Maker) -> None:
    record = make_angular(revolutions=8)
    with pytest.raises(RecordTooShortError):
        centreline(record, np.zeros(2), 100 * MICROMETRE)
    with pytest.raises(ValueError, match="clearance"):
        centreline(record, np.zeros(2), 0.0)
