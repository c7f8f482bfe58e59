"""The speed table on snapshots of a bench."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from analysis.signals.header import RunOutSettings
from analysis.signals.ramp import RampDirection
from analysis.signals.units import MICROMETRE
from analysis.vectors.speed_table import BIN_WIDTH, SpeedTable

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
        assert np.all(row.peak_to_peak <= row.largest_peak_to_peak)
        assert 40 * MICROMETRE < row.peak_to_peak[0] < 60 * MICROMETRE
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
