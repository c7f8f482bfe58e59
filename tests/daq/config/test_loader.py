"""Loading rig.toml: values in SI units, and all errors with key, value and expectation."""

import copy
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from analysis.signals.header import Role
from daq.config.loader import RENAMED_KEYS, load_rig, read_recorded_config
from daq.config.rig import Rig, model_parameters
from daq.config.schema import Backend
from daq.config.toml_files import dotted
from daq.errors import ConfigError
from tests.daq.support.rig_files import channels, faults_of

RIGS = Path(__file__).parents[3] / "rigs"
RigFiles = Callable[..., Path]
RigFactory = Callable[..., Rig]


@pytest.mark.parametrize("name", ["bench", "model", "usb6251"])
def test_load_rig_accepts_the_rig_files_of_the_repository(name: str) -> None:
    rig = load_rig(RIGS / f"{name}.toml")
    assert [channel.role for channel in rig.config.channel] == [Role.PROBE_X, Role.PROBE_Y, Role.TACHO]
    assert set(rig.calibrations) == {"x", "y"}


def test_load_rig_converts_to_si_units(rig: RigFactory) -> None:
    loaded = rig(tacho={"delay_s": 2e-4}, limits={"peak_to_peak_alarm_um": 50.0, "speed_rpm": 12_000.0})
    assert loaded.limits.peak_to_peak_alarm == pytest.approx(50e-6)
    assert loaded.limits.speed == pytest.approx(400 * math.pi)
    assert loaded.limits.order_1x_alarm == loaded.limits.below_1x_danger == loaded.limits.speed_danger == math.inf
    assert loaded.tacho.delay == pytest.approx(2e-4)
    assert loaded.calibrations["x"].coefficients == pytest.approx((12e-6, 96.5e-6, 0.55e-6, -0.03e-6))
    assert loaded.calibrations["x"].residual == pytest.approx(1.2e-6)
    assert loaded.calibrations["y"].sensor == "1U1-4711"


def test_optional_limits_are_converted_independently(rig: RigFactory) -> None:
    limits = rig(
        limits={
            "order_1x_peak_alarm_um": 30.0,
            "order_1x_peak_danger_um": 40.0,
            "below_1x_peak_danger_um": 25.0,
            "speed_alarm_rpm": 18_000.0,
        }
    ).limits
    assert (limits.order_1x_alarm, limits.order_1x_danger) == pytest.approx((30e-6, 40e-6))
    assert (limits.below_1x_alarm, limits.below_1x_danger) == pytest.approx((math.inf, 25e-6))
    assert (limits.speed_alarm, limits.speed_danger) == pytest.approx((600 * math.pi, math.inf))


def test_load_rig_reads_target_and_operator_of_a_calibration(rig: RigFactory) -> None:
    loaded = rig(calibration={"target": "42CrMo4", "operator": "M. Curie"})
    assert (loaded.calibrations["x"].target, loaded.calibrations["x"].operator) == ("42CrMo4", "M. Curie")


def test_rig_toml_holds_the_complete_configuration_and_reads_back(rig: RigFactory) -> None:
    loaded = rig(storage={"folder": 'C:\\runs "new"'})
    assert "deadline_s = 3.0" in loaded.toml  # a default; the file lacks the key
    assert read_recorded_config(loaded.toml, "a recording") == loaded.config


def test_read_recorded_config_names_the_recording() -> None:
    with pytest.raises(ConfigError) as caught:
        read_recorded_config("rig = 3", "run 7")
    assert caught.value.file == "run 7"
    assert any(fault.startswith("channel: missing") for fault in caught.value.faults)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("retry_s = 0.5", "retry_s = 0.001"),
        ("events = 1", "events = 3"),
        ('start = ""', 'start = "x > 4,5"'),
        ("latch = true", "latch = true\nof_another_version = 3"),
    ],
)
def test_recording_with_values_that_are_refused_today_stays_readable(rig: RigFactory, before: str, after: str) -> None:
    loaded = rig()
    assert before in loaded.toml
    read = read_recorded_config(loaded.toml.replace(before, after), "a recording")
    assert model_parameters(read) == model_parameters(loaded.config)


