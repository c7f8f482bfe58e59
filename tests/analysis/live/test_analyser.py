"""The live analysis of known motion, sampled by a multiplexed card."""

from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from analysis.live.analyser import Analyser
from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import Edge, Role, WindowName
from analysis.signals.snapshot import Snapshot, TachoState
from analysis.signals.units import MICROMETRE

if TYPE_CHECKING:
    from tests.analysis.conftest import Bench

Maker = Callable[..., "Bench"]
FloatArray = NDArray[np.float64]
THREE = (
    (20 * MICROMETRE, 1.0, 0.4),
    (8 * MICROMETRE, 0.47, 1.0),
    (3 * MICROMETRE, 2.0, -0.7),
)  # circles: 1X, whirl, 2X


def same(a: object, b: object) -> bool:
    """Return whether two results are bit-identical."""
    if is_dataclass(a):
        return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    return bool(a == b or (a != a and b != b))  # noqa: PLR0124  # NaN is the same as NaN


def assert_same(one: list[Snapshot], other: list[Snapshot]) -> None:
    assert len(one) == len(other)
    assert all(same(a, b) for a, b in zip(one, other, strict=True))


@pytest.mark.parametrize("rate", [100_000.0, 200_000.0])
@pytest.mark.parametrize("turn_rate", [16.7, 100.0, 333.0])
def test_vectors_beside_whirl_are_exact_for_any_multiplexer_skew(
    make_bench: Maker, rate: float, turn_rate: float
) -> None:
    bench = make_bench(rate=rate)
    frames = bench.frames(bench.steady(turn_rate), bench.circles(*THREE), 2.0)
    vectors = np.array([frame.vectors for frame in frames])
    truth = 20 * MICROMETRE * np.exp(0.4j) * np.array([1.0, -1.0j])
    assert len(frames) >= 9
    assert np.abs(np.abs(vectors[:, 0]) / (20 * MICROMETRE) - 1).max() < 0.001
    assert np.abs(np.degrees(np.angle(vectors[:, 0] / truth)).mean(axis=0)).max() < 0.02
    assert np.degrees(np.angle(vectors[:, 0] / truth)).std() < 0.05
    assert (
        np.abs(vectors[:, 1].mean(axis=0) - 3 * MICROMETRE * np.exp(-0.7j) * np.array([1, -1j])).max()
        < 0.003 * MICROMETRE
    )
    assert frames[-1].speed == pytest.approx(2 * np.pi * turn_rate, rel=1e-6)
    assert abs(frames[-1].acceleration) < 0.01 * frames[-1].speed


@pytest.mark.parametrize("backward", [False, True])
def test_whirl_is_found_with_order_amplitude_and_direction(make_bench: Maker, *, backward: bool) -> None:
    bench = make_bench()
    sign = -1.0 if backward else 1.0
    motion = bench.circles((20 * MICROMETRE, 1.0, 0.0), (8 * MICROMETRE, sign * 0.47, 1.0))
    whirls = [frame.whirl for frame in bench.frames(bench.steady(200.0), motion, 1.0)]
    for whirl in whirls:
        assert whirl is not None
        assert whirl.order == pytest.approx(0.47, abs=0.001)
        assert whirl.amplitude == pytest.approx(8 * MICROMETRE, rel=0.005)
        assert whirl.is_forward is not backward


