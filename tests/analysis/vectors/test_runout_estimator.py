"""Run-out compensation during a run, and the uncertainty of the vectors of live frames."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.header import RunOutSettings
from analysis.signals.snapshot import OrderFrame
from analysis.signals.units import MICROMETRE
from tests.analysis.conftest import Bench

FloatArray = NDArray[np.float64]
Maker = Callable[..., Bench]
SLOW, FAST = 10.0, 100.0  # revolutions a second
HELD, RISE = 4.0, 2.0  # s at the one, and from it to the other
ONE, TWO = np.array([2.0 * np.exp(0.3j), 1.0j]), np.array([0.5 + 0j, 0.2j])  # run-out at x and y, um
BELOW = 2 * np.pi * 12.0


def angle(time: FloatArray) -> FloatArray:
    rising = np.clip(time - HELD, 0.0, RISE)
    fast = np.maximum(time - HELD - RISE, 0.0)
    return (
        2
        * np.pi
        * (SLOW * np.minimum(time, HELD) + SLOW * rising + 0.5 * (FAST - SLOW) / RISE * rising**2 + FAST * fast)
    )


def motion(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return run-out at every speed, and a 1X of 10 um above the slow-roll speed."""
    surface = np.real(ONE[:, None] * np.exp(1j * theta) + TWO[:, None] * np.exp(2j * theta))
    grown = 10.0 * np.clip((theta / (2 * np.pi) - SLOW * HELD) / 20.0, 0.0, 1.0)
    return (surface[0] + grown * np.cos(theta)) * MICROMETRE, (surface[1] + grown * np.sin(theta)) * MICROMETRE


def frames_with(make_bench: Maker, runout: RunOutSettings, duration: float = 7.0) -> list[OrderFrame]:
    return make_bench(rate=20_000.0, runout=runout).frames(angle, motion, duration)


def test_run_out_from_the_slow_roll_is_subtracted_afterwards(make_bench: Maker) -> None:
    frames = frames_with(make_bench, RunOutSettings(slow_roll_speed=BELOW))
    slow = [frame for frame in frames if frame.speed <= BELOW]
    assert len(slow) > 5
    assert all(frame.runout is None and frame.compensated is None for frame in slow)
    last = frames[-1]
    assert last.runout is not None
    np.testing.assert_allclose(last.runout.vectors[:2], np.stack([ONE, TWO]) * MICROMETRE, atol=0.02 * MICROMETRE)
    assert last.compensated is not None
    np.testing.assert_allclose(last.compensated[0], np.array([10.0, -10.0j]) * MICROMETRE, atol=0.05 * MICROMETRE)
    np.testing.assert_allclose(last.compensated[1], 0.0, atol=0.05 * MICROMETRE)
    np.testing.assert_allclose(
        last.vectors[0] - last.compensated[0], ONE * MICROMETRE, atol=0.02 * MICROMETRE
    )  # both are there
    np.testing.assert_array_equal(last.motion, last.compensated)
    assert last.compensated_orbit is None
    assert (last.compensated_sigma > last.sigma).all()


def test_run_out_estimate_is_final_after_the_slow_roll(make_bench: Maker) -> None:
    frames = frames_with(make_bench, RunOutSettings(slow_roll_speed=BELOW))
    known = [frame.runout for frame in frames if frame.runout is not None]
    assert len(known) > 10
    assert all(runout is known[0] for runout in known)
    first = next(frame for frame in frames if frame.runout is not None)
    assert first.speed > BELOW


def test_known_run_out_is_subtracted_from_the_orbit_if_requested(make_bench: Maker) -> None:
    vectors = tuple((order, *(vector * MICROMETRE).tolist()) for order, vector in ((1, ONE), (2, TWO)))
    frame = frames_with(make_bench, RunOutSettings(vectors=vectors, from_orbit=True))[-1]
    assert frame.compensated_orbit is not None
    radius = np.hypot(*frame.compensated_orbit) / MICROMETRE
    assert radius.min() == pytest.approx(10.0, abs=0.5)
    assert radius.max() == pytest.approx(10.0, abs=0.5)
    assert np.ptp(np.hypot(*frame.orbit)) > 1.0 * MICROMETRE


def test_order_of_unknown_run_out_stays_as_measured(make_bench: Maker) -> None:
    frame = frames_with(make_bench, RunOutSettings(vectors=((1, *(ONE * MICROMETRE).tolist()),)))[-1]
    assert frame.compensated is not None
    assert np.isnan(frame.compensated[1]).all()
    np.testing.assert_array_equal(frame.motion[1], frame.vectors[1])


def test_without_a_slow_roll_nothing_is_subtracted(make_bench: Maker) -> None:
    frames = frames_with(make_bench, RunOutSettings(slow_roll_speed=0.5 * BELOW))
    assert all(frame.runout is None for frame in frames)
    assert all(frame.runout is None for frame in frames_with(make_bench, RunOutSettings(), 5.0))


def test_run_out_estimate_does_not_depend_on_the_block_size(make_bench: Maker) -> None:
    bench = make_bench(rate=20_000.0, runout=RunOutSettings(slow_roll_speed=BELOW))
    codes = bench.codes(angle, motion, 6.5)
    found = [bench.snapshots(codes, size)[-1].frame for size in (1000, 7777)]
    assert found[0] is not None
    assert found[1] is not None
    assert found[0].runout is not None
    assert found[1].runout is not None
    assert found[0].runout.vectors.tobytes() == found[1].runout.vectors.tobytes()


def test_scatter_of_live_frames_matches_their_stated_uncertainty(make_bench: Maker) -> None:
    bench = replace(make_bench(rate=50_000.0), noise=2.0 * MICROMETRE)
    frames = bench.frames(
        bench.steady(200.0), bench.circles((20 * MICROMETRE, 1.0, 0.4), (5 * MICROMETRE, 2.0, 0.0)), 15.0
    )
    vectors = np.array([frame.vectors for frame in frames])  # the frames share no samples
    assert len(frames) > 140
    ratio = np.abs(vectors).std(axis=0) / np.mean([frame.sigma for frame in frames], axis=0)[:, None]
    assert np.all((ratio > 0.8) & (ratio < 1.2))
    turned = np.angle(vectors / vectors.mean(axis=0)).std(axis=0) / np.mean([f.phase_sigma for f in frames], axis=0)
    assert np.all((turned > 0.7) & (turned < 1.3))