OLD_KEYS: list[tuple[str, dict[str, object], str]] = [
    ("tacho.counter.agreement_us", {"tacho": {"counter": {"agreement_us": 20.0}}}, "max_difference_us"),
    (
        "preflight.mark_tolerance_fraction",
        {"preflight": {"mark_tolerance_fraction": 0.2}},
        "tacho_mark_tolerance_fraction",
    ),
    ("preflight.disk_h", {"preflight": {"disk_h": 2.0}}, "disk_duration_h"),
    ("runout.orbit", {"runout": {"orbit": True}}, "correct_orbit"),
    ("storage.split_min", {"storage": {"split_min": 10.0}}, "split_minutes"),
]


def test_every_renamed_key_has_a_case_here() -> None:
    assert {(key, new) for key, _, new in OLD_KEYS} == {(dotted(path), new) for path, new in RENAMED_KEYS.items()}


@pytest.mark.parametrize(("key", "sections", "new"), OLD_KEYS)
def test_renamed_key_in_a_rig_file_is_refused_with_its_new_name(
    rig_file: RigFiles, key: str, sections: dict[str, dict[str, object]], new: str
) -> None:
    (fault,) = faults_of(rig_file(**sections))
    assert fault.startswith(f"{key} = ")
    assert fault.endswith(f": renamed to {new}")


@pytest.mark.parametrize(("key", "sections", "new"), OLD_KEYS)
def test_renamed_key_in_a_recording_is_translated(
    rig: RigFactory, key: str, sections: dict[str, dict[str, object]], new: str
) -> None:
    *tables, old = key.split(".")
    present, value = nested(sections, tables, old, new)
    text = rig(**present).toml
    assert f"\n{new} = " in text
    config: object = read_recorded_config(text.replace(f"\n{new} = ", f"\n{old} = "), "a recording")
    assert config == rig(**present).config
    for table in tables:
        config = getattr(config, table)
    assert getattr(config, new) == value


def nested(
    sections: dict[str, dict[str, object]], tables: list[str], old: str, new: str
) -> tuple[dict[str, dict[str, object]], object]:
    """Return sections with the key `old` renamed to `new`, and its value."""
    renamed = copy.deepcopy(sections)
    table: Any = renamed
    for name in tables:
        table = table[name]
    table[new] = table.pop(old)
    return renamed, table[new]


@pytest.mark.parametrize(("before", "after"), [('role = "probe_y"', 'role = "probe_x"'), ("[model]", "[model]\nx = 1")])
def test_recording_whose_probes_or_model_are_wrong_is_refused(rig: RigFactory, before: str, after: str) -> None:
    text = rig(model={"viscosity_pa_s": 0.02}).toml
    assert before in text
    with pytest.raises(ConfigError):
        read_recorded_config(text.replace(before, after), "a recording")


def test_model_parameters_follow_the_model_section_and_the_probes(rig: RigFactory) -> None:
    loaded = rig(model={"viscosity_pa_s": 0.02, "outer_clearance_um": 70.0})
    parameters = model_parameters(loaded.config)
    assert parameters.floating_ring.viscosity == 0.02
    assert parameters.floating_ring.outer_clearance == pytest.approx(70e-6)
    assert parameters.probe_angles == pytest.approx((math.pi / 4, 3 * math.pi / 4))