@pytest.mark.parametrize("angles", [(np.pi / 4, 3 * np.pi / 4), (0.2, 1.3), (np.pi / 2, 0.0)])
def test_orbit_and_direction_do_not_depend_on_the_probe_angles(make_bench: Maker, angles: tuple[float, float]) -> None:
    bench = make_bench(angles=angles)
    motion = bench.circles((20 * MICROMETRE, 1.0, 0.4), (5 * MICROMETRE, -1.0, 0.0), (8 * MICROMETRE, 0.47, 0.0))
    frame = bench.frames(bench.steady(150.0), motion, 1.0)[-1]
    assert frame.whirl is not None
    assert frame.whirl.is_forward
    theta = 2 * np.pi * np.arange(4 * 64) / 64
    synchronous = np.stack(bench.circles((20 * MICROMETRE, 1.0, 0.4), (5 * MICROMETRE, -1.0, 0.0))(theta))
    assert frame.orbit.shape == (2, 256)
    seen = np.fft.rfft(frame.orbit)[:, 4] / 128
    truth = np.fft.rfft(synchronous)[:, 4] / 128
    assert np.abs(seen - truth).max() < 1.0 * MICROMETRE  # a few revolutions keep the whirl's leakage
    pure = bench.frames(
        bench.steady(150.0), bench.circles((20 * MICROMETRE, 1.0, 0.4), (5 * MICROMETRE, -1.0, 0.0)), 1.0
    )[-1]
    assert np.abs(pure.orbit - synchronous).max() < 0.5 * MICROMETRE  # noise


def test_channel_sequence_does_not_matter(make_bench: Maker) -> None:
    bench = make_bench()
    x, y, tacho = bench.acquisition.channels
    for channels in [(tacho, y, x), (y, tacho, x)]:
        turned = replace(bench, acquisition=replace(bench.acquisition, channels=channels))
        snapshot = turned.snapshots(turned.codes(bench.steady(300.0), bench.circles(*THREE), 0.5))[-1]
        assert snapshot.frame is not None
        phases = np.degrees(np.angle(snapshot.frame.vectors[0] / np.exp(0.4j) / [1, -1j]))
        assert np.abs(phases).max() < 0.05


def test_tacho_delay_is_subtracted(make_bench: Maker) -> None:
    motion = ((20 * MICROMETRE, 1.0, 0.4),)
    bench = make_bench(tacho={"delay": 4e-4})
    frame = bench.frames(bench.steady(100.0), bench.circles(*motion), 0.5)[-1]
    assert np.degrees(np.angle(frame.vectors[0, 0])) == pytest.approx(np.degrees(0.4), abs=0.05)
    codes = bench.codes(bench.steady(100.0), bench.circles(*motion), 0.5)
    untold = make_bench().snapshots(codes)[-1].frame
    assert untold is not None
    assert np.degrees(np.angle(untold.vectors[0, 0])) == pytest.approx(np.degrees(0.4) + 14.4, abs=0.05)


def test_amplitude_and_phase_are_accurate_in_a_ten_to_one_run_up(make_bench: Maker) -> None:
    bench = make_bench()
    frames = bench.frames(bench.ramp(20.0, 200.0, 8.0), bench.circles(*THREE), 8.0)
    vectors = np.array([frame.vectors[0, 0] for frame in frames]) / (20 * MICROMETRE * np.exp(0.4j))
    assert len(frames) > 65
    assert np.abs(np.abs(vectors) - 1).max() < 0.002
    assert np.abs(np.degrees(np.angle(vectors))).max() < 0.1
    assert np.median([frame.acceleration for frame in frames]) == pytest.approx(2 * np.pi * 22.5, rel=0.02)
    whirls = [frame.whirl for frame in frames]
    assert all(whirl is not None and abs(whirl.order - 0.47) < 0.005 for whirl in whirls)


def test_tacho_jitter_causes_no_line_below_1x(make_bench: Maker) -> None:
    bench = make_bench(noise=0.03e-6)
    random = np.random.default_rng(9)
    steady = bench.steady(200.0)
    codes = bench.codes(steady, bench.circles((20 * MICROMETRE, 1.0, 0.0)), 1.0)
    edges = np.arange(0.7, 200.0) / 200.0
    late = edges + 2e-6 * random.standard_normal(edges.size)
    time = np.arange(codes.shape[1]) / 100_000 + 2 / 400_000
    since = time - late[np.clip(np.searchsorted(late, time) - 1, 0, None)]
    after = late[np.clip(np.searchsorted(late, time), None, late.size - 1)] - time
    light = np.where(since < 0.0025, 0.5 + np.abs(since) / 60e-6, 0.5 - np.abs(after) / 60e-6)
    codes[2] = np.round(4.3 * np.clip(np.where(time < late[0], 0.0, light), 0, 1) / (10 / 32768))
    snapshots = bench.snapshots(codes)
    spectra = [np.abs(s.frame.spectrum[:, 4:13]) for s in snapshots if s.frame is not None]
    assert np.max(spectra) < 0.004 * MICROMETRE
    assert snapshots[-2].tacho.jitter == pytest.approx(2e-6, rel=0.5)


