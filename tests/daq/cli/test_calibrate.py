"""`rig calibrate`: micrometer steps, files of points, records that are never overwritten, the tacho's levels."""

import io
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from daq.cli.main import main
from daq.config.calibration import load_calibration, load_record
from daq.errors import ConfigError

RigFiles = Callable[..., Path]

POINTS = "gap_um,volts,who\n100,0.95\n300,2.97\n500,5.01\n700,7.04\n900,9.05\n\n"
STILL = {"profile": [{"time_s": 0.0, "speed_rpm": 0.0}, {"time_s": 1.5, "speed_rpm": 0.0}]}


@contextmanager
def typed(text: str) -> Iterator[None]:
    """Provide this text on standard input."""
    before, sys.stdin = sys.stdin, io.StringIO(text)
    try:
        yield
    finally:
        sys.stdin = before


class _UntilCtrlC(io.StringIO):
    """Typed lines followed by Ctrl-C."""

    def readline(self, size: int | None = -1, /) -> str:  # type: ignore[override]  # typeshed has bytes for every file
        line = super().readline(-1 if size is None else size)
        if not line:
            raise KeyboardInterrupt
        return line


@contextmanager
def typed_until_ctrl_c(text: str) -> Iterator[None]:
    """Provide this text on standard input, then Ctrl-C."""
    before, sys.stdin = sys.stdin, _UntilCtrlC(text)
    try:
        yield
    finally:
        sys.stdin = before


def new_records(folder: Path) -> list[Path]:
    """Return the calibration records written in a folder."""
    return sorted(folder.glob("probe-x-*.toml"))


def points_file(folder: Path, text: str = POINTS) -> str:
    path = folder / "points.csv"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_almost_exact_fit_reports_its_residual(rig_file: RigFiles, tmp_path: Path) -> None:
    rig = rig_file()
    exact = "".join(f"{gap},{gap / 100 + 1e-7 * (gap % 200)}\n" for gap in range(100, 1000, 100))
    assert main(["calibrate", "gap", str(rig), "x", "--points", points_file(tmp_path, exact)]) == 0
    (record,) = new_records(rig.parent)
    assert 0.0 < load_calibration(record).residual < 1e-9


