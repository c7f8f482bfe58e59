"""Two probes at any angles, and the ellipses of components."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.signals.probes import Ellipse, ProbePair

DIRECTIONS = st.floats(-np.pi, np.pi)


@given(angle=DIRECTIONS, apart=st.floats(0.1, 3.0), X=st.floats(-1, 1), Y=st.floats(-1, 1))
def test_motion_is_recovered_from_any_two_probes(angle: float, apart: float, X: float, Y: float) -> None:
    pair = ProbePair(angle, angle + apart)
    motion = np.array([[X], [Y]])
    np.testing.assert_allclose(pair.to_bench(pair.to_probes(motion)), motion, atol=1e-13)


def test_probe_measures_motion_towards_itself() -> None:
    pair = ProbePair(np.pi / 4, 3 * np.pi / 4)
    np.testing.assert_allclose(pair.to_probes(np.array([1.0, 0.0])), [0.5**0.5, -(0.5**0.5)])


@pytest.mark.parametrize("apart", [0.0, np.pi, -np.pi])
def test_parallel_probes_are_refused(apart: float) -> None:
    with pytest.raises(ValueError, match="parallel"):
        ProbePair(0.7, 0.7 + apart)


@given(
    angle=DIRECTIONS,
    forward=st.complex_numbers(max_magnitude=10, allow_nan=False),
    backward=st.complex_numbers(max_magnitude=10, allow_nan=False),
)
def test_circles_are_separated_for_any_probe_angles(angle: float, forward: complex, backward: complex) -> None:
    phase = 2 * np.pi * np.arange(8) / 8
    z = forward * np.exp(1j * phase) + backward * np.exp(-1j * phase)
    pair = ProbePair(angle, angle + 1.3)
    seen = pair.to_probes(np.stack([z.real, z.imag]))
    vectors = 2 * np.fft.fft(seen)[:, 1] / 8
    ellipse = pair.ellipse(vectors)
    np.testing.assert_allclose([ellipse.forward, ellipse.backward], [forward, backward], atol=1e-12)


def test_no_crosstalk_between_forward_and_backward() -> None:
    ellipse = ProbePair(0.0, np.pi / 2).ellipse(np.array([20e-6, -20e-6j]))
    assert ellipse.forward == pytest.approx(20e-6)
    assert abs(ellipse.backward) < 1e-4 * 20e-6


def test_ellipse_has_axes_and_a_tilt() -> None:
    ellipse = Ellipse(3.0 * np.exp(0.2j), 1.0 * np.exp(0.6j))
    assert (ellipse.major, ellipse.minor) == pytest.approx((4.0, 2.0))
    phase = np.linspace(0, 2 * np.pi, 20_001)
    z = ellipse.forward * np.exp(1j * phase) + ellipse.backward * np.exp(-1j * phase)
    furthest = np.angle(z[np.argmax(np.abs(z))])
    assert np.cos(furthest - ellipse.tilt) ** 2 == pytest.approx(1.0, abs=1e-6)
    assert Ellipse(1.0, 0.0).tilt == 0.0
    assert Ellipse(1.0, 2.0).minor == -1.0
