"""Low-frequency signals: mains hum separated from shaft orders."""

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.spectra.disturbances import LowFrequencySignal

RATE = 20_000.0
TIME = np.arange(20_000) / RATE
NOISE = 0.1 * np.random.default_rng(3).standard_normal(TIME.size)

FloatArray = NDArray[np.float64]


def turned(first: float, last: float) -> FloatArray:
    """Return the shaft angle of a linear ramp of rotational frequency, Hz, in rad."""
    return np.asarray(2 * np.pi * (first * TIME + 0.5 * (last - first) * TIME**2) + 0.3, dtype=np.float64)


@pytest.mark.parametrize("mains", [49.8, 50.0, 50.2, 60.0])
@pytest.mark.parametrize("phase", [0.0, 1.0])
def test_mains_line_is_measured_with_its_amplitude(mains: float, phase: float) -> None:
    line = LowFrequencySignal(3.0 + 2.0 * np.sin(2 * np.pi * mains * TIME + phase) + NOISE, RATE).mains_line()
    assert line.frequency == round(mains, -1)
    assert line.amplitude == pytest.approx(2.0, rel=0.03)
    assert line.is_separable


@pytest.mark.parametrize(("first", "last"), [(25.0, 25.0), (40.0, 60.0), (45.0, 45.5), (10.0, 20.0)])
def test_shaft_orders_are_subtracted_and_hum_remains(first: float, last: float) -> None:
    angle = turned(first, last)
    motion = 5.0 * np.cos(angle) + 3.0 * np.sin(3 * angle)
    assert LowFrequencySignal(motion + NOISE, RATE, angle).mains_line().amplitude < 0.1
    hum = 2.0 * np.sin(2 * np.pi * 50.0 * TIME)
    line = LowFrequencySignal(motion + hum + NOISE, RATE, angle).mains_line()
    if line.is_separable:
        assert line.amplitude == pytest.approx(2.0, rel=0.15)
    else:
        assert first == 25.0  # 2X lies on the mains'


@pytest.mark.parametrize("shaft", [50.0, 25.0, 16.667, 60.0])
def test_shaft_on_the_mains_frequency_is_not_separable(shaft: float) -> None:
    angle = turned(shaft, shaft)
    line = LowFrequencySignal(
        2.0 * np.cos(round(60.0 / shaft if shaft == 60.0 else 50.0 / shaft) * angle), RATE, angle
    ).mains_line()
    assert not line.is_separable
    assert line.amplitude == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize("frequency", [45.0, 48.0, 52.0, 55.0, 63.0, 65.0])
def test_line_near_the_mains_frequency_is_no_hum(frequency: float) -> None:
    assert LowFrequencySignal(5.0 * np.sin(2 * np.pi * frequency * TIME) + NOISE, RATE).mains_line().amplitude < 0.1


def test_vectors_are_those_of_the_orders() -> None:
    angle = turned(15.0, 35.0)
    one, two = 3.0 * np.exp(0.5j), 1.0 * np.exp(-2.0j)
    signal = LowFrequencySignal(7.0 + np.real(one * np.exp(1j * angle) + two * np.exp(2j * angle)) + NOISE, RATE, angle)
    assert signal.vectors[:2] == pytest.approx([one, two], abs=0.05)
    assert LowFrequencySignal(NOISE, RATE).vectors.size == 0


def test_motion_excludes_mean_drift_hum_and_noise() -> None:
    hum = 20.0 * np.sin(2 * np.pi * 50.0 * TIME) + 5.0 * np.sin(2 * np.pi * 150.0 * TIME)
    assert LowFrequencySignal(4.0 + 3.0 * TIME + hum + NOISE, RATE).motion_rms() < 0.1
    angle = turned(33.0, 33.0)
    for known in (angle, None):
        moving = LowFrequencySignal(np.sqrt(2) * np.cos(angle) + hum + NOISE, RATE, known)
        assert moving.motion_rms() == pytest.approx(1.0, rel=0.05)


def test_angle_of_another_length_is_refused() -> None:
    with pytest.raises(ValueError, match="expected both"):
        LowFrequencySignal(NOISE, RATE, NOISE[1:])