def test_pulse_edge_shorter_than_a_sample_causes_no_line_below_1x(make_bench: Maker) -> None:
    bench = replace(make_bench(noise=0.02e-6), tacho_rise=1e-7)
    frames = bench.frames(bench.steady(203.7), bench.circles((20 * MICROMETRE, 1.0, 0.4)), 1.5)
    lines = np.array([np.abs(frame.spectrum[:, 4:13]) for frame in frames])
    assert lines.max() < 0.002 * MICROMETRE  # edges a hundredth of a sample wide: rms 0.3 degrees each
    phases = np.degrees([np.angle(frame.vectors[0, 0]) for frame in frames])
    assert phases.std() < 0.1


def test_falling_edge_is_the_end_of_the_mark(make_bench: Maker) -> None:
    bench = make_bench(tacho={"edge": Edge.FALLING, "mark_fraction": 0.25})
    frame = bench.frames(bench.steady(100.0), bench.circles((20 * MICROMETRE, 1.0, 0.4)), 0.5)[-1]
    assert np.angle(frame.vectors[0, 0]) == pytest.approx(0.4 + np.pi / 2, abs=0.001)


def test_several_marks_per_revolution_give_the_same_result(make_bench: Maker) -> None:
    bench = make_bench(tacho={"pulses_per_revolution": 4})
    snapshot = bench.snapshots(bench.codes(bench.steady(50.0), bench.circles(*THREE), 0.8))[-1]
    assert snapshot.frame is not None
    assert snapshot.speed == pytest.approx(2 * np.pi * 50, rel=1e-6)
    first = snapshot.frame.vectors[0, 0] / (20 * MICROMETRE * np.exp(0.4j))
    assert abs(first) == pytest.approx(1.0, abs=0.001)
    assert abs(first**4 - 1) < 0.005  # any of the four marks may be the first


def test_speed_fluctuation_does_not_affect_the_phase(make_bench: Maker) -> None:
    bench = make_bench()

    def wandering(time: NDArray[np.float64]) -> NDArray[np.float64]:
        return 2 * np.pi * (100.0 * time + 0.3 * np.sin(2 * np.pi * 0.8 * time) / (2 * np.pi * 0.8))

    frames = bench.frames(wandering, bench.circles(*THREE), 3.0)
    phases = np.degrees([np.angle(frame.vectors[0, 0] / np.exp(0.4j)) for frame in frames])
    assert np.abs(phases).max() < 0.1


@pytest.mark.parametrize("size", [1, 333, 2000, 10_000, 25_001, 100_000])
def test_snapshots_are_bit_identical_for_any_block_size(make_bench: Maker, size: int) -> None:
    bench = make_bench(rate=20_000.0)
    codes = bench.codes(bench.ramp(30.0, 80.0, 2.0), bench.circles(*THREE), 1.93)
    assert_same(bench.snapshots(codes, size), bench.snapshots(codes, 4096))


def test_snapshots_lie_at_multiples_of_the_update_interval_and_at_the_end(make_bench: Maker) -> None:
    bench = make_bench()
    codes = bench.codes(bench.steady(100.0), bench.circles(*THREE), 0.537)
    snapshots = bench.snapshots(codes)
    assert [snapshot.sample for snapshot in snapshots] == [10_000, 20_000, 30_000, 40_000, 50_000, 53_700]
    assert [snapshot.time for snapshot in snapshots] == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5, 0.537])


