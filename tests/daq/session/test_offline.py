"""Recorded runs analysed again, and run-out from given vectors, the run's own slow roll, or an earlier run's."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.signals.blocks import SampleBlock
from analysis.signals.header import Calibration, RunHeader
from analysis.signals.units import MICROMETRE
from daq.cli.main import main
from daq.config.loader import load_rig
from daq.config.rig import Rig
from daq.drivers.factory import open_source
from daq.drivers.replay import ReplaySource
from daq.errors import ConfigError, UsageError
from daq.session.offline import corrected_header, summarise, with_reference_runout
from recordings.mcap.reader import RunReader
from recordings.mcap.writer import RunWriter
from tests.daq.conftest import RigFactory, RigFiles
from tests.daq.support.counted_bench import analysed, encoded_snapshots
from tests.daq.support.reblocking import reblocked
from tests.daq.support.recorded_bench import record_run

RUN_UP = {"profile": [{"time_s": 0.0, "speed_rpm": 4000.0}, {"time_s": 2.0, "speed_rpm": 9000.0}]}


@pytest.fixture
def run(rig: RigFactory, tmp_path: Path) -> Path:
    """Return a recording of the small rig without stored results."""
    bench = rig(limits={"speed_rpm": 7000.0})
    source = open_source(bench)
    header = RunHeader(
        run="run",
        rig="rig",
        started_ns=1_795_511_527_000_000_000,
        acquisition=source.acquisition,
        settings=bench.settings,
        limits=bench.limits,
        config_toml=bench.toml,
        program="rig",
    )
    writer = RunWriter(tmp_path / "run.mcap", header)
    for item in source.blocks():
        if isinstance(item, SampleBlock):
            writer.write_block(item)
        else:
            writer.write_segment_end(item)
    writer.close(skipped_samples=1)  # `summarise` then analyses the samples
    return writer.path


def twice(calibration: Calibration) -> Calibration:
    """Return the calibration of a probe with half the sensitivity."""
    return replace(calibration, coefficients=tuple(2 * c for c in calibration.coefficients))


def test_summary_with_unchanged_calibrations_is_unchanged(run: Path) -> None:
    with RunReader(run) as reader:
        again, before = summarise(reader, None, corrected_header(reader.header, {})), summarise(reader)
    assert (again.probes, again.segments, again.samples) == (before.probes, before.segments, before.samples)
    for row, other in zip(again.rows, before.rows, strict=True):
        np.testing.assert_array_equal(row.vectors, other.vectors)


def test_corrected_calibration_changes_one_probe_only(run: Path) -> None:
    fractions: list[float] = []
    with RunReader(run) as reader:
        before = summarise(reader)
        calibration = reader.header.acquisition.channels[0].calibration
        assert calibration is not None
        header = corrected_header(reader.header, {"x": twice(calibration)})
        after = summarise(reader, fractions.append, header)
    (x_before, y_before), (x_after, y_after) = before.probes, after.probes
    assert x_after.largest_peak_to_peak == pytest.approx(2 * x_before.largest_peak_to_peak)
    assert x_after.gap_mean == x_before.gap_mean
    assert y_after == y_before
    assert fractions[-1] == 1.0


def test_unknown_probe_is_refused_by_name(run: Path) -> None:
    calibration = Calibration((0.0, 1e-4), 0.0, 10.0)
    with RunReader(run) as reader, pytest.raises(UsageError, match="no probe 'tacho': expected x or y"):
        corrected_header(reader.header, {"tacho": calibration})


def test_summary_with_an_invalid_calibration_option_reports_the_error(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["summary", str(run), "--calibration", f"x={tmp_path / 'gone.toml'}"]) == 2
    assert "gone.toml: 1 error\n  no such file" in capsys.readouterr().err
    assert main(["summary", str(run), "--calibration", f"z={tmp_path / 'probe-x.toml'}"]) == 2
    assert "no probe 'z'" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["summary", str(run), "--calibration", "probe-x.toml"])
    assert "expected a probe and a file" in capsys.readouterr().err


@pytest.mark.parametrize("block", [None, 97, 4_096, 100_000])
def test_offline_results_equal_live_results_for_any_block_size(
    rig: RigFactory, tmp_path: Path, block: int | None
) -> None:
    path = record_run(rig(simulation=RUN_UP), tmp_path)  # with the results of a live analysis
    with RunReader(path) as reader, closing(ReplaySource(path, None)) as source:
        live = list(reader.snapshots())
        offline = analysed(reader.header, reblocked(source, block))
        assert sum(snapshot.frame is not None for snapshot in live) >= 10
        assert encoded_snapshots(reader.header, offline) == encoded_snapshots(reader.header, live)


QUIET = {"run_out_um": 3.0, "speed_fluctuation": 0.0, "glitches_per_s": 0.0}


def profile(*points: tuple[float, float]) -> dict[str, object]:
    """Return [simulation] with a speed profile of points (s, r/min)."""
    return QUIET | {"profile": [{"time_s": time_s, "speed_rpm": speed_rpm} for time_s, speed_rpm in points]}


SLOW_THEN_FAST = profile((0, 600), (4, 600), (7, 6000), (8, 6000))
FAST = profile((0, 6000), (2, 6000))
VECTOR = {"x_um": 2.0, "x_lag_deg": 90.0, "y_um": 1.0, "y_lag_deg": 0.0}


def test_given_run_out_is_in_si_units_with_its_source(rig: RigFactory) -> None:
    settings = rig(runout={"vector": [VECTOR | {"sigma_um": 0.1}], "correct_orbit": True}).settings.runout
    ((order, x, y),) = settings.vectors
    assert (order, settings.from_orbit, settings.source) == (1, True, "rig.toml")
    assert x == pytest.approx(-2e-6j)
    assert y == pytest.approx(1e-6)
    assert settings.sigma == pytest.approx((1e-7, 0.0))
    assert not rig().settings.runout.is_enabled


@pytest.mark.parametrize(
    ("tables", "expected"),
    [
        ({"runout": {"vector": [VECTOR], "slow_roll_rpm": 600.0}}, "runout.vector: expected none with slow_roll_rpm"),
        ({"runout": {"from_run": "earlier"}}, 'runout.from_run = "earlier": expected slow_roll_rpm too'),
        ({"runout": {"vector": [VECTOR, VECTOR]}}, "runout.vector[1].order = 1: expected each order once"),
        ({"runout": {"vector": [VECTOR | {"order": 9}]}}, "expected at most analysis.highest_order = 8"),
        (
            {"runout": {"slow_roll_rpm": 600.0}, "tacho": {"pulses_per_revolution": 2}, "limits": {"speed_rpm": 9e3}},
            "tacho.pulses_per_revolution = 2: expected 1 with [runout]",
        ),
    ],
)
def test_contradictory_run_out_settings_are_refused(
    rig_file: RigFiles, tables: dict[str, object], expected: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        load_rig(rig_file(**tables))
    assert any(expected in fault for fault in caught.value.faults)


def test_run_out_is_estimated_from_the_slow_roll_of_the_run(rig: RigFactory, tmp_path: Path) -> None:
    path = record_run(rig(simulation=SLOW_THEN_FAST, runout={"slow_roll_rpm": 700.0}), tmp_path)
    with RunReader(path) as reader:
        frames = [snapshot.frame for snapshot in reader.snapshots() if snapshot.frame is not None]
    last = frames[-1]
    assert frames[0].runout is None
    assert last.runout is not None
    assert np.abs(last.runout.vectors[0]) == pytest.approx(np.full(2, 3.0 * MICROMETRE), rel=0.1)
    assert last.compensated is not None
    assert np.abs(last.compensated[0] - last.vectors[0]) == pytest.approx(np.abs(last.runout.vectors[0]))


def test_run_out_is_taken_from_the_slow_roll_of_an_earlier_run(rig: RigFactory, tmp_path: Path) -> None:
    earlier = rig(simulation=SLOW_THEN_FAST)
    record_run(earlier, tmp_path, "earlier")
    configured = rig(simulation=FAST, runout={"slow_roll_rpm": 700.0, "from_run": "earlier", "correct_orbit": True})
    later = with_reference_runout(configured, tmp_path)
    runout = later.settings.runout
    assert runout.source == "slow roll of earlier up to 700 r/min"
    assert runout.slow_roll_speed == 0.0
    assert [order for order, _, _ in runout.vectors] == list(range(1, 9))
    assert abs(runout.vectors[0][1]) == pytest.approx(3.0 * MICROMETRE, rel=0.1)
    assert "[[runout.vector]]" in later.toml
    with RunReader(record_run(later, tmp_path, "later")) as reader:
        assert reader.header.settings.runout == runout
        frames = [snapshot.frame for snapshot in reader.snapshots() if snapshot.frame is not None]
    assert all(frame.compensated is not None and frame.compensated_orbit is not None for frame in frames)
    assert with_reference_runout(earlier, tmp_path) is earlier


def test_earlier_run_that_is_missing_or_has_no_slow_roll_is_refused(rig: RigFactory, tmp_path: Path) -> None:
    record_run(rig(simulation=FAST), tmp_path, "fast")
    missing = rig(runout={"slow_roll_rpm": 700.0, "from_run": "missing"})
    with pytest.raises(UsageError, match=r"runout\.from_run: .*missing"):
        with_reference_runout(missing, tmp_path)
    never_slow = rig(runout={"slow_roll_rpm": 700.0, "from_run": "fast"})
    with pytest.raises(UsageError, match="fast holds no order spectrum up to 700 r/min"):
        with_reference_runout(never_slow, tmp_path)


def test_earlier_run_with_other_probe_angles_or_tacho_is_refused(rig: RigFactory, tmp_path: Path) -> None:
    record_run(rig(simulation=SLOW_THEN_FAST), tmp_path, "earlier")
    section = {"slow_roll_rpm": 700.0, "from_run": "earlier"}
    falling = rig(runout=section, tacho={"edge": "falling"})
    with pytest.raises(UsageError, match="times the rising edge of 1 marks, expected falling of 1"):
        with_reference_runout(falling, tmp_path)
    turned = rig(runout=section)
    channels = tuple(c.model_copy(update={"angle_deg": c.angle_deg + 10.0}) for c in turned.config.channel)
    turned = Rig(turned.path, turned.config.model_copy(update={"channel": channels}), turned.calibrations)
    with pytest.raises(UsageError, match="probe x is at 45 degrees, expected 55"):
        with_reference_runout(turned, tmp_path)
