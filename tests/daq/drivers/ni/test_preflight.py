"""Preflight and the devices command with the real client at a device server."""

import datetime as dt
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from analysis.preflight.check_result import Finding, Verdict
from analysis.signals.header import Calibration
from daq.cli.main import main
from daq.config.rig import Rig
from daq.schemas.checks import preflight_schema
from daq.session.preflight import PlannedRun, PreflightReport, run_preflight_checks
from tests.daq.support.device_server import DeviceServer
from tests.daq.support.ni_bench import bench

CALIBRATION = Calibration((0.0, 1e-4), 0.0, 10.0, residual=1e-6, sensor="a", conditioner="b", date="2026-11-20")


def ready(server: DeviceServer, **device: Any) -> Rig:
    rig = bench(server.target, **device)
    other = replace(CALIBRATION, sensor="c", conditioner="d")
    return replace(rig, calibrations={"x": CALIBRATION, "y": other})


def looked_at(rig: Rig, folder: Path) -> PreflightReport:
    return run_preflight_checks(rig, PlannedRun(folder, 10.0), dt.date(2026, 11, 24), lambda _text: None)


def test_preflight_tests_the_card_before_it_acquires_and_leaves_nothing_reserved(
    server: DeviceServer, tmp_path: Path
) -> None:
    found = looked_at(ready(server, serial="1A2B3C"), tmp_path)
    checks = {check.name: check for check in found.checks}
    assert checks["self-test"].verdict is Verdict.GOOD
    assert server.log.index("SelfTestDevice") < server.log.index("CreateTask")
    assert checks["device serial"].value == "1A2B3C"
    assert checks["samples"].verdict is Verdict.GOOD
    assert {check.name for check in found.checks if check.verdict is Verdict.FAIL} == set()
    assert server.tasks == []


def test_card_found_by_name_alone_gives_a_warning(server: DeviceServer, tmp_path: Path) -> None:
    (check,) = (check for check in looked_at(ready(server), tmp_path).checks if check.name == "device serial")
    assert check.finding is Finding.SERIAL
    assert 'serial = "1A2B3C"' in check.advice


def test_samples_lost_in_the_capture_fail(server: DeviceServer, tmp_path: Path) -> None:
    server.faults["ReadBinaryI16"].extend([0, 0, -200279])
    (check,) = (check for check in looked_at(ready(server), tmp_path).checks if check.name == "samples")
    assert check.finding is Finding.COUNT
    assert "fetched fast enough" in check.advice
    assert server.tasks == []


@pytest.mark.parametrize(
    ("day", "verdict"),
    [(dt.date(2026, 11, 2), Verdict.GOOD), (dt.date(2025, 11, 23), Verdict.WARN), (None, None)],
)
def test_old_self_calibration_gives_a_warning(
    server: DeviceServer, tmp_path: Path, day: dt.date | None, verdict: Verdict | None
) -> None:
    server.driver.self_calibrated = day
    checks = {check.name: check for check in looked_at(ready(server), tmp_path).checks}
    assert checks["self-test"].verdict is Verdict.GOOD
    found = checks.get("card self-calibration")
    assert (None if found is None else found.verdict) is verdict


@pytest.mark.filterwarnings("always::nidaqmx.errors.DaqWarning")
def test_driver_warnings_are_reported(server: DeviceServer, tmp_path: Path) -> None:
    server.driver.warning = 200036
    found = looked_at(ready(server), tmp_path)
    (check,) = (check for check in found.checks if check.name == "driver")
    assert (check.verdict, check.finding) == (Verdict.WARN, Finding.DRIVER_WARNING)
    warning = "the driver warns: the driver's text of 200036, over two lines (driver code 200036)"
    assert check.advice == warning
    assert [check.verdict for check in found.checks if check.name == "samples"] == [Verdict.GOOD]


@pytest.mark.parametrize(
    ("harm", "finding", "advice"),
    [
        ({"passes_self_test": False}, Finding.MISSING, "check its supply and its USB cable"),
        ({"held_elsewhere": True}, Finding.BUSY, "another program holds the card"),
        ({"devices": {}}, Finding.MISSING, "no USB-6251 with name Dev1 is connected"),
    ],
)
def test_card_without_samples_is_a_failed_check_and_the_other_checks_run(
    server: DeviceServer, tmp_path: Path, harm: dict[str, object], finding: Finding, advice: str
) -> None:
    for name, value in harm.items():
        setattr(server.driver, name, value)
    found = looked_at(ready(server), tmp_path)
    (check,) = (check for check in found.checks if check.verdict is Verdict.FAIL)
    assert (check.name, check.finding) == ("device", finding)
    assert advice in check.advice
    assert found.device_error is not None
    assert found.device_error.exit_code == 3
    assert {"planned speed", "probe x calibration", "disk"} <= {check.name for check in found.checks}
    assert preflight_schema("gj90c", found).device is None
    assert server.tasks == []


def test_failed_self_test_is_reported_as_such(server: DeviceServer, tmp_path: Path) -> None:
    server.faults["SelfTestDevice"].append(-200545)
    found = looked_at(ready(server), tmp_path)
    (check,) = (check for check in found.checks if check.verdict is Verdict.FAIL)
    assert (check.name, check.value) == ("self-test", "failed")
    assert "-200545" in check.advice


def test_devices_command_lists_the_devices(server: DeviceServer, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["devices", "--target", server.target]) == 0
    head, first, _ = capsys.readouterr().out.splitlines()
    assert head == f"NI-DAQmx 24.5.1 at device server {server.target}"
    assert first.split()[:2] == ["Dev1", "USB-6251"]
    assert "1A2B3C" in first
    assert main(["devices", "--target", server.target, "--json"]) == 0
    assert [device["busy"] for device in json.loads(capsys.readouterr().out)] == [False, False]
    server.driver.devices = {}
    assert main(["devices", "--target", server.target]) == 0
    assert "no device connected" in capsys.readouterr().out


def test_devices_command_without_the_driver_exits_with_3(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["devices"]) == 3
    assert "install NI-DAQmx" in capsys.readouterr().err


def test_devices_command_with_an_invalid_address_is_a_usage_error(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["devices", "--target", "bench-pc"])
    assert caught.value.code == 2
    assert "expected an address as host:port" in capsys.readouterr().err
