"""Offline analysis of a recording: equal to the live results, and repeated with corrected calibrations."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.signals.blocks import SampleBlock
from analysis.signals.header import Calibration, RunHeader
from daq.cli.main import main
from daq.drivers.factory import open_source
from daq.drivers.replay import open_replay
from daq.errors import UsageError
from daq.session.offline import corrected_header, summarise
from recordings.mcap.reader import RunReader
from recordings.mcap.writer import RunWriter
from tests.daq.conftest import RigFactory
from tests.daq.support.counted_bench import analysed, encoded_snapshots
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
    with RunReader(path) as reader, closing(open_replay(path, None, block=block)) as source:
        live = list(reader.snapshots())
        offline = analysed(reader.header, source.blocks())
        assert sum(snapshot.frame is not None for snapshot in live) >= 10
        assert encoded_snapshots(reader.header, offline) == encoded_snapshots(reader.header, live)