@pytest.mark.parametrize(
    ("section", "values", "fault"),
    [
        ("timing", {"rate_hz": "fast"}, 'timing.rate_hz = "fast": expected a number'),
        ("timing", {"rate_hz": -1.0}, "timing.rate_hz = -1.0: expected more than 0"),
        ("timing", {"rate_hz": True}, "timing.rate_hz = true: expected a number"),
        ("timing", {"block_s": 2.0}, "timing.block_s = 2.0: expected at most 1"),
        ("analysis", {"revolutions": 12.5}, "analysis.revolutions = 12.5: expected a whole number"),
        ("analysis", {"points_per_revolution": 65}, "analysis.points_per_revolution = 65: expected a multiple of 2"),
        ("analysis", {"window": "kaiser"}, "analysis.window = \"kaiser\": expected 'hann', 'flat top' or 'uniform'"),
        ("tacho", {"edge": "up"}, "tacho.edge = \"up\": expected 'rising' or 'falling'"),
        ("tacho", {"mark_fraction": 1.0}, "tacho.mark_fraction = 1.0: expected less than 1"),
        ("simulation", {"motion": "wild"}, "simulation.motion = \"wild\": expected 'model' or 'bench'"),
        ("simulation", {"gap_um": [500.0]}, "simulation.gap_um[1]: missing, expected a number"),
        ("timing", {"rate_hz": math.inf}, "timing.rate_hz = Infinity: expected a finite number"),
        ("storage", {"folder": 3}, "storage.folder = 3: expected a text in quotes"),
        ("device", {"serial": "A-17"}, 'device.serial = "A-17": expected the hexadecimal number printed on the card'),
        ("timing", {"rate_khz": 100}, "timing.rate_khz = 100: unknown key, did you mean rate_hz?"),
        ("timming", {"rate_hz": 100.0}, "timming = a table: unknown key, did you mean timing?"),
        (
            "storage",
            {"catalogue": "mysql://r"},
            'storage.catalogue = "mysql://r": expected an address as "postgresql+psycopg://user@host/name", or nothing',
        ),
        ("device", {"backend": "simulation"}, "device.backend = \"simulation\": expected 'nidaqmx' or 'simulated'"),
    ],
)
def test_load_rig_names_key_value_and_expectation(
    rig_file: RigFiles, section: str, values: dict[str, object], fault: str
) -> None:
    assert faults_of(rig_file(**{section: values})) == [fault]


def test_rate_beyond_the_card_is_reported_together_with_a_wrong_channel(rig_file: RigFiles) -> None:
    wrong = rig_file(timing={"rate_hz": 1e9}, channel=channels({"range_v": 11.0}, {}, {}))
    assert [fault.partition(" = ")[0] for fault in faults_of(wrong)] == ["channel[0].range_v", "timing.rate_hz"]


def test_load_rig_refuses_too_deeply_nested_toml(tmp_path: Path) -> None:
    path = tmp_path / "deep.toml"
    path.write_text(f"rig = {'[' * 5000}{']' * 5000}")
    assert faults_of(path) == ["not a rig's TOML: tables or lists are nested too deeply"]


def test_load_rig_lists_the_known_keys_if_none_is_similar(rig_file: RigFiles) -> None:
    (fault,) = faults_of(rig_file(storage={"xyz": 1}))
    assert (
        fault == "storage.xyz = 1: unknown key, expected one of folder, reserve_gb, split_gb, split_minutes, catalogue"
    )