def test_micrometer_steps_reproduce_the_probes_curve(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> None:
    path = rig_file()
    with typed("100\n250\nx\n-5\n400\n9\n-\n550,0\n700\n850\n\n"):
        assert main(["calibrate", "gap", str(path), "x", "--operator", "me", "--target", "steel"]) == 0
    captured = capsys.readouterr()
    assert captured.err.count("step 4, gap in µm: ") == 2
    assert "'x': expected a gap in µm" in captured.err
    assert "'-5': expected a gap in µm" in captured.err
    assert "largest residual 0.0" in captured.out
    (record,) = new_records(path.parent)
    assert f'calibration = "{record.name}"' in captured.out
    new, old = load_calibration(record), load_calibration(path.parent / "probe-x.toml")
    assert new.coefficients == pytest.approx(old.coefficients, rel=0.02, abs=1e-7)
    assert new.residual < 0.1e-6
    assert (new.sensor, new.conditioner) == (old.sensor, old.conditioner)
    table = load_record(record).calibration
    assert (table.operator, table.target) == ("me", "steel")
    assert [point.gap_um for point in load_record(record).point] == [100, 250, 400, 550, 700, 850]


def test_points_from_a_file_are_fitted(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> None:
    path = rig_file()
    assert (
        main(["calibrate", "gap", str(path), "y", "--points", points_file(path.parent), "--order", "1", "--json"]) == 0
    )
    result = json.loads(capsys.readouterr().out)
    assert result["channel"] == "y"
    assert len(result["coefficients_um"]) == 2
    assert result["coefficients_um"][1] == pytest.approx(98.6, abs=0.5)
    assert [point["gap_um"] for point in result["points"]] == [100, 300, 500, 700, 900]
    assert result["residual_um"] == pytest.approx(max(abs(p["residual_um"]) for p in result["points"]), abs=1e-3)
    assert load_calibration(Path(result["file"])).residual == pytest.approx(result["residual_um"] * 1e-6)


def test_points_with_decimal_commas_and_semicolons_are_read(rig_file: RigFiles) -> None:
    path = rig_file()
    text = "Spalt;Volt\n100,5;0,95\n300;2,97\n500;5,01\n700;7,04\n"
    assert main(["calibrate", "gap", str(path), "x", "--points", points_file(path.parent, text)]) == 0
    (record,) = new_records(path.parent)
    assert load_record(record).point[0].gap_um == 100.5


def test_record_is_never_overwritten(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> None:
    path = rig_file()
    points = points_file(path.parent)
    for _ in range(2):
        assert main(["calibrate", "gap", str(path), "x", "--points", points]) == 0
    first, second = new_records(path.parent)
    assert first.name != second.name
    before = first.read_bytes()
    assert main(["calibrate", "gap", str(path), "x", "--points", points, "-o", str(first)]) == 2
    assert "never overwritten" in capsys.readouterr().err
    assert first.read_bytes() == before


def test_points_that_cannot_be_fitted_are_refused_and_measured_steps_saved(
    rig_file: RigFiles, capsys: pytest.CaptureFixture[str]
) -> None:
    path = rig_file()
    with typed("500\n400\n"):
        assert main(["calibrate", "gap", str(path), "x"]) == 2
    err = capsys.readouterr().err
    assert "2 points, expected at least 3" in err
    (saved,) = path.parent.glob("*.csv")
    assert str(saved) in err
    assert len(saved.read_text(encoding="utf-8").splitlines()) == 3
    assert new_records(path.parent) == []


def test_steps_are_saved_beside_earlier_ones_and_on_ctrl_c(
    rig_file: RigFiles, capsys: pytest.CaptureFixture[str]
) -> None:
    path = rig_file()
    for _ in range(2):
        with typed("500\n400\n"):
            assert main(["calibrate", "gap", str(path), "x"]) == 2
    with typed_until_ctrl_c("300\n450\n600\n"):
        assert main(["calibrate", "gap", str(path), "x"]) == 130
    saved = sorted(path.parent.glob("*.csv"))
    assert sorted(len(file.read_text(encoding="utf-8").splitlines()) for file in saved) == [3, 3, 4]
    err = capsys.readouterr().err
    assert "3 points saved to " in err
    assert all(str(file) in err for file in saved)


def test_step_that_cannot_be_measured_leaves_earlier_steps(
    rig_file: RigFiles, capsys: pytest.CaptureFixture[str]
) -> None:
    path = rig_file()
    with typed("100\n300\n500\n700\n9000\n900\n\n"):
        assert main(["calibrate", "gap", str(path), "x"]) == 0
    err = capsys.readouterr().err
    assert "not measured: probe x reads at the limit of ai0 at 9000 µm: skip this gap" in err
    assert err.count("step 5, gap in µm: ") == 2
    (record,) = new_records(path.parent)
    assert [point.gap_um for point in load_record(record).point] == [100, 300, 500, 700, 900]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["tacho"], "has no probe 'tacho': expected x or y"),
        (["x", "--points", "nowhere.csv"], "nowhere.csv: 1 error\n  no such file"),
        (["x", "--points", "POINTS"], "line 3: 'much,more': expected gap_um, volts"),
    ],
)
def test_wrong_channel_or_points_are_named(
    rig_file: RigFiles, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    path = rig_file()
    points = points_file(path.parent, "gap,volts\n1,2\nmuch,more\n")
    given = [points if argument == "POINTS" else argument for argument in arguments]
    assert main(["calibrate", "gap", str(path), *given]) == 2
    assert message in capsys.readouterr().err


def test_gap_beyond_the_cards_range_is_refused(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> None:
    path = rig_file(
        channel=[
            {"name": "x", "role": "probe_x", "physical": "ai0", "calibration": "probe-x.toml", "range_v": 5.0}
            | {"gap_window_v": [1.0, 4.0]},
            {"name": "y", "role": "probe_y", "physical": "ai1", "angle_deg": 90.0, "calibration": "probe-y.toml"},
            {"name": "tacho", "role": "tacho", "physical": "ai2"},
        ]
    )
    with typed("900\n"):
        assert main(["calibrate", "gap", str(path), "x"]) == 3
    assert "reads at the limit of ai0 at 900 µm" in capsys.readouterr().err


def test_unplugged_probe_is_refused(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> None:
    with typed("500\n"):
        assert main(["calibrate", "gap", str(rig_file(simulation={"miswiring": "probe x open"})), "x"]) == 3
    assert "probe x shows no sensor noise at 500 µm: unplugged, without supply" in capsys.readouterr().err


def test_record_with_points_only_is_fitted_on_loading(tmp_path: Path) -> None:
    path = tmp_path / "points.toml"
    points = "".join(f"[[point]]\ngap_um = {100 * k}\nvolts = {k}.0\n" for k in range(1, 7))
    path.write_text(f'[calibration]\ndate = "2026-11-24"\norder = 1\n{points}', encoding="utf-8")
    calibration = load_calibration(path)
    assert calibration.coefficients == pytest.approx((0.0, 1e-4), abs=1e-12)
    assert (calibration.volts_low, calibration.volts_high) == (1.0, 6.0)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", "calibration.coefficients_um: missing, expected a list in brackets, or the measured points"),
        (
            "order = 2\ncoefficients_um = [0, 100]\nvolts_low = 0\nvolts_high = 9",
            "calibration.order = 2: expected none",
        ),
        ("[[point]]\ngap_um = 1\nvolts = 1", "point: 1 points, expected at least 3"),
    ],
)
def test_record_without_curve_or_points_is_refused(tmp_path: Path, text: str, fault: str) -> None:
    path = tmp_path / "record.toml"
    path.write_text(f'[calibration]\ndate = "2026-11-24"\n{text}\n', encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_calibration(path)
    assert caught.value.faults[0].startswith(fault)


def test_tacho_proposes_threshold_and_hysteresis(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> None:
    levels = {"tacho_high_v": 5.0, "tacho_low_v": 1.0}
    assert main(["calibrate", "tacho", str(rig_file(simulation=levels))]) == 0
    out = capsys.readouterr().out
    assert "switches between 1.00 and 5.00 V" in out
    assert "\nthreshold_v = 3.00\nhysteresis_v = 1.00\n" in out
    assert "1.65 and 2.65 V lie between those of the signal" in out


def test_weak_tacho_signal_gets_lower_levels(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", "tacho", str(rig_file(simulation={"miswiring": "tacho weak"})), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["level_low_v"] < result["threshold_v"] < result["level_high_v"] < result["current_threshold_v"]


def test_tacho_that_does_not_switch_exits_with_4(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(rig_file(simulation=STILL))
    assert main(["calibrate", "tacho", path]) == 4
    assert "turn the shaft" in capsys.readouterr().out
    assert main(["calibrate", "tacho", path, "--json"]) == 4
    assert json.loads(capsys.readouterr().out)["threshold_v"] is None
