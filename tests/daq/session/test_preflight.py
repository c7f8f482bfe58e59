"""Preflight checks: every miswiring gives its finding and no other, and a good rig passes."""

import datetime as dt
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.preflight.check_result import Check, Finding, Verdict
from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.units import RPM
from daq.cli.main import main
from daq.config.rig import Rig
from daq.config.schema import Miswiring
from daq.errors import ConfigError
from daq.schemas.checks import PreflightSchema
from daq.session.preflight import (
    PlannedRun,
    PreflightReport,
    calibration_checks,
    disk_check,
    planned_speed_check,
    run_preflight_checks,
    sample_checks,
)
from tests.daq.conftest import RigFactory, RigFiles

TODAY = dt.date(2026, 11, 24)
SERIALS_CHECK = "probe serials"  # the test rig's two probes share a record

EXPECTED_FAILURES = {
    Miswiring.X_OPEN: {("probe x gap", Finding.OPEN)},
    Miswiring.Y_OPEN: {("probe y gap", Finding.OPEN)},
    Miswiring.X_INTERMITTENT: {("probe x contact", Finding.INTERMITTENT)},
    Miswiring.X_CLOSED: {("probe x gap", Finding.GAP_CLOSED)},
    Miswiring.Y_OUT_OF_REACH: {("probe y gap", Finding.CLIPPED)},
    Miswiring.X_REVERSED: {("probe x gap", Finding.REVERSED)},
    Miswiring.BRIDGED: {("probes x and y apart", Finding.BRIDGED)},
    Miswiring.PROBES_EXCHANGED: {("1X direction", Finding.PROBES_EXCHANGED)},
    Miswiring.TACHO_EXCHANGED: {("probe x signal", Finding.TACHO_EXCHANGED)},
    Miswiring.TACHO_SILENT: {("tacho levels", Finding.SILENT)},
    Miswiring.TACHO_REVERSED: {("tacho levels", Finding.REVERSED)},
    Miswiring.TACHO_WEAK: {("tacho levels", Finding.LEVELS)},
    Miswiring.HUM: {("probe x mains hum", Finding.HUM), ("probe y mains hum", Finding.HUM)},
}


def steady(speed_rpm: float, **simulation: object) -> dict[str, object]:
    profile = [{"time_s": 0.0, "speed_rpm": speed_rpm}, {"time_s": 1.5, "speed_rpm": speed_rpm}]
    return {"profile": profile} | simulation


def checked(rig: Rig, tmp_path: Path, *, duration: float | None = 10.0, speed: float | None = None) -> PreflightReport:
    return run_preflight_checks(rig, PlannedRun(tmp_path / "data", duration, speed), TODAY, lambda _text: None)


def failures(found: PreflightReport) -> set[tuple[str, Finding | None]]:
    return {(check.name, check.finding) for check in found.checks if check.verdict is Verdict.FAIL}


def warnings(found: PreflightReport) -> set[str]:
    return {check.name for check in found.checks if check.verdict is Verdict.WARN}


def check_by_name(checks: list[Check] | tuple[Check, ...], name: str) -> Check:
    (check,) = (check for check in checks if check.name == name)
    return check


def test_every_miswiring_is_covered() -> None:
    assert set(EXPECTED_FAILURES) == set(Miswiring) - {Miswiring.NONE}
    assert len(EXPECTED_FAILURES) >= 10


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("miswiring", EXPECTED_FAILURES)
def test_miswiring_gives_its_finding_and_no_other(
    rig: RigFactory, tmp_path: Path, miswiring: Miswiring, seed: int
) -> None:
    bench = rig(simulation=steady(1200.0 + 500.0 * seed, seed=seed, miswiring=miswiring.value))
    assert failures(checked(bench, tmp_path)) == EXPECTED_FAILURES[miswiring]


