"""Glitch detection and repair."""

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.header import Tacho
from analysis.signals.units import MICROMETRE
from analysis.tacho.pulse_record import pulse_record
from analysis.tacho.shaft_angle import ShaftAngle, shaft_angle
from analysis.vectors.glitches import find_glitches

FloatArray = NDArray[np.float64]
RATE, SAMPLES = 20_000.0, 20_000


def angle() -> ShaftAngle:
    tacho = Tacho(threshold=2.0, hysteresis=1.0, response_time=1e-5)
    return shaft_angle(pulse_record(np.arange(0.0, 1.0, 0.01), tacho))


def motion(whirl: float = 4.0) -> FloatArray:
    """Return 1X with a scratch on the shaft, a whirl, µm peak, and noise."""
    turns = 100.0 * np.arange(SAMPLES) / RATE
    z = 20 * MICROMETRE * np.exp(2j * np.pi * turns) + whirl * MICROMETRE * np.exp(2j * np.pi * 0.47 * turns)
    scratch = -15 * MICROMETRE * (np.abs(turns % 1.0 - 0.3) < 0.006)
    noise = 0.1 * MICROMETRE * np.random.default_rng(0).standard_normal((2, SAMPLES))
    return np.asarray(np.stack([z.real, z.imag]) + scratch + noise)


def test_scratch_in_every_revolution_is_no_glitch() -> None:
    found = find_glitches(motion(), RATE, angle())
    assert found.flagged.mean(axis=1).max() < 0.002
    np.testing.assert_array_equal(found.unrepaired, (0, 0))


def test_short_glitches_are_counted_and_repaired() -> None:
    clean = motion()
    spoiled = clean.copy()
    places = np.array([2_050, 5_555, 9_001, 14_003])
    before = find_glitches(clean, RATE, angle())
    for width, place in zip((1, 2, 3, 1), places, strict=True):
        spoiled[0, place : place + width] += 120 * MICROMETRE
    found = find_glitches(spoiled, RATE, angle())
    assert found.count[0] == before.count[0] + 4
    assert found.count[1] == before.count[1]
    assert found.repaired[0, places].all()
    assert np.abs(found.displacement[0] - clean[0])[places].max() < 6 * MICROMETRE
    untouched = ~found.repaired
    np.testing.assert_array_equal(found.displacement[untouched], spoiled[untouched])


@pytest.mark.parametrize("whirl", [0.0, 0.5, 2.0, 5.0, 20.0])
def test_every_glitch_during_whirl_is_found(whirl: float) -> None:
    random = np.random.default_rng(1)
    spoiled, places = motion(whirl), np.linspace(1_000, 19_000, 60).astype(int) + random.integers(0, 50, 60)
    is_glitch = np.zeros(SAMPLES, dtype=np.bool_)
    for place, width, size in zip(places, random.integers(1, 4, 60), random.uniform(8.0, 30.0, 60), strict=True):
        spoiled[0, place : place + width] += random.choice([-1.0, 1.0]) * size * MICROMETRE
        is_glitch[place : place + width] = True
    found = find_glitches(spoiled, RATE, angle())
    np.testing.assert_array_equal(found.flagged[0], is_glitch)
    assert not found.flagged[1].any()
    assert found.smallest.max() < 1.5 * MICROMETRE
    error = (found.displacement[0] - motion(whirl)[0])[found.repaired[0]]
    assert np.sqrt(np.mean(error**2)) < 1.5 * MICROMETRE


def test_long_glitches_are_counted_and_not_repaired() -> None:
    spoiled = motion()
    spoiled[1, 7_000:7_010] += 150 * MICROMETRE
    found = find_glitches(spoiled, RATE, angle())
    assert found.unrepaired[1] >= 1
    np.testing.assert_array_equal(found.displacement[1, 7_000:7_010], spoiled[1, 7_000:7_010])
    assert found.flagged[1, 7_000:7_010].all()


def test_constant_signals_have_no_glitches() -> None:
    assert find_glitches(np.ones((2, SAMPLES)), RATE, angle()).count == (0, 0)
    with pytest.raises(ValueError, match="displacement"):
        find_glitches(np.ones((3, 10)), RATE, angle())
