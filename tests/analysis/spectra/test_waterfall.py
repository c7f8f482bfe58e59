"""Waterfall and cascade of fixed size."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from analysis.signals.snapshot import Snapshot
from analysis.signals.units import MICROMETRE
from analysis.spectra.waterfall import Cascade, CascadeMode, Waterfall, order_axis

if TYPE_CHECKING:
    from tests.analysis.conftest import Bench


@pytest.fixture
def snapshot(make_bench: Callable[..., "Bench"]) -> Snapshot:
    bench = make_bench()
    codes = bench.codes(bench.steady(100.0), bench.circles((20 * MICROMETRE, 1.0, 0.4)), 0.4)
    return bench.snapshots(codes)[-1]


def at(snapshot: Snapshot, time: float, factor: float = 1.0, speed: float | None = None, segment: int = 0) -> Snapshot:
    assert snapshot.frame is not None
    frame = replace(snapshot.frame, spectrum=factor * snapshot.frame.spectrum, speed=speed or snapshot.frame.speed)
    return replace(snapshot, time=time, frame=frame, segment=segment)


def test_order_axis_equals_that_of_the_frames(make_bench: Callable[..., "Bench"], snapshot: Snapshot) -> None:
    assert snapshot.frame is not None
    np.testing.assert_array_equal(order_axis(make_bench().settings), snapshot.frame.orders)


def test_waterfall_scrolls_with_the_newest_row_last(make_bench: Callable[..., "Bench"], snapshot: Snapshot) -> None:
    waterfall = Waterfall(make_bench().settings, rows=5, span=1.0)
    for number in range(1, 11):
        waterfall.add_snapshot(at(snapshot, 0.1 * number + 0.01, factor=number))
    peaks = waterfall.amplitudes[:, 16] / (20 * MICROMETRE)
    np.testing.assert_allclose(peaks, [3, 5, 7, 9, 10], rtol=0.01)
    np.testing.assert_allclose(waterfall.times, [0.2, 0.4, 0.6, 0.8, 1.0], atol=1e-12)
    assert waterfall.amplitudes.shape == (5, waterfall.orders.size)


def test_rows_without_a_frame_are_empty_and_segments_follow(
    make_bench: Callable[..., "Bench"], snapshot: Snapshot
) -> None:
    waterfall = Waterfall(make_bench().settings, rows=10, span=1.0)
    waterfall.add_snapshot(at(snapshot, 0.15))
    waterfall.add_snapshot(replace(snapshot, time=0.35, segment=0, frame=None))
    waterfall.add_snapshot(at(snapshot, 0.1, segment=1))
    filled = np.flatnonzero(waterfall.amplitudes[:, 16])
    np.testing.assert_allclose(waterfall.times[filled], [0.1, 0.4])
    waterfall.add_snapshot(at(snapshot, 100.0, segment=1))
    assert np.count_nonzero(waterfall.amplitudes[:, 16]) == 1


def test_cascade_contains_the_largest_or_the_last_frame(make_bench: Callable[..., "Bench"], snapshot: Snapshot) -> None:
    largest = Cascade(make_bench().settings, 1000.0, rows=10)
    last = Cascade(make_bench().settings, 1000.0, rows=10, keep=CascadeMode.LAST)
    for cascade in (largest, last):
        for factor, speed in [(3.0, 250.0), (1.0, 260.0), (2.0, 5000.0)]:
            cascade.add_snapshot(at(snapshot, 0.0, factor, speed))
        cascade.add_snapshot(replace(snapshot, frame=None))
        assert np.flatnonzero(cascade.filled).tolist() == [2, 9]
        assert cascade.speeds[2] == 250.0
    assert largest.amplitudes[[2, 9], 16] / (20 * MICROMETRE) == pytest.approx([3, 2], rel=0.01)
    assert last.amplitudes[[2, 9], 16] / (20 * MICROMETRE) == pytest.approx([1, 2], rel=0.01)


def test_zero_rows_and_ranges_are_refused(make_bench: Callable[..., "Bench"]) -> None:
    settings = make_bench().settings
    with pytest.raises(ValueError, match="rows"):
        Waterfall(settings, rows=0)
    with pytest.raises(ValueError, match="highest_speed"):
        Cascade(settings, 0.0)