@pytest.mark.parametrize(("seed", "speed_rpm"), [(1, 1000.0), (2, 6000.0), (3, 15_000.0), (4, 19_500.0)])
def test_good_rig_passes_at_any_speed(rig: RigFactory, tmp_path: Path, seed: int, speed_rpm: float) -> None:
    bench = rig(timing={"rate_hz": 50_000.0}, simulation=steady(speed_rpm, seed=seed))
    found = checked(bench, tmp_path)
    assert failures(found) == set()
    assert warnings(found) == {"device", SERIALS_CHECK}


def test_shaft_at_rest_gives_advice_to_turn_it_by_hand(rig: RigFactory, tmp_path: Path) -> None:
    found = checked(rig(simulation=steady(0.0)), tmp_path)
    assert failures(found) == set()
    assert check_by_name(found.checks, "tacho levels").finding is Finding.STILL
    assert "by hand" in check_by_name(found.checks, "tacho levels").advice


def test_shaft_at_the_mains_frequency_is_not_reported_as_hum(rig: RigFactory, tmp_path: Path) -> None:
    bench = rig(simulation=steady(3000.0, run_out_um=20.0, speed_fluctuation=0.0))
    found = checked(bench, tmp_path)
    assert failures(found) == set()
    assert check_by_name(found.checks, "probe x mains hum").finding is Finding.INCONCLUSIVE


def test_whirl_near_the_mains_frequency_is_not_reported_as_hum(rig: RigFactory, tmp_path: Path) -> None:
    whirl = {"order": 0.48, "onset_rpm": 5000.0, "end_rpm": 8000.0, "amplitude_um": 20.0}
    found = checked(rig(simulation=steady(6000.0, whirl=[whirl])), tmp_path)  # 48 Hz
    assert failures(found) == set()


@pytest.mark.parametrize("faults", [{}, {"miswiring": "tacho silent"}])
def test_whirl_at_the_mains_frequency_is_a_warning(rig: RigFactory, tmp_path: Path, faults: dict[str, object]) -> None:
    whirl = {"order": 0.4762, "onset_rpm": 5000.0, "end_rpm": 8000.0, "amplitude_um": 20.0}  # of 105 Hz
    found = checked(rig(simulation=steady(6300.0, whirl=[whirl], speed_fluctuation=0.0) | faults), tmp_path)
    check = check_by_name(found.checks, "probe x mains hum")
    assert (check.verdict, check.finding) == (Verdict.WARN, Finding.HUM)
    assert "whirl" in check.advice


def test_advice_states_the_reading_and_the_input(rig: RigFactory, tmp_path: Path) -> None:
    found = checked(rig(simulation=steady(3000.0, miswiring="probe y open")), tmp_path)
    check = check_by_name(found.checks, "probe y gap")
    assert check.advice.startswith(f"probe y reads {check.value} ")
    assert "ai1" in check.advice


def test_planned_speed_above_the_limit_of_sensor_or_rig_fails(rig: RigFactory, tmp_path: Path) -> None:
    thin = {"mark_fraction": 0.1}
    bench = rig(tacho=thin, limits={"speed_rpm": 5900.0}, simulation=steady(3000.0))
    slow = checked(bench, tmp_path, speed=3000 * RPM)
    assert check_by_name(slow.checks, "tacho speed limit").verdict is Verdict.GOOD
    assert check_by_name(slow.checks, "tacho speed limit").limit == "6,000 r/min"
    fast = checked(bench, tmp_path, speed=7000 * RPM)
    assert failures(fast) == {("planned speed", Finding.SPEED), ("tacho speed limit", Finding.SPEED)}


def test_planned_run_must_fit_on_the_disk(rig: RigFactory) -> None:
    bench = rig()
    reserve = int(bench.config.storage.reserve_gb * 1e9)
    one_minute = 60 * 3 * 2 * 20_000
    assert disk_check(reserve + one_minute, bench, 20_000.0, 60.0).verdict is Verdict.GOOD
    assert disk_check(reserve + one_minute - 1, bench, 20_000.0, 60.0).verdict is Verdict.FAIL
    assert disk_check(reserve + one_minute, bench, 20_000.0, None).verdict is Verdict.WARN
    assert disk_check(reserve - 1, bench, 20_000.0, None).verdict is Verdict.FAIL