def test_skipped_block_restarts_the_analysis(make_bench: Maker) -> None:
    bench = make_bench()
    codes = bench.codes(bench.steady(100.0), bench.circles(*THREE), 2.0)
    analyser = Analyser(bench.acquisition, bench.settings)
    before = [s for block in bench.blocks(codes[:, :70_000], 10_000) for s in analyser.add_block(block)]
    after = [s for block in bench.blocks(codes[:, 103_456:], 10_000, first=103_456) for s in analyser.add_block(block)]
    assert before[-1].frame is not None
    assert [snapshot.sample for snapshot in after][:2] == [110_000, 120_000]
    assert after[0].frame is None
    assert after[-1].frame is not None
    assert np.angle(after[-1].frame.vectors[0, 0]) == pytest.approx(0.4, abs=0.002)


def test_new_segment_restarts_the_analysis_but_not_the_counts(make_bench: Maker) -> None:
    bench = make_bench()
    codes = bench.codes(bench.steady(100.0), bench.circles(*THREE), 0.5)
    codes[0, 5] = 32767
    analyser = Analyser(bench.acquisition, bench.settings)
    first = [s for block in bench.blocks(codes, 10_000) for s in analyser.add_block(block)]
    assert analyser.end_segment(SegmentEnd(0, 50_000, EndReason.OVERRUN, lost=7)) == []
    second = [s for block in bench.blocks(codes, 10_000, segment=1) for s in analyser.add_block(block)]
    assert second[-1].segment == 1
    assert first[-1].clipped.tolist() == [1, 0, 0]
    assert second[-1].clipped.tolist() == [2, 0, 0]
    assert first[-1].outside_calibration.tolist() == [1, 0]
    assert second[-1].outside_calibration.tolist() == [2, 0]
    assert second[-1].tacho.pulses == 2 * first[-1].tacho.pulses
    assert same(first[-1].frame, second[-1].frame)
    assert analyser.end_segment(SegmentEnd(7, 0, EndReason.FINISHED)) == []


def test_missing_and_double_pulses_do_not_affect_accuracy(make_bench: Maker) -> None:
    bench = make_bench()
    codes = bench.codes(bench.steady(100.0), bench.circles(*THREE), 3.0)
    clean = [s.frame.vectors[0, 0] for s in bench.snapshots(codes) if s.frame is not None]
    spoiled = codes.copy()
    spoiled[2, 81_600:82_300] = 0  # no pulse at all
    spoiled[2, 151_400:151_500] = 14_000  # one too many
    snapshots = bench.snapshots(spoiled)
    vectors = np.array([s.frame.vectors[0, 0] for s in snapshots if s.frame is not None])
    assert len(vectors) == len(clean)
    assert np.abs(vectors - np.array(clean)).max() < 0.001 * 20 * MICROMETRE
    assert (snapshots[-1].tacho.filled, snapshots[-1].tacho.rejected) == (1, 1)
    assert snapshots[-1].tacho.state is TachoState.GOOD


def test_gap_voltage_and_peak_to_peak_match_the_motion(make_bench: Maker) -> None:
    bench = make_bench()
    codes = bench.codes(bench.steady(100.0), bench.circles((20 * MICROMETRE, 1.0, 0.0)), 0.5)
    codes[1] -= 12_000
    snapshot = bench.snapshots(codes)[-1]
    assert snapshot.gap_volts == pytest.approx([4.5, 4.5 - 12_000 * 10 / 32768], abs=0.001)
    assert snapshot.gap_in_window.tolist() == [True, False]
    assert snapshot.peak_to_peak == pytest.approx([40 * MICROMETRE, 40 * MICROMETRE], rel=0.02)
    assert snapshot.overall[1] == pytest.approx([20 * MICROMETRE / np.sqrt(2.0)] * 2, rel=0.02)


