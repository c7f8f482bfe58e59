"""Stated uncertainty of amplitude, phase, speed and order."""

import numpy as np
import pytest

from analysis.resampling.angular_record import angular_record
from analysis.signals.header import Tacho
from analysis.signals.probes import ProbePair
from analysis.signals.uncertainty import noise_floor_sigma, phase_sigma
from analysis.signals.units import MICROMETRE
from analysis.spectra.order_map import order_map
from analysis.tacho.pulse_record import pulse_record
from analysis.tacho.shaft_angle import shaft_angle
from analysis.vectors.order_track import track_order
from analysis.whirl.tracks import subsynchronous_tracks

RATE, TURN_RATE, SAMPLES = 20_000.0, 200.0, 4_400
TACHO = Tacho(threshold=2.0, hysteresis=1.0, response_time=1e-5)


def run(seed: int, whirl_order: float) -> list[float]:
    """Return the errors of 1X, 2X, whirl and speed at the begin of a run, over their stated uncertainty."""
    random = np.random.default_rng(seed)
    start, phase = random.uniform(), random.uniform(0.0, 2 * np.pi)
    turns = TURN_RATE * np.arange(SAMPLES) / RATE + start
    z = 20 * MICROMETRE * np.exp(1j * (2 * np.pi * turns + phase))
    z += 4 * MICROMETRE * np.exp(2j * np.pi * whirl_order * turns)
    z += 5 * MICROMETRE * np.exp(-2j * (2 * np.pi * turns + phase))
    displacement = np.stack([z.real, z.imag]) + 0.5 * MICROMETRE * random.standard_normal((2, SAMPLES))
    marks = (np.arange(1, 43) - start) / TURN_RATE + 2e-6 * random.standard_normal(42)
    angle = shaft_angle(pulse_record(marks, TACHO))
    record = angular_record(displacement, RATE, angle, ProbePair(0.0, np.pi / 2))
    frames = order_map(record)
    whirl = subsynchronous_tracks(frames)[0]
    first, second = track_order(record, 1.0), track_order(record, 2.0)
    return [
        (abs(first.vectors[0, 0]) - 20 * MICROMETRE) / first.sigma[0, 0],
        np.angle(first.vectors[0, 0] * np.exp(-1j * phase)) / first.phase_sigma[0, 0],
        (abs(second.vectors[0, 0]) - 5 * MICROMETRE) / second.sigma[0, 0],
        np.angle(second.vectors[0, 0] * np.exp(-2j * phase)) / second.phase_sigma[0, 0],
        (frames.speeds[0] - 2 * np.pi * TURN_RATE) / frames.speed_sigma[0],
        (whirl.orders[0] - whirl_order) / whirl.order_sigma[0],
        (whirl.forward[0] - 4 * MICROMETRE) / whirl.sigma[0],
    ]


@pytest.mark.parametrize("whirl_order", [0.4375, 0.45])
def test_two_standard_deviations_cover_the_truth_in_90_to_99_of_100_runs(whirl_order: float) -> None:
    errors = np.array([run(seed, whirl_order) for seed in range(500)])
    covered = np.mean(np.abs(errors) < 2.0, axis=0)
    print(f"\nwhirl at {whirl_order}X: amplitude and phase of 1X and 2X, speed, whirl's order and amplitude")
    print(f"covered in {100 * covered} %")
    assert (covered >= 0.90).all()
    assert (covered <= 0.99).all()


def test_line_noise_follows_its_formula() -> None:
    random = np.random.default_rng(0)
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(512) / 512)
    lines = 2 * np.fft.rfft(random.standard_normal((400, 512)) * window)[:, 5:250] / window.sum()
    assert np.std(lines.real) == pytest.approx(np.sqrt(2 * 1.5 / 512), rel=0.01)
    assert noise_floor_sigma(np.array([np.median(np.abs(lines))]))[0] == pytest.approx(np.std(lines.real), rel=0.01)


def test_unknown_phase_has_the_uncertainty_of_a_uniform_angle() -> None:
    sigma = phase_sigma(np.array([0.0, 1.0, 1.0]), np.array([1.0, 0.01, 0.0]), np.array([0.0, 0.0, 0.02]), 2.0)
    np.testing.assert_allclose(sigma, [np.pi / np.sqrt(3.0), 0.01, 0.04])