def test_planned_speed_up_to_the_limit_is_good(rig: RigFactory) -> None:
    bench = rig()
    assert planned_speed_check(bench, bench.limits.speed).verdict is Verdict.GOOD


def test_old_future_and_inaccurate_calibrations_give_warnings(rig: RigFactory) -> None:
    bench = rig(calibration={"date": "2025-11-20", "residual_um": 15.0, "sensor": ""})
    checks = tuple(calibration_checks(bench, TODAY))
    assert check_by_name(checks, "probe x calibration").value == "2025-11-20, 369 days old"
    assert "rig calibrate gap" in check_by_name(checks, "probe x calibration").advice
    assert {check.verdict for check in checks} == {Verdict.WARN}
    assert "enter them" in check_by_name(checks, SERIALS_CHECK).advice
    early = tuple(calibration_checks(bench, dt.date(2025, 11, 19)))
    assert "date is in the future" in check_by_name(early, "probe y calibration").advice


def test_limits_come_from_the_rig_file(rig: RigFactory, tmp_path: Path) -> None:
    humming = steady(1800.0, miswiring=Miswiring.HUM.value)
    hum = {"probe x mains hum", "probe y mains hum"}
    tolerant = rig(simulation=humming, preflight={"hum_fail_um": 500.0})
    assert failures(checked(tolerant, tmp_path)) == set()
    assert hum <= warnings(checked(tolerant, tmp_path))
    lenient_hum = checked(rig(simulation=humming, preflight={"hum_warn_um": 400.0, "hum_fail_um": 500.0}), tmp_path)
    assert not hum & warnings(lenient_hum)
    assert check_by_name(lenient_hum.checks, "probe x mains hum").limit == "400 µm peak at 50 or 60 Hz"
    jittery = steady(6000.0, tacho_jitter_us=300.0, tacho_rise_us=1.0)
    strict, lenient = ({"tacho_scatter_fraction": part} for part in (0.005, 0.2))
    assert "tacho pulses" in warnings(checked(rig(simulation=jittery, preflight=strict), tmp_path))
    assert "tacho pulses" not in warnings(checked(rig(simulation=jittery, preflight=lenient), tmp_path))
    other_mark = {"mark_fraction": 0.4}
    bench = rig(simulation=steady(6000.0), tacho=other_mark, preflight={"tacho_mark_tolerance_fraction": 0.02})
    assert check_by_name(checked(bench, tmp_path).checks, "tacho mark").limit == "40 ± 2 %"
    old = rig(
        calibration={"date": "2025-11-20", "residual_um": 15.0},
        preflight={"calibration_days": 400, "residual_fraction": 0.5},
    )
    checks = tuple(calibration_checks(old, TODAY))
    assert check_by_name(checks, "probe x calibration").verdict is Verdict.GOOD
    assert check_by_name(checks, "probe x fit").verdict is Verdict.GOOD
    room = int(old.config.storage.reserve_gb * 1e9) + 60 * 3 * 2 * 20_000
    assert disk_check(room, rig(preflight={"disk_duration_h": 0.01}), 20_000.0, None).verdict is Verdict.GOOD


def test_hum_warning_limit_above_the_failure_limit_is_refused(rig: RigFactory) -> None:
    with pytest.raises(ConfigError, match=r"preflight\.hum_warn_um = 6: expected at most hum_fail_um = 5"):
        rig(preflight={"hum_warn_um": 6.0})


def test_two_probes_with_one_calibration_record_give_a_warning(rig: RigFactory) -> None:
    bench = rig()
    assert check_by_name(tuple(calibration_checks(bench, TODAY)), SERIALS_CHECK).verdict is Verdict.WARN
    own = dict(bench.calibrations) | {"y": replace(bench.calibrations["y"], sensor="b", conditioner="c")}
    checks = tuple(calibration_checks(replace(bench, calibrations=own), TODAY))
    assert {check.verdict for check in checks} == {Verdict.GOOD}


def block(first: int, n: int, backlog: int = 0) -> SampleBlock:
    return SampleBlock(np.zeros((3, n), np.int16), 0, first, 0, backlog)


