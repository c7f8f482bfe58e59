"""Amplitude and phase against speed: curves of a record, bins of a run."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.resampling.angular_record import AngularRecord
from analysis.signals.blocks import RampDirection
from analysis.signals.header import RunOutSettings
from analysis.signals.units import MICROMETRE
from analysis.spectra.windows import HANN
from analysis.vectors.order_track import OrderTrack, track_order
from analysis.vectors.speed_curve import BIN_WIDTH, SpeedTable, speed_curves

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
AngularMaker = Callable[..., AngularRecord]
CRITICAL = 2 * np.pi * 200.0
WIDTH = 2 * np.pi * 2.0


def track_of(speeds: FloatArray, damping: float = 0.05, noise: float = 0.0, step: int = 16) -> OrderTrack:
    """Return 1X of a rotor with one resonance: the unbalance response at each speed."""
    ratio = speeds / CRITICAL
    response = 2 * MICROMETRE * ratio**2 / (1 - ratio**2 + 2j * damping * ratio)
    random = np.random.default_rng(0)
    shaken = noise * (random.standard_normal((2, speeds.size)) + 1j * random.standard_normal((2, speeds.size)))
    vectors = response * np.array([[1.0], [-1.0j]]) + shaken
    sigma = np.full((2, speeds.size), max(noise, 1e-12))
    times = 0.1 * np.arange(speeds.size, dtype=np.float64)
    phase_sigma, zeros = sigma / np.abs(vectors), np.zeros(speeds.size)
    none = np.full(speeds.size, np.nan)
    return OrderTrack(1.0, vectors, sigma, phase_sigma, speeds, zeros, times, 16, step, none, 0.0 * sigma)


def test_resonance_is_found_with_amplification_factor_and_phase() -> None:
    (curve,) = speed_curves(track_of(2 * np.pi * np.linspace(100, 300, 800)), WIDTH)
    (resonance,) = curve.resonances(0)
    assert curve.direction is RampDirection.RUN_UP
    assert resonance.speed == pytest.approx(CRITICAL, rel=0.01)
    assert resonance.amplitude == pytest.approx(20 * MICROMETRE, rel=0.01)
    assert resonance.amplification_factor == pytest.approx(10.0, rel=0.03)
    assert np.degrees(resonance.phase_change) == pytest.approx(90.0, abs=3.0)
    assert np.degrees(curve.lags[0, -1] - curve.lags[0, 0]) == pytest.approx(170.0, abs=10.0)


def passage(make_angular: AngularMaker, acceleration: float, quality: float = 8.0, noise: float = 0.1) -> AngularRecord:
    """Return a run-up at a rate, Hz/s, through a resonance at 59 Hz whose 1X is prescribed at every speed, µm."""
    low, high = 30.0, 95.0
    revolutions = int((high**2 - low**2) / (2 * acceleration))
    speed = np.sqrt(low**2 + 2 * acceleration * np.arange(revolutions * 64) / 64)
    z = response(speed, quality) * np.exp(2j * np.pi * np.arange(revolutions * 64) / 64)
    motion = np.stack([z.real, z.imag]).reshape(2, revolutions, 64)
    motion += noise * np.random.default_rng(0).standard_normal(motion.shape)
    times = (np.sqrt(low**2 + 2 * acceleration * np.arange(revolutions + 1)) - low) / acceleration
    return AngularRecord(motion, 0, times, make_angular().pair, 0.0, np.zeros(revolutions + 1))


def response(speed: FloatArray, quality: float = 8.0) -> ComplexArray:
    ratio = speed / 59.0
    return np.asarray(10.0 * ratio**2 / (1 - ratio**2 + 1j * ratio / quality))


@pytest.mark.parametrize("acceleration", [3.0, 12.0, 30.0])
def test_peak_on_a_ramp_has_no_bias_beyond_its_uncertainty(make_angular: AngularMaker, acceleration: float) -> None:
    fine = np.linspace(40.0, 90.0, 500_001)
    size = np.abs(response(fine))
    above = fine[size > size.max() / np.sqrt(2)]
    true_factor = fine[size.argmax()] / (above[-1] - above[0])
    track = track_order(passage(make_angular, acceleration), 1.0)
    error = np.abs(track.vectors[0]) - np.abs(response(track.speeds / (2 * np.pi)))
    assert np.mean(np.abs(error) < 2 * track.sigma[0]) >= 0.9
    assert abs(error[np.argmax(np.abs(track.vectors[0]))]) < 0.012 * size.max()  # the window alone: 2.4 and 11.7 %
    (curve,) = speed_curves(track, 20.0)
    (peak,) = curve.resonances(0)
    assert peak.amplitude == pytest.approx(size.max(), rel=0.01)
    assert abs(peak.amplitude - size.max()) < 2.5 * peak.amplitude_sigma
    assert abs(peak.speed / (2 * np.pi) - fine[size.argmax()]) < 2.5 * peak.speed_sigma / (2 * np.pi)
    assert peak.amplification_factor == pytest.approx(true_factor, rel=0.02)
    assert abs(peak.amplification_factor - true_factor) < 2.5 * peak.amplification_factor_sigma
    assert peak.amplification_factor_sigma < 0.02 * true_factor
    close = np.abs(curve.amplitudes[0] - np.abs(response(curve.speeds / (2 * np.pi)))) < 2.0 * curve.sigma[0]
    assert close.mean() >= 0.9


def test_peak_narrower_than_the_bins_is_not_resolved(make_angular: AngularMaker) -> None:
    (curve,) = speed_curves(track_order(passage(make_angular, 12.0, quality=40.0), 1.0), 20.0)
    (peak,) = curve.resonances(0)
    assert np.isnan(peak.amplification_factor)
    assert np.isnan(peak.speed_sigma)


@pytest.mark.parametrize(("distance", "size"), [(0.05, 3.0), (-0.05, 3.0), (0.02, 3.0), (0.08, 0.3), (0.11, 3.0)])
def test_unresolved_neighbour_is_subtracted_and_reported(
    make_angular: AngularMaker, distance: float, size: float
) -> None:
    circles = ((20.0, 1.0, 0.4), (size, 1.0 - distance, 2.0), (4.0, 0.45, 0.2))
    track = track_order(make_angular(*circles, noise=0.5, revolutions=200), 1.0)
    assert track.neighbour == pytest.approx(1.0 - distance, abs=5e-4)
    assert track.revolutions_needed == pytest.approx(2.0 / abs(distance), abs=1.5)
    assert np.median(track.leakage) == pytest.approx(size * HANN.response(np.array(16.0 * distance)), rel=0.05)
    error = np.abs(track.vectors) - 20.0
    assert np.mean(np.abs(error) < 2.0 * track.sigma) >= 0.9
    assert np.median(track.sigma) < 1.5 * np.std(error) + 0.01


def test_order_without_a_neighbour_reports_none(make_angular: AngularMaker) -> None:
    track = track_order(make_angular((20.0, 1.0, 0.4), (4.0, 0.45, 0.2), noise=0.5, revolutions=400), 1.0)
    assert np.isnan(track.neighbour).all()
    assert track.revolutions_needed == 16
    assert not track.leakage.any()


def test_run_up_and_run_down_give_separate_curves() -> None:
    up = 2 * np.pi * np.linspace(100, 300, 400)
    ripple = 2.0 * np.sin(np.arange(800))
    track = track_of(np.concatenate([up, up[::-1]]) + ripple)
    doubled = replace(track, vectors=track.vectors * np.where(np.arange(800) < 400, 1.0, 2.0))
    first, second = speed_curves(doubled, WIDTH)
    assert (first.direction, second.direction) == (RampDirection.RUN_UP, RampDirection.RUN_DOWN)
    assert first.amplitudes.max() == pytest.approx(20 * MICROMETRE, rel=0.02)
    assert second.amplitudes.max() == pytest.approx(40 * MICROMETRE, rel=0.02)
    assert first.speeds.size == pytest.approx(100, abs=3)
    assert first.frames.sum() + second.frames.sum() == 800


def test_constant_speed_gives_one_curve() -> None:
    speeds = CRITICAL + np.random.default_rng(0).standard_normal(200)
    assert len(speed_curves(track_of(speeds), WIDTH)) == 1


def test_uncertainty_of_a_mean_falls_with_independent_frames_only() -> None:
    steady = np.full(400, CRITICAL)
    (curve,) = speed_curves(track_of(steady, noise=0.1 * MICROMETRE), WIDTH)
    assert curve.sigma[0, 0] == pytest.approx(0.1 * MICROMETRE / 20, rel=0.1)
    (shared,) = speed_curves(track_of(steady, noise=0.1 * MICROMETRE, step=4), WIDTH)
    assert shared.sigma[0, 0] == pytest.approx(np.sqrt(8 / 3) * curve.sigma[0, 0], rel=0.01)
    assert curve.phase_sigma[0, 0] == pytest.approx(curve.sigma[0, 0] / (20 * MICROMETRE), rel=0.2)


def test_curve_that_ends_on_a_slope_has_no_resonance() -> None:
    (curve,) = speed_curves(track_of(2 * np.pi * np.linspace(100, 190, 300)), WIDTH)
    assert curve.resonances(0) == ()
    (half,) = speed_curves(track_of(2 * np.pi * np.linspace(100, 203, 300)), WIDTH)
    assert [np.isnan(resonance.amplification_factor) for resonance in half.resonances(0)] in ([True], [])


def test_zero_width_is_refused() -> None:
    with pytest.raises(ValueError, match="width"):
        speed_curves(track_of(np.full(5, CRITICAL)), 0.0)


if TYPE_CHECKING:
    from tests.analysis.conftest import Bench


def test_rows_contain_the_complex_mean_by_speed(make_bench: Callable[..., "Bench"]) -> None:
    bench = make_bench()
    motion = bench.circles((20 * MICROMETRE, 1.0, 0.4), (3 * MICROMETRE, 2.0, -0.7), (6 * MICROMETRE, 0.4, 0.0))
    table = SpeedTable()
    for snapshot in bench.snapshots(bench.codes(bench.ramp(40.0, 80.0, 4.0), motion, 4.0)):
        table.add_snapshot(snapshot)
    rows = table.rows()
    assert 8 <= len(rows) <= 13
    assert np.all(np.diff([row.speed for row in rows]) > 0)
    for row in rows:
        assert abs(row.vectors[0, 0] - 20 * MICROMETRE * np.exp(0.4j)) < 0.03 * MICROMETRE
        assert abs(row.vectors[1, 1] + 3j * MICROMETRE * np.exp(-0.7j)) < 0.03 * MICROMETRE
        assert row.scatter.max() < 0.05 * MICROMETRE
        assert row.whirl_order == pytest.approx(0.4, abs=0.003)
        assert row.whirl_amplitude == pytest.approx(6 * MICROMETRE, rel=0.01)
        assert np.all(row.mean_overall <= row.largest_overall)
        assert 40 * MICROMETRE < row.mean_overall[0, 0] < 60 * MICROMETRE
        assert 0 < row.noise < 0.02 * MICROMETRE


def test_scatter_is_the_standard_deviation_of_the_vectors(make_bench: Callable[..., "Bench"]) -> None:
    bench = make_bench()
    codes = bench.codes(bench.steady(100.0), bench.circles((20 * MICROMETRE, 1.0, 0.0)), 0.4)
    snapshot = bench.snapshots(codes)[-1]
    assert snapshot.frame is not None
    table = SpeedTable()
    for factor in (0.9, 1.1):
        table.add_snapshot(replace(snapshot, frame=replace(snapshot.frame, vectors=factor * snapshot.frame.vectors)))
    (row,) = table.rows()
    np.testing.assert_allclose(row.vectors, snapshot.frame.vectors)
    np.testing.assert_allclose(row.scatter, 0.1 * np.abs(snapshot.frame.vectors), rtol=1e-6)
    assert np.isnan(row.whirl_order)
    assert row.frames == 2


def test_snapshots_without_speed_or_frame_add_no_row(make_bench: Callable[..., "Bench"]) -> None:
    bench = make_bench()
    codes = bench.codes(bench.steady(100.0), bench.circles((20 * MICROMETRE, 1.0, 0.0)), 0.4)
    table = SpeedTable(BIN_WIDTH)
    for snapshot in bench.snapshots(codes):
        table.add_snapshot(replace(snapshot, frame=None))
        table.add_snapshot(replace(snapshot, frame=None, speed=np.nan))
    assert table.rows() == ()
    with pytest.raises(ValueError, match="width"):
        SpeedTable(0.0)


def test_run_up_and_run_down_are_separated_exactly(make_bench: Callable[..., "Bench"]) -> None:
    bench = make_bench(rate=20_000.0)
    motion = bench.circles((20 * MICROMETRE, 1.0, 0.4))
    snapshots = [*bench.snapshots(bench.codes(bench.ramp(60.0, 120.0, 3.0), motion, 3.0))]
    snapshots += bench.snapshots(bench.codes(bench.ramp(120.0, 60.0, 3.0), motion, 3.0))
    frames = [snapshot.frame for snapshot in snapshots if snapshot.frame is not None]
    turn = max(range(len(frames)), key=lambda k: frames[k].speed)
    table = SpeedTable()
    for snapshot in snapshots:
        table.add_snapshot(snapshot)
    rows = {direction: [row for row in table.rows() if row.direction is direction] for direction in RampDirection}
    assert all(len(of_direction) > 12 for of_direction in rows.values())
    assert sum(row.frames for row in rows[RampDirection.RUN_UP]) == pytest.approx(turn + 1, abs=2)
    assert sum(row.frames for row in table.rows()) == len(frames)
    speeds = [(round(row.speed / BIN_WIDTH), row.direction is RampDirection.RUN_DOWN) for row in table.rows()]
    assert speeds == sorted(speeds)


def test_reading_rows_during_a_run_does_not_change_the_result(make_bench: Callable[..., "Bench"]) -> None:
    bench = make_bench(rate=20_000.0)
    motion = bench.circles((20 * MICROMETRE, 1.0, 0.4))
    snapshots = bench.snapshots(bench.codes(bench.ramp(120.0, 60.0, 3.0), motion, 3.0))
    read, unread = SpeedTable(), SpeedTable()
    for snapshot in snapshots:
        read.add_snapshot(snapshot)
        unread.add_snapshot(snapshot)
        read.rows()
    assert {row.direction for row in unread.rows()} == {RampDirection.RUN_DOWN}
    for one, other in zip(read.rows(), unread.rows(), strict=True):
        assert one.vectors.tobytes() == other.vectors.tobytes()
        assert (one.direction, one.frames) == (other.direction, other.frames)


def test_rows_contain_the_mean_of_the_compensated_vectors(make_bench: Callable[..., "Bench"]) -> None:
    runout = RunOutSettings(vectors=((1, 2 * MICROMETRE + 0j, 1j * MICROMETRE),))
    bench = make_bench(rate=20_000.0, runout=runout)
    table = SpeedTable()
    for snapshot in bench.snapshots(bench.codes(bench.steady(100.0), bench.circles((20 * MICROMETRE, 1.0, 0.0)), 1.0)):
        table.add_snapshot(snapshot)
    (row,) = table.rows()
    np.testing.assert_allclose(row.vectors[0] - row.compensated[0], [2 * MICROMETRE, 1j * MICROMETRE], rtol=1e-9)
    assert np.isnan(row.compensated[1]).all()
    np.testing.assert_array_equal(row.motion[0], row.compensated[0])
    np.testing.assert_array_equal(row.motion[1], row.vectors[1])