@pytest.mark.parametrize(
    ("overrides", "fault"),
    [
        ({"timing": {"rate_hz": 400_000.0}}, "timing.rate_hz = 400000: expected at most 333333: the USB-6251 shares"),
        ({"timing": {"rate_hz": 5_000.0}}, "timing.rate_hz = 5000: expected more than 5333: twice the frequency of"),
        ({"timing": {"buffer_s": 1.0, "block_s": 0.5}}, "timing.block_s = 0.5: expected at most a quarter of buffer_s"),
        ({"limits": {"peak_to_peak_alarm_um": 96.0}}, "limits.peak_to_peak_alarm_um = 96: expected at most peak_to"),
        ({"limits": {"clearance_um": 40.0}}, "limits.peak_to_peak_danger_um = 95: expected at most 80, twice"),
        (
            {"limits": {"order_1x_peak_alarm_um": 41.0, "order_1x_peak_danger_um": 40.0}},
            "limits.order_1x_peak_alarm_um = 41: expected at most order_1x_peak_danger_um = 40",
        ),
        (
            {"limits": {"below_1x_peak_danger_um": 101.0}},
            "limits.below_1x_peak_danger_um = 101: expected at most 100, clearance_um: the shaft cannot move further",
        ),
        (
            {"limits": {"speed_danger_rpm": 20_001.0}},
            "limits.speed_danger_rpm = 20001: expected at most 20000, speed_rpm: the highest speed of the rig",
        ),
        ({"limits": {"speed_rpm": 31_000.0}}, "limits.speed_rpm = 31000: expected at most 30000: light and dark must"),
        ({"tacho": {"mark_fraction": 0.1}}, "limits.speed_rpm = 20000: expected at most 6000: light and dark must"),
        ({"tacho": {"threshold_v": 9.8}}, "tacho.threshold_v = 9.8: expected both switching levels, 9.3 and 10.3 V,"),
        ({"tacho": {"hysteresis_v": 5.0}}, "simulation.tacho_high_v = 4.2: expected more than 4.65"),
        (
            {"timing": {"rate_hz": 100.0, "block_s": 0.005}, "limits": {"speed_rpm": 10.0}},
            "timing.block_s = 0.005: expected at least one sample",
        ),
        (
            {"timing": {"rate_hz": 6_000.0}, "tacho": {"mark_fraction": 0.1, "response_time_s": 0.0}},
            "timing.rate_hz = 6000: expected at least 13333: 4 samples of the tacho's light and dark at full speed",
        ),
        (
            {"storage": {"split_minutes": 1e-4}},
            "storage.split_minutes = 0.0001: expected 0 for never, or at least 0.01",
        ),
        ({"storage": {"split_gb": 1e-4}}, "storage.split_gb = 0.0001: expected 0 for never, or at least 0.001"),
        ({"model": {"imbalance_kg_m": 1.0}}, "model: imbalance: 1 kg m at station 5, expected at most 1.85e-05 kg m"),
        (
            {"analysis": {"revolutions": 8, "window": "flat top"}},
            "analysis.revolutions = 8: expected at least 10 for the window flat top",
        ),
        ({"analysis": {"points_per_revolution": 16}}, "analysis.highest_order = 8: expected less than half of points"),
    ],
)
def test_load_rig_reports_contradictions(rig_file: RigFiles, overrides: dict[str, object], fault: str) -> None:
    assert any(found.startswith(fault) for found in faults_of(rig_file(**overrides)))


@pytest.mark.parametrize(
    ("x", "y", "tacho", "fault"),
    [
        ({}, {"role": "probe_x"}, {}, "channel: 2 channels have the role probe_x, expected exactly one"),
        ({}, {"name": "x"}, {}, "channel[1].name = x: expected a unique name, channel[0] has this one"),
        ({}, {}, {"physical": "ai1"}, "channel[2].physical = ai1: expected a free input, channel[1] uses ai1"),
        ({}, {"physical": "ai8"}, {}, "channel[1].physical = ai8: expected ai0 to ai7 for a differential input"),
        (
            {},
            {},
            {"physical": "ai8", "terminal": "rse"},
            "channel[2].physical = ai8: expected a free input, channel[0] uses ai8",
        ),
        ({}, {"angle_deg": 222.0}, {}, "channel[1].angle_deg = 222: expected at least 10 degrees from the line of 'x'"),
        ({"gap_window_v": [6.0, 5.0]}, {}, {}, "channel[0].gap_window_v = [6, 5]: expected the lower voltage first"),
        ({"range_v": 5.0}, {}, {}, "channel[0].gap_window_v = [1, 9]: expected voltages within the range of ±5 V"),
        (
            {"gap_window_v": [0.1, 9.0]},
            {},
            {},
            "channel[0].gap_window_v = [0.1, 9]: expected voltages in the calibrated",
        ),
        ({"calibration": ""}, {}, {}, "channel[0].calibration: missing, expected a file for a probe"),
        ({}, {}, {"calibration": "probe-x.toml"}, 'channel[2].calibration = "probe-x.toml": expected none for a tacho'),
        (
            {},
            {},
            {"range_v": 3.0},
            "channel[2].range_v = 3: expected one of 0.1, 0.2, 0.5, 1, 2, 5, 10, the ranges of the USB-6251",
        ),
        ({"physical": "a0"}, {}, {}, 'channel[0].physical = "a0": expected an input of the card, as "ai0"'),
    ],
)
def test_load_rig_checks_the_channels(
    rig_file: RigFiles, x: dict[str, object], y: dict[str, object], tacho: dict[str, object], fault: str
) -> None:
    assert any(found.startswith(fault) for found in faults_of(rig_file(channel=channels(x, y, tacho))))