def test_peak_to_peak_covers_a_slow_revolution_without_glitches(make_bench: Maker) -> None:
    bench = make_bench()
    codes = bench.codes(bench.steady(2.0), bench.circles((20 * MICROMETRE, 1.0, 0.0)), 6.0)
    codes[0, 590_005:590_010] += 3000
    snapshot = bench.snapshots(codes)[-1]
    assert snapshot.speed == pytest.approx(2 * np.pi * 2.0, rel=1e-6)
    assert snapshot.peak_to_peak == pytest.approx([40 * MICROMETRE, 40 * MICROMETRE], rel=0.02)


def test_trace_contains_the_last_update_interval_about_its_mean(make_bench: Maker) -> None:
    bench = make_bench()
    codes = bench.codes(bench.steady(100.0), bench.circles((20 * MICROMETRE, 1.0, 0.0)), 0.3)
    trace = bench.snapshots(codes)[-1].trace
    assert trace.time[0] == pytest.approx(0.2)
    assert trace.time.shape == trace.tacho.shape == (1000,)
    assert trace.displacement.shape == (2, 1000)
    assert np.abs(trace.displacement.mean(axis=1)).max() < 1e-12
    assert np.abs(trace.displacement).max() == pytest.approx(20 * MICROMETRE, rel=0.05)
    assert trace.tacho.max() == pytest.approx(4.3, abs=0.01)


@pytest.mark.parametrize(
    ("revolutions", "points", "highest"), [(4, 16, 2.0), (8, 32, 16.0), (64, 64, 8.0), (16, 1024, 64.0)]
)
def test_other_settings_give_the_same_result(make_bench: Maker, revolutions: int, points: int, highest: float) -> None:
    bench = make_bench(revolutions=revolutions, points_per_revolution=points, highest_order=highest)
    motion = bench.circles((20 * MICROMETRE, 1.0, 0.4), (3 * MICROMETRE, 2.0, -0.7))
    frame = bench.frames(bench.steady(100.0), motion, 1.2)[-1]
    assert frame.orders[-1] == highest
    assert frame.spectrum.shape == (2, int(highest * revolutions) + 1)
    assert frame.orbit.shape == (2, min(4, revolutions) * points)
    assert (
        np.abs(frame.vectors[:, 0] - [20 * MICROMETRE * np.exp(0.4j), 3 * MICROMETRE * np.exp(-0.7j)]).max()
        < 0.02 * MICROMETRE
    )


@pytest.mark.parametrize(
    ("window", "offset", "tolerance"),
    [(WindowName.FLAT_TOP, 0.4, 1e-3), (WindowName.FLAT_TOP, 0.5, 1.2e-3), (WindowName.HANN, 0.5, 0.16)],
)
def test_component_between_two_lines_has_the_accuracy_of_the_window(
    make_bench: Maker, window: WindowName, offset: float, tolerance: float
) -> None:
    bench = make_bench(window=window, noise=0.02 * MICROMETRE)
    motion = bench.circles((20 * MICROMETRE, 1.0, 0.4), (8 * MICROMETRE, 3.5 + offset / 16, 0.0))
    frame = bench.frames(bench.steady(100.0), motion, 1.0)[-1]
    read = np.abs(frame.spectrum[:, 48:64]).max(axis=1)
    assert read == pytest.approx([8 * MICROMETRE, 8 * MICROMETRE], rel=tolerance)
    assert bool(read[0] < 0.9 * 8 * MICROMETRE) is (window is WindowName.HANN)


@pytest.mark.parametrize("window", [WindowName.FLAT_TOP, WindowName.UNIFORM])
def test_vectors_and_whirl_do_not_depend_on_the_window(make_bench: Maker, window: WindowName) -> None:
    circles = make_bench().circles
    motion = circles((20 * MICROMETRE, 1.0, 0.4), (3 * MICROMETRE, 2.0, -0.7), (6 * MICROMETRE, 0.4375, 0.1))
    hann, other = (
        bench.frames(bench.steady(100.0), motion, 1.0)[-1] for bench in (make_bench(), make_bench(window=window))
    )
    assert np.abs(other.vectors - hann.vectors).max() < 0.02 * MICROMETRE
    assert [whirl.order for whirl in other.whirls] == [whirl.order for whirl in hann.whirls]
    assert len(hann.whirls) == 1


