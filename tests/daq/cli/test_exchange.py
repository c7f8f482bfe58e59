"""`rig export` and `rig import`: a round trip preserves a run within the format's precision."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from nptdms import ChannelObject, TdmsWriter
from scipy.io import wavfile

from analysis.signals.header import Role
from analysis.signals.units import MICROMETRE, RPM
from daq.cli.main import main
from daq.config.rig import Rig
from daq.config.toml_files import to_toml
from recordings.exchange.export import results_table, samples_table
from recordings.integrity.verify import Verdict, verify
from recordings.mcap.reader import RunReader
from tests.daq.support.recorded_bench import RUN

Captured = pytest.CaptureFixture[str]
MakeMapping = Callable[..., Path]
STARTED_NS = 1_795_511_527_000_000_000
RATE, SECONDS = 20_000.0, 2.0
NAMES = ("x", "y", "tacho")


def test_reading_progress_rises_to_1(run: Path) -> None:
    with RunReader(run) as reader:
        for make_table in (samples_table, results_table):
            fractions: list[float] = []
            make_table(reader, on_progress=fractions.append)
            assert fractions == sorted(fractions)
            assert fractions[-1] == pytest.approx(1.0, abs=0.06)


@pytest.fixture
def mapping(tmp_path: Path, rig_file: Callable[..., Path]) -> MakeMapping:
    """Return a writer of mapping files: ``mapping({"x": {"source": …, "unit": …}, …}, rate_hz=…)`` is its path."""

    def write(channels: dict[str, dict[str, object]], **top: object) -> Path:
        rig_file(tacho={"counter": {"reference": "counter"}})
        path = tmp_path / "mapping.toml"
        path.write_text(to_toml({"rig": "rig.toml", **top, "channel": channels}), encoding="utf-8")
        return path

    return write


def engineering(path: Path) -> list[np.ndarray[tuple[int, ...], np.dtype[np.float64]]]:
    """Return displacement in µm, displacement in µm, volts."""
    with RunReader(path) as reader:
        codes = reader.samples(0, 0, reader.segment_ends[0].samples)
        channels = reader.header.acquisition.channels
        return [
            channel.volts(row) if channel.role is Role.TACHO else channel.displacement(row) / MICROMETRE
            for channel, row in zip(channels, codes, strict=True)
        ]


@pytest.mark.parametrize("suffix", ["tdms", "csv", "mat", "uff"])
def test_exported_run_is_imported_unchanged(
    run: Path, folder: Path, tmp_path: Path, mapping: MakeMapping, capsys: Captured, suffix: str
) -> None:
    target = tmp_path / f"out.{suffix}"
    assert main(["export", RUN, "--to", str(target)]) == 0
    assert capsys.readouterr().out == f"{target}: 40,000 rows of time_s, x_um, y_um, tacho_v\n"
    group = "run/" if suffix == "tdms" else ""
    sources: dict[str, dict[str, object]] = {
        "x": {"source": f"{group}x_um", "unit": "um"},
        "y": {"source": f"{group}y_um", "unit": "um"},
        "tacho": {"source": f"{group}tacho_v", "unit": "V"},
    }
    run.rename(folder / "original.mcap")
    assert main(["import", str(target), "--mapping", str(mapping(sources))]) == 0
    assert "3 × 20 kS/s  2.0 s" in capsys.readouterr().out
    (imported,) = set(folder.glob("*.mcap")) - {folder / "original.mcap"}
    verification = verify(imported)
    assert verification.verdict is Verdict.INTACT, verification.findings
    assert not [finding for finding in verification.findings if "rails" in finding.what], "nothing is clipped"
    for name, before, after in zip(NAMES, engineering(folder / "original.mcap"), engineering(imported), strict=True):
        step = np.ptp(before) / 65_532
        assert np.abs(after - before).max() <= 0.5001 * step + 1e-9 * np.abs(before).max(), name
        assert step < 0.01, "the step of the imported codes is far below what the probes resolve"
    with RunReader(folder / "original.mcap") as one, RunReader(imported) as other:
        assert other.header.acquisition.rate == one.header.acquisition.rate
        assert other.header.acquisition.tacho.counter is None  # the rig has one, but the file has no stamps
        assert abs(other.header.started_ns - one.header.started_ns) < 1000
        assert other.header.note == ("" if suffix == "uff" else "cold oil")
        assert [c.angle for c in other.header.acquisition.channels] == [
            c.angle for c in one.header.acquisition.channels
        ]
        speeds = [[snapshot.speed for snapshot in reader.snapshots()] for reader in (one, other)]
        sizes = [[snapshot.peak_to_peak for snapshot in reader.snapshots()] for reader in (one, other)]
    np.testing.assert_allclose(speeds[1], speeds[0], rtol=1e-5)
    np.testing.assert_allclose(sizes[1], sizes[0], atol=0.05e-6)


def test_part_of_a_run_is_exported(run: Path, tmp_path: Path) -> None:
    target = tmp_path / "part.parquet"
    assert main(["export", str(run), "--to", str(target), "--from", "0.5s", "--until", "1.25s"]) == 0
    table = pq.read_table(target)
    assert table.num_rows == 15_000
    times = table.column("time_s").to_numpy()
    assert (times[0], times[-1]) == (0.5, 1.25 - 1 / RATE)
    np.testing.assert_allclose(table.column("x_um").to_numpy(), engineering(run)[0][10_000:25_000], rtol=1e-15)
    assert table.schema.metadata[b"started_ns"] == str(STARTED_NS + 500_000_000).encode()
    assert table.schema.metadata[b"note"] == b"cold oil"


@pytest.mark.parametrize("suffix", ["csv", "parquet", "h5", "tdms", "mat", "uff"])
def test_results_are_exported_to_every_format(run: Path, tmp_path: Path, capsys: Captured, suffix: str) -> None:
    target = tmp_path / f"results.{suffix}"
    assert main(["export", str(run), "--to", str(target), "--results"]) == 0
    assert "speed_rpm, gap_x_v" in capsys.readouterr().out
    assert target.stat().st_size > 500
    if suffix == "parquet":
        table = pq.read_table(target)
        with RunReader(run) as reader:
            snapshots = list(reader.snapshots())
        assert table.num_rows == len(snapshots)
        np.testing.assert_allclose(table.column("speed_rpm").to_numpy()[-5:], 6000, rtol=0.05)
        frame = snapshots[-1].frame
        assert frame is not None
        assert table.column("x_1x_um")[-1].as_py() == pytest.approx(abs(frame.vectors[0, 0]) / MICROMETRE)
        assert table.column("y_2x_um")[-1].as_py() == pytest.approx(abs(frame.vectors[1, 1]) / MICROMETRE)
        assert table.schema.field("x_1x_lag_deg").metadata[b"unit"] == b"deg"
        assert table.column("sigma_1x_um")[-1].as_py() == pytest.approx(frame.sigma[0] / MICROMETRE)
        assert np.isnan(table.column("x_1x_compensated_um").to_numpy()).all()  # no run-out is configured
        assert np.isnan(table.column("second_whirl_order").to_numpy()).all()


LVM = """LabVIEW Measurement
Separator\tTab
Decimal_Separator\t,
X_Columns\tOne
Date\t2012/05/01
Time\t10:30:00,5
***End_of_Header***

