"""A run evaluated anew with a corrected calibration: what it would have said with that record from the start."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.signals.blocks import SampleBlock
from analysis.signals.header import Calibration, RunHeader
from daq.cli.main import main
from daq.config.rig import Rig
from daq.drivers.factory import open_source
from daq.errors import UsageError
from daq.session.offline import corrected_header, summarise
from recordings.mcap.reader import RunReader
from recordings.mcap.writer import RunWriter

RigFactory = Callable[..., Rig]


@pytest.fixture
def run(rig: RigFactory, tmp_path: Path) -> Path:
    """A recording of the small rig without results beside its samples."""
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
    writer.close(skipped_samples=1)  # whoever sums it up analyses the samples
    return writer.path


def twice(calibration: Calibration) -> Calibration:
    """Return the calibration of a probe that is half as sensitive."""
    return replace(calibration, coefficients=tuple(2 * c for c in calibration.coefficients))


def test_run_with_its_own_calibrations_is_what_it_was(run: Path) -> None:
    with RunReader(run) as reader:
        anew, before = summarise(reader, None, corrected_header(reader.header, {})), summarise(reader)
    assert (anew.probes, anew.segments, anew.samples) == (before.probes, before.segments, before.samples)
    for row, other in zip(anew.rows, before.rows, strict=True):
        np.testing.assert_array_equal(row.vectors, other.vectors)


def test_corrected_probe_changes_and_the_other_does_not(run: Path) -> None:
    told: list[float] = []
    with RunReader(run) as reader:
        before = summarise(reader)
        calibration = reader.header.acquisition.channels[0].calibration
        assert calibration is not None
        header = corrected_header(reader.header, {"x": twice(calibration)})
        after = summarise(reader, told.append, header)
    (x_before, y_before), (x_after, y_after) = before.probes, after.probes
    assert x_after.largest_peak_to_peak == pytest.approx(2 * x_before.largest_peak_to_peak)
    assert x_after.gap_mean == x_before.gap_mean
    assert y_after == y_before
    assert told[-1] == 1.0


def test_probe_that_the_run_has_not_is_named(run: Path) -> None:
    calibration = Calibration((0.0, 1e-4), 0.0, 10.0)
    with RunReader(run) as reader, pytest.raises(UsageError, match="no probe 'tacho': expected x or y"):
        corrected_header(reader.header, {"tacho": calibration})


def test_summary_with_a_wrong_record_says_what_is_wrong(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["summary", str(run), "--calibration", f"x={tmp_path / 'gone.toml'}"]) == 2
    assert "gone.toml: 1 error\n  no such file" in capsys.readouterr().err
    assert main(["summary", str(run), "--calibration", f"z={tmp_path / 'probe-x.toml'}"]) == 2
    assert "no probe 'z'" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["summary", str(run), "--calibration", "probe-x.toml"])
    assert "expected a probe and a file" in capsys.readouterr().err