def test_frame_of_too_few_revolutions_for_the_window_is_refused(make_bench: Maker) -> None:
    bench = make_bench(window=WindowName.FLAT_TOP, revolutions=9)
    with pytest.raises(ValueError, match="9 revolutions with the window flat top, expected at least 10"):
        Analyser(bench.acquisition, bench.settings)


@pytest.mark.parametrize("window", list(WindowName))
def test_stated_sigma_is_the_scatter_of_1x_in_every_window(make_bench: Maker, window: WindowName) -> None:
    bench = make_bench(window=window, noise=0.5 * MICROMETRE, update_interval=0.2)
    frames = bench.frames(bench.steady(100.0), bench.circles((20 * MICROMETRE, 1.0, 0.4)), 20.0)
    scatter = np.std(np.abs([frame.vectors[0] for frame in frames]))
    assert np.median([frame.sigma[0] for frame in frames]) == pytest.approx(scatter, rel=0.25)


def test_motion_far_above_the_highest_order_does_not_alias(make_bench: Maker) -> None:
    bench = make_bench()
    motion = bench.circles(
        (20 * MICROMETRE, 1.0, 0.0),
        (5 * MICROMETRE, 61.3, 0.0),
        (5 * MICROMETRE, 127.4, 0.0),
        (5 * MICROMETRE, 59.0, 0.0),
    )
    frame = bench.frames(bench.steady(100.0), motion, 1.0)[-1]
    lines = np.abs(frame.spectrum)
    lines[:, 15:18] = 0.0
    assert lines.max() < 0.01 * MICROMETRE


def test_shaft_below_60_rpm_has_no_frame(make_bench: Maker) -> None:
    bench = make_bench(rate=2000.0)
    snapshots = bench.snapshots(bench.codes(bench.steady(0.8), bench.circles((20 * MICROMETRE, 1.0, 0.0)), 40.0), 200)
    assert snapshots[-1].speed == pytest.approx(2 * np.pi * 0.8, rel=1e-4)
    assert all(snapshot.frame is None for snapshot in snapshots)


def test_too_fast_state_is_reported_with_a_frame(make_bench: Maker) -> None:
    bench = make_bench(tacho={"mark_fraction": 0.1})
    snapshot = bench.snapshots(bench.codes(bench.steady(150.0), bench.circles(*THREE), 1.0))[-1]
    assert snapshot.tacho.state is TachoState.TOO_FAST
    assert snapshot.frame is not None


