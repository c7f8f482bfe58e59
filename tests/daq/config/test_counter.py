"""`[tacho.counter]`: its defaults, its checks and the output of `rig check`."""

import pytest

from analysis.signals.header import Edge
from daq.cli.main import main
from daq.config.loader import load_rig, read_recorded_config
from tests.daq.conftest import RigFactory, RigFiles
from tests.daq.support.rig_files import faults_of

Captured = pytest.CaptureFixture[str]


def test_rig_without_the_table_has_no_counter(rig: RigFactory) -> None:
    assert rig().tacho.counter is None
    assert rig().tacho.reference == "samples"


def test_empty_counter_table_uses_the_defaults_and_the_tachos_edge(rig: RigFactory) -> None:
    counter = rig(tacho={"edge": "falling", "counter": {}}).tacho.counter
    assert counter is not None
    assert (counter.counter, counter.terminal, counter.edge) == ("ctr0", "PFI0", Edge.FALLING)
    assert counter.timebase == 80e6
    assert counter.max_difference == pytest.approx(50e-6)
    assert not counter.is_reference


def test_edge_at_the_line_may_differ_from_the_tachos(rig: RigFactory) -> None:
    counter = rig(tacho={"edge": "falling", "counter": {"edge": "rising"}}).tacho.counter
    assert counter is not None
    assert counter.edge is Edge.RISING


def test_recorded_configuration_contains_the_counter(rig: RigFactory) -> None:
    loaded = rig(tacho={"counter": {"reference": "counter", "terminal": "PFI9"}})
    assert "[tacho.counter]" in loaded.toml
    assert read_recorded_config(loaded.toml, "a recording") == loaded.config


@pytest.mark.parametrize(
    ("counter", "fault"),
    [
        (
            {"counter": "ctr2"},
            'tacho.counter.counter = "ctr2": expected one of ctr0, ctr1, the counters of the USB-6251',
        ),
        ({"counter": "gpctr0"}, 'tacho.counter.counter = "gpctr0": expected a counter of the card, as "ctr0"'),
        (
            {"terminal": "PFI16"},
            'tacho.counter.terminal = "PFI16": expected PFI0 to PFI15, the input lines of the USB-6251',
        ),
        ({"terminal": "ai0"}, 'tacho.counter.terminal = "ai0": expected a line of the card, as "PFI0"'),
        (
            {"timebase_hz": 1e6},
            "tacho.counter.timebase_hz = 1e+06: expected one of 80000000, 20000000, 100000, the clocks of the USB-6251",
        ),
        (
            {"reference": "both"},
            "tacho.counter.reference = \"both\": expected 'samples' or 'counter'",
        ),
        ({"max_difference_us": 0}, "tacho.counter.max_difference_us = 0: expected more than 0"),
        ({"teminal": "PFI0"}, 'tacho.counter.teminal = "PFI0": unknown key, did you mean terminal?'),
    ],
)
def test_counter_error_names_the_expected_value(rig_file: RigFiles, counter: dict[str, object], fault: str) -> None:
    assert faults_of(rig_file(tacho={"counter": counter})) == [fault]


def test_buffer_must_be_shorter_than_the_count_of_32_bits(rig_file: RigFiles) -> None:
    timing = {"rate_hz": 20_000.0, "block_s": 0.1, "buffer_s": 50.0}
    expected = "timing.buffer_s = 50: expected at most 43.7: a 32-bit count wraps every 53.7 s"
    assert faults_of(rig_file(timing=timing, tacho={"counter": {}})) == [expected]
    load_rig(rig_file(timing=timing, tacho={"counter": {"timebase_hz": 20e6}}))


def test_simulated_tacho_must_cross_the_levels_of_the_line(rig_file: RigFiles) -> None:
    (fault,) = faults_of(
        rig_file(
            tacho={"threshold_v": 1.2, "hysteresis_v": 0.5, "counter": {}},
            simulation={"tacho_high_v": 2.0},
        )
    )
    assert (
        fault == "simulation.tacho_high_v = 2: expected at least 2.2, and tacho_low_v at most 0.8: the levels of PFI0"
    )


def test_check_command_reports_the_source_of_the_speed(rig_file: RigFiles, capsys: Captured) -> None:
    assert main(["check", str(rig_file(tacho={"counter": {"reference": "counter"}}))]) == 0
    output = capsys.readouterr().out
    assert "edges timestamped by ctr0 on PFI0 to 12.5 ns; speed and phase from the counter" in output
    assert main(["check", "--json", str(rig_file(tacho={"counter": None}))]) == 0
    assert '"counter_resolution_ns": null' in capsys.readouterr().out