def test_load_rig_requires_the_tacho_as_the_last_channel(rig_file: RigFiles) -> None:
    x, y, tacho = channels({}, {}, {})
    (fault,) = faults_of(rig_file(channel=[x, tacho, y]))
    assert fault.startswith("channel[1].role = tacho: expected the tacho as the last channel")


def test_load_rig_checks_the_simulated_profile_and_whirls(rig_file: RigFiles) -> None:
    profile = [{"time_s": float(t), "speed_rpm": 3000.0} for t in (1, 2, 2)]
    whirl = [{"order": 0.5, "onset_rpm": 5000.0, "end_rpm": 4000.0, "amplitude_um": 5.0}]
    faults = faults_of(rig_file(simulation={"profile": profile, "whirl": whirl}))
    assert faults == [
        "simulation.profile: expected at least two points, the first at time_s = 0",
        "simulation.profile[2].time_s = 2: expected more than 2, the time before it",
        "simulation.whirl[0].end_rpm = 4000: expected more than onset_rpm = 5000",
    ]


def test_load_rig_checks_that_the_tacho_follows_the_simulated_profile(rig_file: RigFiles) -> None:
    profile = [{"time_s": 0.0, "speed_rpm": 3e3}, {"time_s": 2.0, "speed_rpm": 33e3}]
    (fault,) = faults_of(rig_file(simulation={"profile": profile}))
    assert fault.startswith("simulation.profile[1].speed_rpm = 33000: expected at most 30000: light and dark must both")


def test_load_rig_does_not_check_the_simulation_for_the_real_card(rig_file: RigFiles) -> None:
    rig = load_rig(rig_file(device={"backend": "nidaqmx"}, simulation={"tacho_high_v": 1.0}))
    assert rig.config.device.backend is Backend.NIDAQMX


def test_load_rig_reports_all_errors_together(rig_file: RigFiles) -> None:
    path = rig_file(
        timing={"rate_khz": 100, "block_s": "fast"},
        limits={"peak_to_peak_alarm_um": 200.0, "speed_rpm": 40_000.0},
        simulation={"whirl": [{"order": 0.5, "end_rpm": 4000.0, "amplitude_um": 5.0}]},
        channel=channels({"range_v": 11.0}, {"role": "probe_z", "calibration": "none.toml"}, {}),
        calibration={"volts_low": "low"},
    )
    assert [fault.split(":")[0] for fault in faults_of(path)] == [
        'timing.block_s = "fast"',
        "timing.rate_khz = 100",
        'channel[1].role = "probe_z"',
        "simulation.whirl[0].onset_rpm",
        "limits.speed_rpm = 40000",
        "limits.peak_to_peak_alarm_um = 200",
        "channel[0].range_v = 11",
        'channel[0].calibration = "probe-x.toml"',
        'channel[1].calibration = "none.toml"',
    ]


def test_load_rig_checks_the_rest_of_a_table_that_lacks_a_key(rig_file: RigFiles) -> None:
    wired = channels({}, {}, {"physical": "ai0"})
    del wired[1]["role"]
    whirls = [
        {"order": 0.5, "end_rpm": 4e3, "amplitude_um": 5.0},
        {"onset_rpm": 5e3, "end_rpm": 4e3, "amplitude_um": 5.0},
    ]
    assert faults_of(rig_file(channel=wired, simulation={"whirl": whirls})) == [
        "channel[1].role: missing, expected 'probe_x' or 'probe_y' or 'tacho'",
        "simulation.whirl[0].onset_rpm: missing, expected a number",
        "simulation.whirl[1].order: missing, expected a number",
        "simulation.whirl[1].end_rpm = 4000: expected more than onset_rpm = 5000",
        "channel[2].physical = ai0: expected a free input, channel[0] uses ai0",
    ]