Channels\t3
Y_Unit_Label\tVolts\tVolts\tVolts
Delta_X\t5,0E-5\t5,0E-5\t5,0E-5
***End_of_Header***
X_Value\tKaman 1\tKaman 2\tTacho
"""


def bench_volts() -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Return one second of two probes and a tacho at 6000 r/min, V."""
    turn = 100.0 * np.arange(20_000) / RATE
    return np.stack([5 + np.sin(2 * np.pi * turn), 5 + np.cos(2 * np.pi * turn), 4.0 * (turn % 1 < 0.5)])


def test_labview_measurement_is_imported(
    folder: Path, tmp_path: Path, mapping: MakeMapping, rig: Callable[..., Rig]
) -> None:
    volts = bench_volts()
    rows = "".join(
        f"{k / RATE:.6f}\t{a:.9f}\t{b:.9f}\t{c:.9f}\n".replace(".", ",") for k, (a, b, c) in enumerate(volts.T)
    )
    (tmp_path / "log.lvm").write_text(LVM + rows)
    sources: dict[str, dict[str, object]] = {
        "x": {"source": "Kaman 1"}, "y": {"source": "Kaman 2"}, "tacho": {"source": "Tacho"},
    }  # fmt: skip
    assert main(["import", str(tmp_path / "log.lvm"), "--mapping", str(mapping(sources, note="thesis"))]) == 0
    (path,) = folder.glob("*.mcap")
    assert verify(path).verdict is Verdict.INTACT
    with RunReader(path) as reader:
        acquisition = reader.header.acquisition
        assert (acquisition.rate, reader.header.note) == (RATE, "thesis")
        assert acquisition.channels[0].calibration == rig().calibrations["x"]
        codes = reader.samples(0, 0, 20_000)
        for row, channel in enumerate(acquisition.channels):
            assert np.abs(channel.volts(codes[row]) - volts[row]).max() <= 0.51 * np.ptp(volts[row]) / 65_532
        speeds = [snapshot.speed / RPM for snapshot in reader.snapshots()]
    np.testing.assert_allclose(speeds[-1], 6000, rtol=1e-3)
    assert path.stem.startswith("2012-05-01T10-30-00")