@pytest.mark.parametrize(
    ("blocks", "end"),
    [
        ([block(0, 50)], SegmentEnd(0, 50, EndReason.STOPPED)),
        ([block(0, 50), block(60, 50)], SegmentEnd(0, 110, EndReason.STOPPED)),
        ([block(0, 100)], SegmentEnd(0, 100, EndReason.OVERRUN, lost=7, detail="too late")),
        ([block(0, 100)], SegmentEnd(0, 99, EndReason.STOPPED)),
        ([block(0, 100)], None),
        ([], SegmentEnd(0, 0, EndReason.DEVICE_ERROR, lost_is_exact=False)),
    ],
    ids=["too few", "gap", "lost", "miscounted", "no end", "none"],
)
def test_incomplete_samples_fail(rig: RigFactory, blocks: list[SampleBlock], end: SegmentEnd | None) -> None:
    assert check_by_name(tuple(sample_checks(blocks, end, 100, rig())), "samples").finding is Finding.COUNT


def test_large_backlog_gives_a_warning(rig: RigFactory) -> None:
    late = [block(0, 100, backlog=11_000)]
    checks = tuple(sample_checks(late, SegmentEnd(0, 100, EndReason.STOPPED), 100, rig()))
    assert check_by_name(checks, "samples").verdict is Verdict.GOOD
    assert check_by_name(checks, "backlog").finding is Finding.BACKLOG


def test_command_prints_a_table_and_exits_with_0_or_4(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["preflight", str(rig_file(simulation=steady(2000.0)))]) == 0
    good = capsys.readouterr().out.splitlines()
    assert good[0].startswith("WARN  device  ")
    assert good[-1] == f"ready: {sum(line[:4] in ('PASS', 'WARN') for line in good)} checks, 2 warnings"
    assert main(["preflight", str(rig_file(simulation=steady(2000.0, miswiring="tacho silent")))]) == 4
    bad = capsys.readouterr().out
    assert "\nFAIL  tacho levels " in bad
    assert "\nNOT READY: 1 of " in bad


def test_command_prints_the_report_as_json(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> None:
    path = rig_file(simulation=steady(2000.0, miswiring="mains hum"))
    assert main(["preflight", str(path), "--for", "1min", "--speed", "12000", "--json"]) == 4
    document = PreflightSchema.model_validate_json(capsys.readouterr().out)
    assert document.verdict is Verdict.FAIL
    assert document.device is not None
    assert document.device.simulated
    assert {check.finding for check in document.checks if check.verdict is Verdict.FAIL} == {Finding.HUM}


def test_check_command_prints_the_configuration(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> None:
    path = rig_file()
    assert main(["check", str(path)]) == 0
    assert capsys.readouterr().out == (
        f"{path}: good\n"
        "  rig      test-rig on simulated USB-6251\n"
        "  inputs   x on ai0, y on ai1, tacho on ai2\n"
        "  rate     20 kS/s each, convert clock 90.91 kHz (11.00 µs between channels)\n"
        "  disk     at most 0.43 GB an hour\n"
    )


def test_check_command_reports_all_faults_as_text_and_json(
    rig_file: RigFiles, capsys: pytest.CaptureFixture[str]
) -> None:
    path = rig_file(timing={"rate_hz": -1.0}, calibration={"volts_low": 20.0})
    assert main(["check", str(path)]) == 2
    output = capsys.readouterr().err
    assert "timing.rate_hz = -1.0: expected more than 0" in output
    assert output.count("calibration.volts_low = 20") == 2
    assert main(["check", str(path), "--json"]) == 2
    document = json.loads(capsys.readouterr().out)
    assert not document["is_valid"]
    assert len(document["faults"]) == 3
    assert main(["check", str(rig_file()), "--json"]) == 0
    good = json.loads(capsys.readouterr().out)
    assert good["disk_bytes_per_hour"] == 20_000 * 3 * 2 * 3600
    assert [channel["physical"] for channel in good["channels"]] == ["ai0", "ai1", "ai2"]