def test_load_rig_reports_a_channel_that_is_not_a_table(rig_file: RigFiles) -> None:
    faults = faults_of(rig_file(channel=["x", *channels({}, {}, {})]))
    assert faults == ['channel[0] = "x": expected a table']


def test_load_rig_does_not_report_consequences_of_a_wrong_value(rig_file: RigFiles) -> None:
    """The danger limit is wrong. Its default replaces it, but a contradiction with the default is not reported."""
    faults = faults_of(rig_file(limits={"peak_to_peak_alarm_um": 120.0, "peak_to_peak_danger_um": "150"}))
    assert faults == ['limits.peak_to_peak_danger_um = "150": expected a number']


def test_load_rig_names_the_line_of_a_toml_error(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text('rig = "gj90c"\n[timing]\nrate_hz 100\n', encoding="utf-8")
    (fault,) = faults_of(path)
    assert fault.startswith("not TOML:")
    assert "line 3" in fault


def test_load_rig_reports_a_missing_file(tmp_path: Path) -> None:
    assert faults_of(tmp_path / "nowhere.toml") == ["no such file"]


def test_load_rig_reports_a_folder(tmp_path: Path) -> None:
    (fault,) = faults_of(tmp_path)
    assert fault.endswith("expected a TOML file")


def test_load_rig_reads_a_file_with_a_byte_order_mark(rig_file: RigFiles) -> None:
    path = rig_file()
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert load_rig(path).config.rig == "test-rig"


def test_load_rig_reports_a_file_that_is_not_utf_8(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_bytes(b"\xff\xfe\x00")
    assert faults_of(path) == ["byte 0 is not UTF-8: expected a TOML text file"]


def test_load_rig_reports_single_brackets_around_channel(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text('[channel]\nname = "x"\n', encoding="utf-8")
    assert faults_of(path) == ["channel = a table: expected tables: [[channel]]"]


@pytest.mark.parametrize(
    ("record", "fault"),
    [
        ({"volts_low": None}, "calibration.volts_low: missing, expected a number"),
        ({"volts_low": 9.9}, "calibration.volts_low = 9.9: expected less than volts_high = 9.8"),
        ({"coefficients_um": [1.0]}, "calibration.coefficients_um = [1.0]: expected 2 values, there are 1"),
        ({"coefficients_um": [1000.0, -100.0]}, "calibration.coefficients_um = [1000.0, -100.0]: expected a gap that"),
        ({"date": "yesterday"}, 'calibration.date = "yesterday": expected a date like "2026-11-24"'),
        ({"residual": 1.0}, "calibration.residual = 1.0: unknown key, did you mean residual_um?"),
    ],
)
def test_load_rig_names_channel_file_and_key_of_a_wrong_calibration(
    rig_file: RigFiles, record: dict[str, object], fault: str
) -> None:
    x, y = faults_of(rig_file(calibration=record))
    assert x.startswith(f'channel[0].calibration = "probe-x.toml": {fault}')
    assert y.startswith(f'channel[1].calibration = "probe-y.toml": {fault}')


def test_load_rig_reports_a_missing_calibration(rig_file: RigFiles) -> None:
    (fault,) = faults_of(rig_file(channel=channels({"calibration": "gone.toml"}, {}, {})))
    assert fault == 'channel[0].calibration = "gone.toml": no such file'


def test_load_rig_reports_a_calibration_point_far_from_its_polynomial(rig_file: RigFiles) -> None:
    path = rig_file()
    with (path.parent / "probe-x.toml").open("a", encoding="utf-8") as record:
        record.write("\n[[point]]\ngap_um = 500.0\nvolts = 6.0\n")
    (fault,) = faults_of(path)
    assert "point[0] = 500 µm at 6 V: expected within 1.2 µm of the polynomial" in fault
