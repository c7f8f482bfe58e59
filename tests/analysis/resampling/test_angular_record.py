"""Angular records of known motion: accuracy of amplitude, phase and tacho repair."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis.resampling.angular_record import AngularRecord, angular_record, angular_record_from_codes, tacho_edges
from analysis.signals.errors import AmbiguousTachoError, AnalysisError, RecordTooShortError
from analysis.signals.header import Tacho
from analysis.signals.probes import ProbePair
from analysis.signals.units import MICROMETRE
from analysis.spectra.order_map import order_map
from analysis.tacho.pulse_record import pulse_record
from analysis.tacho.shaft_angle import ShaftAngle, shaft_angle
from analysis.vectors.order_track import track_order

if TYPE_CHECKING:
    from tests.analysis.conftest import Bench

Maker = Callable[..., "Bench"]
Recorder = Callable[..., AngularRecord]
TACHO = Tacho(threshold=2.0, hysteresis=1.0, response_time=1e-5)
FAST = {"response_time": 1e-5}


def angle_of(turn_rate: float, duration: float) -> ShaftAngle:
    return shaft_angle(pulse_record(np.arange(0.0, duration, 1 / turn_rate), TACHO))


def test_fast_run_up_of_three_orders_is_accurate_to_the_noise(make_bench: Maker, make_record: Recorder) -> None:
    bench = make_bench()
    motion = bench.circles((20 * MICROMETRE, 1.0, 0.4), (5 * MICROMETRE, -2.0, 0.3), (8 * MICROMETRE, 0.5, 0.0))
    record = make_record(motion, bench.ramp(100.0, 1000.0, 12.0), 12.0, noise=0.2 * MICROMETRE, tacho=FAST)
    assert record.speeds[0] == pytest.approx(2 * np.pi * 100, rel=0.02)
    spectrum = order_map(record).spectrum[0]
    for order, amplitude, bar in ((1.0, 20, 0.05), (2.0, 5, 0.20), (0.5, 8, 0.12)):
        error = np.abs(spectrum[:, round(16 * order)]) / (amplitude * MICROMETRE) - 1
        assert 100 * np.sqrt(np.mean(error**2)) < bar
    phase = np.degrees(np.angle(spectrum[:, 16] * np.exp(-0.4j)))
    assert abs(phase.mean()) < 0.02
    assert phase.std() < 0.1


def test_clean_run_up_has_no_lines_between_the_orders(make_bench: Maker) -> None:
    bench = make_bench(tacho=FAST)
    ramp, motion = bench.ramp(100.0, 1000.0, 6.0), bench.circles((20 * MICROMETRE, 1.0, 0.4))
    edges = tacho_edges(bench.acquisition, bench.codes(ramp, motion, 6.0))
    displacement = np.stack(motion(ramp(np.arange(600_000) / 1e5)))  # without the converter's steps
    record = angular_record(displacement, 1e5, shaft_angle(pulse_record(edges, TACHO)), ProbePair(0.0, np.pi / 2))
    assert order_map(record).amplitudes()[:, :, 3:15].max() < 1e-9  # 0.1875X to 0.875X


def test_phase_at_1000_revolutions_per_second_has_no_scatter_and_no_drift(
    make_bench: Maker, make_record: Recorder
) -> None:
    bench = make_bench()
    record = make_record(
        bench.circles((20 * MICROMETRE, 1.0, 0.4)), bench.steady(1000.0), 6.0, noise=0.2 * MICROMETRE, tacho=FAST
    )
    phase = np.degrees(np.angle(track_order(record, 1.0).vectors[0] * np.exp(-0.4j)))
    assert abs(phase.mean()) < 0.1
    assert phase.std() < 0.1
    third = phase.size // 3
    assert abs(phase[:third].mean() - phase[-third:].mean()) < 0.01


def test_missing_and_double_pulses_do_not_affect_the_vectors(make_bench: Maker) -> None:
    bench = make_bench(noise=0.2 * MICROMETRE, tacho=FAST)
    codes = bench.codes(bench.ramp(100.0, 300.0, 8.0), bench.circles((20 * MICROMETRE, 1.0, 0.4)), 8.0)
    edges = tacho_edges(bench.acquisition, codes)
    random = np.random.default_rng(2)
    remaining = edges[random.random(edges.size) >= 0.02]
    extra = np.flatnonzero(random.random(edges.size - 1) < 0.02)
    doubles = edges[extra] + random.uniform(0.02, 0.98, extra.size) * np.diff(edges)[extra]
    errors = []
    for pulses in (edges, np.sort(np.concatenate([remaining, doubles]))):
        record = angular_record_from_codes(bench.acquisition, codes, pulse_times=pulses)
        amplitudes = np.abs(track_order(record, 1.0).vectors)
        errors.append(float(np.sqrt(np.mean((amplitudes / (20 * MICROMETRE) - 1) ** 2))))
    assert errors[1] < 1.2 * errors[0]


def test_counter_timestamps_give_the_same_result_as_the_waveform(make_bench: Maker) -> None:
    bench = make_bench(tacho=FAST)
    codes = bench.codes(bench.steady(200.0), bench.circles((20 * MICROMETRE, 1.0, 0.4)), 1.0)
    stamped = np.asarray((np.arange(1, 200) - 0.3) / 200.0, dtype=np.float64)  # the bench starts at 0.3 of a turn
    record = angular_record_from_codes(bench.acquisition, codes, pulse_times=stamped)
    vectors = track_order(record, 1.0).vectors[0]
    assert np.abs(np.degrees(np.angle(vectors * np.exp(-0.4j)))).max() < 0.05


@pytest.mark.parametrize(
    ("turn_rate", "frequency"),
    [(20.0, 1_213.0), (20.0, 9_000.0), (20.0, 45_000.0), (150.0, 9_095.0), (150.0, 30_000.0), (700.0, 44_700.0)],
)
def test_motion_above_the_grid_does_not_alias(turn_rate: float, frequency: float) -> None:
    rate, n = 100_000.0, 60_000
    wave = np.cos(2 * np.pi * frequency * np.arange(n) / rate) * np.ones((2, 1))
    record = angular_record(wave, rate, angle_of(turn_rate, n / rate), ProbePair(0.0, np.pi / 2))
    assert order_map(record, revolutions=4).amplitudes().max() < 1.5e-3


@pytest.mark.parametrize("rise", [30e-6, 1e-7])  # of the tacho's edge: its marks scatter by 1 ns and by 3 us
def test_live_frames_and_record_agree_within_their_uncertainty(make_bench: Maker, rise: float) -> None:
    bench = replace(make_bench(tacho=FAST), tacho_rise=rise)
    motion = bench.circles((20 * MICROMETRE, 1.0, 0.4), (8 * MICROMETRE, 0.47, 1.0), (3 * MICROMETRE, 2.0, 0.0))
    codes = bench.codes(bench.ramp(60.0, 400.0, 5.0), motion, 5.0)
    record = angular_record_from_codes(bench.acquisition, codes)
    tracks = [track_order(record, order, overlap=15 / 16) for order in (1.0, 2.0)]  # a frame begins at every mark
    frames = [snapshot.frame for snapshot in bench.snapshots(codes) if snapshot.frame is not None]
    assert len(frames) > 40
    for frame in frames:
        middle = np.hypot(frame.speed, 0.5 * frame.acceleration * 2 * np.pi * 16 / frame.speed)  # as of a track
        at = int(np.argmin(np.abs(tracks[0].speeds - middle)))
        for track, vector in zip(tracks, frame.vectors[:, 0], strict=True):
            assert abs(abs(vector) - abs(track.vectors[0, at])) < 0.5 * track.sigma[0, at]
            assert abs(np.angle(vector / track.vectors[0, at])) < 1.5 * track.phase_sigma[0, at]
        assert abs(middle - tracks[0].speeds[at]) < 4 * tracks[0].speed_sigma[at] + 5e-6 * middle


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(scale=st.floats(0.01, 100.0), other=st.floats(-5.0, 5.0), delay=st.integers(0, 100).map(lambda n: 4 * n))
def test_resampling_is_linear_and_shifts_with_time(scale: float, other: float, delay: int) -> None:
    rate, n = 20_000.0, 4_000
    random = np.random.default_rng(0)
    one, two = random.standard_normal((2, 2, n))
    angle = angle_of(100.0, n / rate)
    pair = ProbePair(0.0, np.pi / 2)
    sum_of = angular_record(scale * one + other * two, rate, angle, pair).waveform
    parts = (
        scale * angular_record(one, rate, angle, pair).waveform
        + other * angular_record(two, rate, angle, pair).waveform
    )
    np.testing.assert_allclose(sum_of, parts, atol=1e-9 * (1.0 + scale))
    late = np.concatenate([random.standard_normal((2, delay)), one], axis=1)
    pulses = np.arange(0.0, n / rate, 0.01) + delay / rate
    shifted = angular_record(late, rate, shaft_angle(pulse_record(pulses, TACHO)), pair)
    direct = angular_record(one, rate, angle, pair)
    common = min(shifted.revolutions, direct.revolutions) - 4
    begin = 2 + direct.first_turn
    a, b = shifted.waveform[:, begin - shifted.first_turn :], direct.waveform[:, begin - direct.first_turn :]
    np.testing.assert_allclose(a[:, :common], b[:, :common], atol=1e-8)  # halved rates keep the same samples


def test_invalid_records_are_refused_with_the_reason(make_bench: Maker) -> None:
    bench = make_bench(tacho=FAST)
    codes = bench.codes(bench.steady(200.0), bench.circles((20 * MICROMETRE, 1.0, 0.4)), 0.3)
    silent = codes.copy()
    silent[2] = 0
    with pytest.raises(AmbiguousTachoError, match="0 tacho pulses"):
        angular_record_from_codes(bench.acquisition, silent)
    noise = codes.copy()
    noise[2] = np.random.default_rng(0).integers(-30_000, 30_000, codes.shape[1])
    with pytest.raises(AmbiguousTachoError):
        angular_record_from_codes(bench.acquisition, noise)
    railed = codes.copy()
    railed[0] = 32767
    with pytest.raises(AnalysisError, match="probe"):
        angular_record_from_codes(bench.acquisition, railed)
    with pytest.raises(ValueError, match="codes"):
        angular_record_from_codes(bench.acquisition, codes[:2])
    with pytest.raises(ValueError, match="finite"):
        angular_record(np.full((2, 9000), np.nan), 1e5, angle_of(200.0, 0.09), ProbePair(0.0, 1.0))
    with pytest.raises(RecordTooShortError):
        angular_record(np.zeros((2, 100)), 1e5, angle_of(200.0, 0.09), ProbePair(0.0, 1.0))


def test_record_reports_repaired_pulses_and_clipped_samples(make_bench: Maker) -> None:
    bench = make_bench()  # its tacho needs 1 ms of light and of dark
    codes = bench.codes(bench.steady(700.0), bench.circles((20 * MICROMETRE, 1.0, 0.4)), 0.3)
    codes[0, 100:107] = 32767
    record = angular_record_from_codes(bench.acquisition, codes)
    assert record.clipped == (7, 0)
    assert record.pulses is not None
    assert record.pulses.too_fast
    assert (record.pulses.filled, record.pulses.rejected) == (0, 0)


@pytest.mark.parametrize(("turn_rate", "order"), [(500.0, 51.5), (500.0, 52.0), (980.0, 50.0), (600.0, 53.0)])
def test_orders_near_the_grid_fold_onto_no_order_up_to_the_highest(
    make_bench: Maker, turn_rate: float, order: float
) -> None:
    bench = make_bench(tacho={"response_time": 1e-6}, highest_order=12.0, noise=0.01 * MICROMETRE)
    motion = bench.circles((20 * MICROMETRE, 1.0, 0.3), (20 * MICROMETRE, order, 0.1))
    record = angular_record_from_codes(bench.acquisition, bench.codes(bench.steady(turn_rate), motion, 0.3))
    assert record.highest_order == pytest.approx(12.8)
    lines = order_map(record, highest_order=12.8).spectrum[:, :, 20:]
    assert np.sqrt(np.mean(np.abs(lines) ** 2, axis=1)).max() < 0.005 * MICROMETRE
    frame = bench.frames(bench.steady(turn_rate), motion, 0.3)[-1]
    assert np.abs(frame.spectrum[:, 20:]).max() < 0.005 * MICROMETRE


@pytest.mark.parametrize("fraction", [0.08, 0.13, 0.3])
def test_clipped_samples_widen_the_uncertainty_of_all_orders(make_bench: Maker, fraction: float) -> None:
    bench = make_bench(tacho=FAST)
    true = 550 * MICROMETRE / np.cos(np.pi * fraction)  # one rail of the converter lies at 550 um
    codes = bench.codes(bench.steady(200.0), bench.circles((true, 1.0, 0.3)), 0.5)
    record = angular_record_from_codes(bench.acquisition, codes)
    assert record.clipped_fraction is not None
    assert record.clipped_fraction[0] == pytest.approx(fraction, abs=0.005)
    half = np.pi * fraction
    first = track_order(record, 1.0)
    error = np.abs(first.vectors) - true
    assert error[0] == pytest.approx(-true * (half - np.sin(half) * np.cos(half)) / np.pi, rel=0.02)
    assert (np.abs(error) < 2.0 * first.sigma).all()
    assert (np.abs(error) > 0.67 * first.sigma).all()  # 1.5 times as wide at most
    second = track_order(record, 2.0)
    assert (np.abs(second.vectors) < 2.0 * second.sigma).all()
    frame = bench.frames(bench.steady(200.0), bench.circles((true, 1.0, 0.3)), 0.5)[-1]
    assert (np.abs(np.abs(frame.vectors[0]) - true) < 2.0 * frame.sigma[0]).all()
    assert (np.abs(frame.vectors[1]) < 2.0 * frame.sigma[1]).all()


def test_section_of_a_record_has_the_same_times(make_angular: Callable[..., AngularRecord]) -> None:
    record = make_angular((1.0, 1.0, 0.0), revolutions=20)
    part = record.section(5, 12)
    assert (part.revolutions, part.first_turn) == (7, 5)
    np.testing.assert_array_equal(part.times, record.times[5:13])
    with pytest.raises(ValueError, match="part"):
        record.section(5, 30)
    with pytest.raises(ValueError, match="waveform"):
        record.with_waveform(np.zeros(3))
    assert replace(record, first_turn=3).section(0, 2).first_turn == 3


def test_orders_one_to_six_at_600_hertz_are_accurate_through_the_whole_chain() -> None:
    """Orders 1, 0.5, 4 and 6 at 600 Hz on a shaft from 10 to 40 Hz in 5 s: order 6 reaches 0.4 of the rate."""
    rate, amplitudes = 600.0, {1.0: 1.0, 0.5: 0.5, 4.0: 2.0**0.5, 6.0: 2.0}
    time = np.arange(int(rate * 5.0)) / rate
    turns = 10.0 * time + 3.0 * time**2
    wave = sum(size * np.cos(2 * np.pi * order * turns) for order, size in amplitudes.items())
    pulses = np.asarray((np.sqrt(100.0 + 12.0 * np.arange(0, 125)) - 10.0) / 6.0)
    angle = shaft_angle(pulse_record(pulses, TACHO))
    record = angular_record(np.stack([np.asarray(wave)] * 2), rate, angle, ProbePair(0.0, np.pi / 2))
    spectrum = order_map(record).spectrum
    for order, size in amplitudes.items():
        assert np.abs(np.abs(spectrum[0, :, round(16 * order)]) / size - 1.0).max() < 0.0025