def tacho_codes(kind: str, tacho: NDArray[np.int16]) -> NDArray[Any]:
    """Return random codes in place of the tacho's."""
    random = np.random.default_rng(3)
    n = tacho.size
    match kind:
        case "noise as tacho":
            return np.round((2.15 + 0.5 * random.standard_normal(n)) * 3276.8)
        case "slow noise as tacho":
            return np.cumsum(random.standard_normal(n)) * 300 % 20_000
        case "alternating tacho":
            return np.where(np.arange(n) % 2, 32767, -32768)
        case "quick tacho":
            return np.where(np.arange(n) % 40 < 20, 14_000, 0)
        case "speed stops":
            return np.where(np.arange(n) < n // 2, tacho, tacho[n // 2])
    return tacho


def hostile(kind: str, codes: NDArray[np.int16]) -> NDArray[np.int16]:
    """Return random codes in place of the bench's."""
    spoiled = codes.copy()
    match kind:
        case "zeros" | "upper rail" | "lower rail":
            spoiled[:] = {"zeros": 0, "upper rail": 32767, "lower rail": -32768}[kind]
        case "noise":
            spoiled[:] = np.random.default_rng(3).integers(-32768, 32768, codes.shape)
        case "phase jumps":
            half = codes.shape[1] // 2
            spoiled[:, half:] = np.roll(codes, 337, axis=1)[:, half:]
        case "probes stuck":
            spoiled[0], spoiled[1] = 12_345, -3
    spoiled[2] = tacho_codes(kind, spoiled[2])
    return spoiled


KINDS = (
    "zeros",
    "upper rail",
    "lower rail",
    "noise",
    "noise as tacho",
    "slow noise as tacho",
    "alternating tacho",
    "quick tacho",
    "speed stops",
    "phase jumps",
    "probes stuck",
)


@pytest.mark.parametrize("kind", KINDS)
def test_any_codes_of_a_card_are_analysed_without_error(make_bench: Maker, kind: str) -> None:
    bench = make_bench()
    codes = hostile(kind, bench.codes(bench.steady(100.0), bench.circles(*THREE), 2.0))
    with np.errstate(all="raise"):
        snapshots = bench.snapshots(codes, 7777)
    assert len(snapshots) == 20
    rails = np.count_nonzero((codes == 32767) | (codes == -32768), axis=1)
    assert snapshots[-1].clipped.tolist() == rails.tolist()
    assert np.isfinite(snapshots[-1].peak_to_peak).all()
    if kind in {"zeros", "upper rail", "lower rail", "speed stops"}:
        assert snapshots[-1].tacho.state is TachoState.NO_PULSES
    if "noise" in kind or kind == "alternating tacho":
        assert all(snapshot.tacho.state is not TachoState.GOOD for snapshot in snapshots)
        assert all(snapshot.frame is None for snapshot in snapshots)
    if kind in {"phase jumps", "probes stuck"}:
        assert snapshots[-1].frame is not None


@pytest.mark.parametrize("n", [0, 1, 2, 50, 999])
def test_records_shorter_than_a_revolution_are_analysed(make_bench: Maker, n: int) -> None:
    bench = make_bench()
    codes = bench.codes(bench.steady(50.0), bench.circles(*THREE), 0.1)[:, :n]
    snapshots = bench.snapshots(codes, 100)
    assert len(snapshots) == (n > 0)
    assert all(snapshot.frame is None for snapshot in snapshots)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1))
def test_random_codes_and_jumps_never_raise(make_bench: Maker, seed: int) -> None:
    random = np.random.default_rng(seed)
    bench = make_bench(rate=5000.0)
    analyser = Analyser(bench.acquisition, bench.settings)
    segment = first = 0
    with np.errstate(all="raise"):
        for _ in range(12):
            n = int(random.integers(0, 3000))
            kind = random.integers(4)
            codes = random.integers(-32768, 32768, (3, n)).astype(np.int16)
            if kind < 3:
                wave = np.cumsum(random.uniform(0.2, 3.0) * np.ones(n) / random.integers(5, 200))
                codes[2] = np.where(wave % 1.0 < random.uniform(0.1, 0.9), 14_000, random.integers(-5, 6000))
            block = SampleBlock(codes, segment=segment, first_sample=first, host_time_ns=0)
            for snapshot in analyser.add_block(block):
                assert snapshot.sample <= block.end
            first += n
            if kind == 0:
                analyser.end_segment(SegmentEnd(segment, first, EndReason.OVERRUN))
                segment, first = segment + 1, 0
            if kind == 1:
                first += int(random.integers(1, 1000))


def test_wrong_channel_count_and_missing_probes_are_refused(make_bench: Maker) -> None:
    bench = make_bench()
    analyser = Analyser(bench.acquisition, bench.settings)
    with pytest.raises(ValueError, match="2 channels"):
        analyser.add_block(SampleBlock(np.zeros((2, 5), dtype=np.int16), 0, 0, 0))
    with pytest.raises(ValueError, match="probe_y"):
        Analyser(replace(bench.acquisition, channels=bench.acquisition.channels[:1]), bench.settings)
    bare = tuple(replace(c, calibration=None) for c in bench.acquisition.channels)
    assert bare[0].role is Role.PROBE_X
    with pytest.raises(ValueError, match="calibration"):
        Analyser(replace(bench.acquisition, channels=bare), bench.settings)
    with pytest.raises(ValueError, match="revolutions"):
        Analyser(bench.acquisition, replace(bench.settings, revolutions=2))


