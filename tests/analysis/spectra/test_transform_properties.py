"""Every transform is linear, scales with its waveform, and shifts with it in angle and time."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from analysis.resampling.angular_record import AngularRecord, angular_record, synchronous_average, synchronous_residual
from analysis.resampling.rate_conversion import HALF_WIDTH, DecimationPyramid, interpolate
from analysis.shaft.orbit import centreline, direct_orbit, filtered_orbit, orbit_without
from analysis.shaft.poincare import bifurcation_diagram, poincare_section
from analysis.signals.header import Tacho
from analysis.signals.probes import ProbePair
from analysis.spectra.disturbances import drift, mains_hum
from analysis.spectra.frequency_spectrum import frequency_map, frequency_spectrum
from analysis.spectra.full_spectrum import full_spectrum
from analysis.spectra.order_map import order_map, order_spectrum
from analysis.spectra.tacholess_speed import speed_from_ridge
from analysis.spectra.windows import FLAT_TOP, UNIFORM
from analysis.tacho.pulse_record import pulse_record
from analysis.tacho.shaft_angle import shaft_angle
from analysis.vectors.glitches import find_glitches
from analysis.vectors.order_track import track_order
from analysis.vectors.runout import slow_roll
from analysis.vectors.speed_curve import speed_curves
from analysis.vectors.vold_kalman import order_envelopes
from analysis.whirl.tracks import subsynchronous_tracks

FloatArray = NDArray[np.float64]
Values = FloatArray | NDArray[np.complex128]

REVOLUTIONS, POINTS, RATE = 48, 64, 2_000.0
PAIR = ProbePair(0.3, 1.7)
ANGLE = shaft_angle(pulse_record(np.arange(0.0, 1.0, 0.02), Tacho(2.0, 1.0, response_time=1e-5)))
TURNING: FloatArray = np.asarray(100 * np.pi * np.arange(2_000) / RATE, dtype=np.float64)
FACTORS = st.floats(-100.0, 100.0)
SIZES = st.floats(1e-6, 1e6)
SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(max_examples=8, deadline=None)


def record_of(waveform: FloatArray) -> AngularRecord:
    times = np.arange(REVOLUTIONS + 1) / 50.0
    return AngularRecord(waveform, 3, times, PAIR, 1e-6, np.zeros(times.size))


def noise(seed: int) -> FloatArray:
    return np.random.default_rng(seed).standard_normal((2, REVOLUTIONS, POINTS))


def turning(seed: int) -> FloatArray:
    """Return a motion with 1X, 2X, whirl and noise."""
    random = np.random.default_rng(seed)
    theta = 2 * np.pi * np.arange(REVOLUTIONS * POINTS) / POINTS
    phases = random.uniform(0.0, 6.0, 3)
    z = 20 * np.exp(1j * (theta + phases[0])) + 5 * np.exp(2j * theta) + 6 * np.exp(1j * (0.45 * theta + phases[1]))
    return np.asarray(np.stack([z.real, z.imag]).reshape(2, REVOLUTIONS, POINTS) + 0.2 * noise(seed))


def pyramid(wave: FloatArray) -> FloatArray:
    levels = DecimationPyramid(2, 3, wave.shape[1], 0)
    levels.push(wave)
    return levels.level(2)[0]


LINEAR_OF_RECORDS: dict[str, Callable[[AngularRecord], Values]] = {
    "order map": lambda record: order_map(record).spectrum,
    "order map, flat top": lambda record: order_map(record, window=FLAT_TOP, overlap=0.5).spectrum,
    "order track": lambda record: track_order(record, 1.37).vectors,
    "forward circles": lambda record: full_spectrum(np.arange(129) / 16, order_map(record).spectrum, PAIR).forward,
    "backward circles": lambda record: full_spectrum(np.arange(129) / 16, order_map(record).spectrum, PAIR).backward,
    "average": lambda record: synchronous_average(record).waveform,
    "rest": lambda record: synchronous_residual(record).waveform,
    "direct orbit": lambda record: direct_orbit(record).motion,
    "2X orbit": lambda record: filtered_orbit(record, (2.0,)).motion,
    "not-1X orbit": lambda record: orbit_without(record).motion,
    "centreline": lambda record: centreline(record, np.zeros(2), 1.0, rest_position=(0.0, 0.0)).positions,
    "slow roll": lambda record: slow_roll(record, 0.0, 1e4).waveform,
    "bifurcation": lambda record: bifurcation_diagram(record, averaging_revolutions=8)[1],
    "points at the mark": lambda record: poincare_section(record).points,
}
LINEAR_OF_SAMPLES: dict[str, Callable[[FloatArray], Values]] = {
    "angular record": lambda wave: angular_record(wave, RATE, ANGLE, PAIR).waveform,
    "half-band levels": pyramid,
    "interpolation": lambda wave: interpolate(wave, HALF_WIDTH + np.linspace(0.0, 900.0, 500) * np.ones((2, 1))),
    "order spectrum": lambda wave: order_spectrum(wave, 16)[1],
    "Vold-Kalman": lambda wave: order_envelopes(wave[0], TURNING, RATE, (1.0, 2.0), bandwidth=20.0).envelopes,
    "drift": lambda wave: np.array([drift(row, RATE).slope for row in wave]),
    "directions": PAIR.to_bench,
}
SCALING: dict[str, Callable[[AngularRecord], Values]] = {
    "floor": lambda record: order_map(record).noise,
    "sigma of a track": lambda record: track_order(record, 1.0).sigma,
    "sigma of the average": lambda record: synchronous_average(record).sigma,
    "sigma of the slow roll": lambda record: slow_roll(record, 0.0, 1e4).vector_sigma,
    "sigma of the centreline": lambda record: centreline(record, np.zeros(2), 1.0).sigma,
    "ellipse": lambda record: np.array([filtered_orbit(record, (1.0,)).ellipses[0].minor]),
    "whirl": lambda record: subsynchronous_tracks(order_map(record))[0].amplitudes,
    "curve": lambda record: speed_curves(track_order(record, 1.0), 20.0)[0].amplitudes,
    "curve's sigma": lambda record: speed_curves(track_order(record, 1.0), 20.0)[0].sigma,
    "scatter at the mark": lambda record: np.array([poincare_section(record).scatter]),
    "frequency spectrum": lambda record: (
        frequency_spectrum(record.waveform.reshape(2, -1), RATE, resolution=4.0).amplitudes
    ),
    "frequency map": lambda record: frequency_map(record.waveform.reshape(2, -1), RATE, resolution=4.0).amplitudes,
    "hum": lambda record: np.array([mains_hum(record.waveform[0].ravel(), RATE).amplitude]),
    "bridged samples": lambda record: find_glitches(record.waveform.reshape(2, -1)[:, :1900], RATE, ANGLE).displacement,
}
UNCHANGED: dict[str, Callable[[AngularRecord], Values]] = {
    "phase's sigma": lambda record: track_order(record, 1.0).phase_sigma,
    "whirl's order": lambda record: subsynchronous_tracks(order_map(record))[0].orders,
    "ridge": lambda record: speed_from_ridge(record.waveform.reshape(2, -1), 3_200.0, 250.0, 450.0).speeds,
    "confidence": lambda record: speed_from_ridge(record.waveform.reshape(2, -1), 3_200.0, 250.0, 450.0).confidence,
    "eccentricity": lambda record: (
        centreline(
            record, np.zeros(2), float(np.abs(record.waveform).max()), rest_position=(0.0, 0.0)
        ).eccentricity_ratio
    ),
}


def assert_close(one: Values, other: Values) -> None:
    np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * max(float(np.abs(other).max()), 1e-300))


@pytest.mark.parametrize("transform", LINEAR_OF_RECORDS)
@FEW
@given(a=FACTORS, b=FACTORS, seed=SEEDS)
def test_transforms_of_records_are_linear(transform: str, a: float, b: float, seed: int) -> None:
    of, one, two = LINEAR_OF_RECORDS[transform], noise(seed), noise(seed + 1)
    parts = a * of(record_of(one)), b * of(record_of(two))
    size = 1e-9 * (np.abs(parts[0]).max() + np.abs(parts[1]).max() + 1e-3)
    np.testing.assert_allclose(of(record_of(a * one + b * two)), parts[0] + parts[1], atol=size)


@pytest.mark.parametrize("transform", LINEAR_OF_SAMPLES)
@FEW
@given(a=FACTORS, b=FACTORS, seed=SEEDS)
def test_transforms_of_samples_are_linear(transform: str, a: float, b: float, seed: int) -> None:
    of, (one, two) = LINEAR_OF_SAMPLES[transform], np.random.default_rng(seed).standard_normal((2, 2, 2_000))
    parts = a * of(one), b * of(two)
    size = 1e-9 * (np.abs(parts[0]).max() + np.abs(parts[1]).max() + 1e-3)
    np.testing.assert_allclose(of(a * one + b * two), parts[0] + parts[1], atol=size)


@pytest.mark.parametrize("result", SCALING)
@FEW
@given(size=SIZES, seed=SEEDS)
def test_amplitudes_and_their_uncertainties_scale_with_the_motion(result: str, size: float, seed: int) -> None:
    of, motion = SCALING[result], turning(seed)
    assert_close(of(record_of(size * motion)), size * of(record_of(motion)))


@pytest.mark.parametrize("result", UNCHANGED)
@FEW
@given(size=SIZES, seed=SEEDS)
def test_orders_phases_and_speeds_do_not_depend_on_the_amplitude(result: str, size: float, seed: int) -> None:
    of, motion = UNCHANGED[result], turning(seed)
    assert_close(of(record_of(size * motion)), of(record_of(motion)))


@FEW
@given(points=st.integers(-POINTS, POINTS), order=st.integers(1, 6), seed=SEEDS)
def test_moving_the_mark_rotates_each_order_by_its_multiple(points: int, order: int, seed: int) -> None:
    motion = turning(seed)
    later = np.roll(motion.reshape(2, -1), points, axis=1).reshape(motion.shape)
    inner = slice(1, -1)  # the ends hold what went round
    one = track_order(record_of(motion), float(order), overlap=15 / 16).vectors[:, inner]
    whole = track_order(record_of(np.roll(motion, 1, axis=1)), float(order), overlap=15 / 16).vectors[:, inner]
    np.testing.assert_allclose(whole[:, 1:], one[:, :-1], atol=1e-9)  # a whole turn moves the frames on
    periodic = synchronous_average(record_of(later)).waveform
    lines, before = np.fft.rfft(periodic)[:, order], np.fft.rfft(synchronous_average(record_of(motion)).waveform)
    turned = before[:, order] * np.exp(-2j * np.pi * order * points / POINTS)
    np.testing.assert_allclose(lines, turned, atol=1e-9 * POINTS * 20)


@FEW
@given(begin=st.integers(1, 20), seed=SEEDS)
def test_section_of_a_record_gives_the_same_frames(begin: int, seed: int) -> None:
    record = record_of(turning(seed))
    part = record.section(begin, REVOLUTIONS)
    whole, later = order_map(record, overlap=15 / 16), order_map(part, overlap=15 / 16)
    np.testing.assert_array_equal(whole.spectrum[:, begin:], later.spectrum)
    np.testing.assert_array_equal(whole.turns[begin:], later.turns)
    np.testing.assert_array_equal(whole.times[begin:], later.times)
    tracks = track_order(record, 0.45, overlap=15 / 16), track_order(part, 0.45, overlap=15 / 16)
    np.testing.assert_allclose(tracks[0].vectors[:, begin:], tracks[1].vectors, atol=1e-9)


@FEW
@given(delay=st.integers(1, 300), seed=SEEDS)
def test_envelopes_and_spectra_shift_with_time(delay: int, seed: int) -> None:
    wave = np.random.default_rng(seed).standard_normal(3_000)
    angle = np.asarray(100 * np.pi * np.arange(3_000) / RATE)
    late = slice(delay, None)
    whole = order_envelopes(wave, angle, RATE, (1.0, 2.0), bandwidth=40.0).envelopes[:, late]
    part = order_envelopes(wave[late], angle[late], RATE, (1.0, 2.0), bandwidth=40.0).envelopes
    middle = slice(900, -900)  # the ends see what is cut off
    np.testing.assert_allclose(part[:, middle], whole[:, middle], atol=1e-6)
    periodic = np.tile(wave[:500], 12)
    moved = np.roll(periodic, delay)
    assert_close(
        frequency_spectrum(moved, RATE, resolution=4.0, window=UNIFORM).amplitudes,
        frequency_spectrum(periodic, RATE, resolution=4.0, window=UNIFORM).amplitudes,
    )