def test_tdms_file_of_volts_and_wav_file_of_codes_are_imported(
    folder: Path, tmp_path: Path, mapping: MakeMapping
) -> None:
    volts = bench_volts()
    with TdmsWriter(tmp_path / "log.tdms") as writer:
        writer.write_segment([
            ChannelObject("Kaman", name, row, {"wf_increment": 1 / RATE, "unit_string": "V"})
            for name, row in zip(NAMES, volts, strict=True)
        ])  # fmt: skip
    sources: dict[str, dict[str, object]] = {name: {"source": f"Kaman/{name}"} for name in NAMES}
    assert main(["import", str(tmp_path / "log.tdms"), "--mapping", str(mapping(sources))]) == 0
    codes = np.round(volts / 10 * 32768).astype(np.int16)
    wavfile.write(tmp_path / "log.wav", int(RATE), codes.T)
    sources = {name: {"source": str(k), "factor": 10 / 32768} for k, name in enumerate(NAMES, start=1)}
    made = mapping(sources, started="2012-05-01T10:30:00")
    assert main(["import", str(tmp_path / "log.wav"), "--mapping", str(made)]) == 0
    (path,) = folder.glob("2012-*.mcap")
    with RunReader(path) as reader:
        np.testing.assert_array_equal(reader.samples(0, 0, 20_000), codes)
        assert reader.header.acquisition.channels[0].scaling == (0.0, 10 / 32768)
    assert len(list(folder.glob("*.mcap"))) == 2


def test_mapping_that_does_not_fit_reports_every_fault(
    folder: Path, tmp_path: Path, mapping: MakeMapping, capsys: Captured
) -> None:
    (tmp_path / "log.csv").write_text("a,b,c\n1,2,3\n2,3,4\n")
    made = mapping({"x": {"source": "a"}, "z": {"source": "b"}, "tacho": {"source": "c", "unit": "um"}})
    assert main(["import", str(tmp_path / "log.csv"), "--mapping", str(made)]) == 2
    err = capsys.readouterr().err
    assert "mapping.toml: 4 errors" in err
    for word in (
        "channel.y: is missing",
        "channel.z: the rig has no such",
        "channel.tacho.unit",
        "rate_hz: is missing",
    ):
        assert word in err
    made = mapping({name: {"source": "d"} for name in NAMES}, rate_hz=100.0)
    assert main(["import", str(tmp_path / "log.csv"), "--mapping", str(made)]) == 2
    assert "no column 'd'; there are 'a', 'b', 'c'" in capsys.readouterr().err
    made.write_text('rig = "rig.toml"\nrate_hz = -1\nstarted = "soon"\n')
    assert main(["import", str(tmp_path / "log.csv"), "--mapping", str(made)]) == 2
    err = capsys.readouterr().err
    assert "mapping.toml: 3 errors" in err
    assert "channel: missing, expected tables: [channel.NAME]" in err
    assert list(folder.glob("*.mcap")) == []


def test_impossible_export_is_refused(run: Path, tmp_path: Path, capsys: Captured) -> None:
    cases = {
        ("--to", "x.xls"): "suffix '.xls', expected one of",
        ("--to", "x.csv", "--from", "5s"): "0 samples from 5 s to inf s of a segment of 2 s, expected 1 to",
        ("--to", "x.csv", "--segment", "3"): "segment 3, expected one of 0",
        ("--to", "x.csv", "--from", "9s", "--results"): "has no results",
    }
    for arguments, expected in cases.items():
        assert main(["export", str(run), *arguments]) == 2
        assert expected in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["export", str(run), "--to", str(tmp_path / "x.csv"), "--from", "soon"])
    assert "expected a time such as 10s" in capsys.readouterr().err