def test_memory_is_bounded(make_bench: Maker) -> None:
    bench = make_bench(rate=2000.0)
    codes = bench.codes(bench.steady(20.0), bench.circles(*THREE), 10.0)
    analyser = Analyser(bench.acquisition, bench.settings)

    def held(thing: Any, seen: set[int]) -> int:
        if id(thing) in seen:
            return 0
        seen.add(id(thing))
        if isinstance(thing, np.ndarray):
            return thing.nbytes if thing.base is None else max(thing.nbytes, held(thing.base, seen))
        if isinstance(thing, dict):
            return sum(held(value, seen) for value in thing.values())
        if isinstance(thing, list | tuple | set | frozenset) or type(thing).__name__ == "deque":
            return 64 * len(thing) + sum(held(value, seen) for value in thing)
        return held(vars(thing), seen) if hasattr(thing, "__dict__") else 0

    sizes = []
    for part in range(8):
        for block in bench.blocks(codes, 2000, first=part * 20_000):
            analyser.add_block(block)
        sizes.append(held(analyser, set()))
    assert max(sizes[5:]) <= 1.001 * sizes[4]
    assert sizes[4] < 4e6


def test_uncertainty_of_1x_covers_a_neighbour_that_the_frame_does_not_resolve(make_bench: Maker) -> None:
    bench = make_bench(rate=20_000.0, noise=0.5 * MICROMETRE, tacho={"response_time": 1e-5})
    motion = bench.circles((20 * MICROMETRE, 1.0, 0.3), (3 * MICROMETRE, 0.95, 0.1), (4 * MICROMETRE, 0.45, 0.2))
    frames = bench.frames(bench.steady(100.0), motion, 3.0)
    error = np.array([abs(frame.vectors[0, 0]) - 20 * MICROMETRE for frame in frames])
    sigma = np.array([frame.sigma[0] for frame in frames])
    assert np.abs(error).max() > 1.0 * MICROMETRE
    assert np.mean(np.abs(error) < 2.0 * sigma) >= 0.9
    assert np.median(sigma) < 1.5 * error.std()
    alone = bench.frames(bench.steady(100.0), bench.circles((20 * MICROMETRE, 1.0, 0.3)), 1.0)
    assert max(frame.sigma[0] for frame in alone) < 0.05 * MICROMETRE


@pytest.mark.parametrize("acceleration", [3.0, 12.0, 30.0])
def test_uncertainty_of_1x_covers_the_bias_of_the_window_on_a_ramp(make_bench: Maker, acceleration: float) -> None:
    def response(speed: FloatArray) -> NDArray[np.complex128]:
        ratio = speed / 59.0
        return np.asarray(10 * MICROMETRE * ratio**2 / (1 - ratio**2 + 1j * ratio / 8.0))

    def motion(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        z = response(np.gradient(theta) * 20_000.0 / (2 * np.pi)) * np.exp(1j * theta)
        return z.real, z.imag

    bench = make_bench(rate=20_000.0, noise=0.5 * MICROMETRE, tacho={"response_time": 1e-5})
    duration = 50.0 / acceleration
    frames = bench.frames(bench.ramp(35.0, 85.0, duration), motion, duration)
    middle = np.array([np.hypot(frame.speed, 16 * np.pi * frame.acceleration / frame.speed) for frame in frames])
    error = np.array([abs(frame.vectors[0, 0]) for frame in frames]) - np.abs(response(middle / (2 * np.pi)))
    sigma = np.array([frame.sigma[0] for frame in frames])
    assert np.mean(np.abs(error) < 2.0 * sigma) >= 0.9
    assert (np.abs(error) < 2.0 * sigma)[np.argmax(np.abs(error))]
