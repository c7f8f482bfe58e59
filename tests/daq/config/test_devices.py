"""Known cards: their limits, and rigs checked against them."""

import numpy as np
import pytest

from analysis.signals.header import CODE_MAX
from daq.cli.main import main
from daq.config.devices import DEVICES, DeviceSpec, device_spec
from daq.config.loader import load_rig, read_recorded_config
from daq.drivers.simulation.card import SimulatedCard
from tests.daq.conftest import RigFactory, RigFiles
from tests.daq.support.rig_files import channels, faults_of

FAST: dict[str, object] = {"block_s": 0.1, "buffer_s": 2.0}


@pytest.mark.parametrize("spec", DEVICES.values(), ids=DEVICES)
def test_figures_of_a_card_are_consistent(spec: DeviceSpec) -> None:
    assert 1 << (spec.resolution - 1) == CODE_MAX + 1  # recordings hold int16 codes that clip at their ends
    assert list(spec.input_ranges) == sorted(spec.input_ranges)
    assert spec.aggregate_rate <= spec.single_channel_rate == spec.max_total_rate(1)
    assert spec.max_total_rate(3) == spec.aggregate_rate
    assert spec.single_ended_inputs == 2 * spec.differential_inputs
    assert spec.counter_wrap == 2**32
    assert list(spec.counter_timebases) == sorted(spec.counter_timebases, reverse=True)


def test_unknown_card_is_refused_with_the_known_ones(rig_file: RigFiles, capsys: pytest.CaptureFixture[str]) -> None:
    path = rig_file(device={"product": "PCI-6221"})
    fault = (
        'device.product = "PCI-6221": expected one of USB-6251, USB-6211, PCIe-6321, the cards whose limits are known'
    )
    assert faults_of(path) == [fault]
    assert main(["check", str(path)]) == 2
    assert fault in capsys.readouterr().err
    with pytest.raises(ValueError, match="PCI-6221"):
        device_spec("PCI-6221")


def test_wrong_type_of_product_gives_no_consequent_errors(rig_file: RigFiles) -> None:
    path = rig_file(device={"product": 6251}, channel=channels({}, {}, {"range_v": 3.0}), timing={"rate_hz": 1e6})
    assert [fault.partition(" = ")[0] for fault in faults_of(path)] == ["device.product"]


def test_recording_of_an_unknown_card_or_range_stays_readable(rig: RigFactory) -> None:
    text = (
        rig().toml.replace('product = "USB-6251"', 'product = "PXI-4461"').replace("range_v = 10.0", "range_v = 12.5")
    )
    config = read_recorded_config(text, "a recording")
    assert (config.device.product, config.channel[0].range_v) == ("PXI-4461", 12.5)


@pytest.mark.parametrize("product", ["USB-6211", "PCIe-6321"])
def test_aggregate_rate_of_the_card_limits_the_sample_rate(rig_file: RigFiles, product: str) -> None:
    (fault,) = faults_of(rig_file(device={"product": product}, timing=FAST | {"rate_hz": 100_000.0}))
    assert fault == (
        f"timing.rate_hz = 100000: expected at most 83333: the {product} shares 250,000 Hz among 3 channels"
    )
    load_rig(rig_file(timing=FAST | {"rate_hz": 100_000.0}))  # of a USB-6251


@pytest.mark.parametrize("product", ["USB-6211", "PCIe-6321"])
def test_card_is_simulated_within_its_aggregate_rate(rig: RigFactory, product: str) -> None:
    bench = rig(device={"product": product}, timing=FAST | {"rate_hz": 80_000.0})
    card = SimulatedCard(bench)
    assert card.acquisition.device.product == product
    assert card.acquisition.rate == 80_000.0
    assert 3 * 80_000.0 <= card.acquisition.convert_rate <= 250_000.0
    codes = card.next_codes(8000)
    assert codes.shape == (3, 8000)
    for channel, row in zip(card.acquisition.channels[:2], codes[:2], strict=True):
        assert channel.gap_low < float(np.mean(channel.volts(row))) < channel.gap_high


@pytest.mark.parametrize("product", ["USB-6211", "PCIe-6321"])
def test_range_that_the_card_lacks_is_refused(rig_file: RigFiles, product: str) -> None:
    tacho: dict[str, object] = {"range_v": 2.0}
    low = {"tacho": {"threshold_v": 1.0, "hysteresis_v": 0.5}}
    (fault,) = faults_of(rig_file(device={"product": product}, channel=channels({}, {}, tacho), **low))
    assert fault == f"channel[2].range_v = 2: expected one of 0.2, 1, 5, 10, the ranges of the {product}"
    load_rig(rig_file(channel=channels({}, {}, tacho), **low))  # of a USB-6251


@pytest.mark.parametrize(
    ("product", "counter", "fault"),
    [
        ("USB-6211", {"counter": "ctr2"}, "tacho.counter.counter"),
        ("USB-6211", {"terminal": "PFI4"}, "tacho.counter.terminal"),
        ("USB-6211", {"timebase_hz": 100e6}, "tacho.counter.timebase_hz"),
        ("PCIe-6321", {"counter": "ctr4"}, "tacho.counter.counter"),
        ("PCIe-6321", {"terminal": "PFI16"}, "tacho.counter.terminal"),
        ("PCIe-6321", {"timebase_hz": 80e6}, "tacho.counter.timebase_hz"),
    ],
)
def test_counter_line_and_clock_must_be_those_of_the_card(
    rig_file: RigFiles, product: str, counter: dict[str, object], fault: str
) -> None:
    (found,) = faults_of(rig_file(device={"product": product}, tacho={"counter": counter}))
    assert found.startswith(f"{fault} = ")
    assert found.endswith(f"of the {product}")


@pytest.mark.parametrize(
    ("product", "counter", "timebase"),
    [("USB-6211", {"terminal": "PFI3"}, 80e6), ("PCIe-6321", {"counter": "ctr3"}, 100e6)],
)
def test_counter_counts_the_fastest_clock_of_the_card(
    rig: RigFactory, product: str, counter: dict[str, object], timebase: float
) -> None:
    loaded = rig(device={"product": product}, tacho={"counter": counter})
    assert loaded.tacho.counter is not None
    assert loaded.tacho.counter.timebase == timebase
    card = SimulatedCard(loaded)
    seconds = np.diff(card.ticks(0, 20_000)) / timebase
    np.testing.assert_allclose(seconds, 0.01, rtol=0.05)  # 6,000 r/min


@pytest.mark.parametrize(
    ("product", "rate", "channels", "expected"),
    [
        ("USB-6251", 1e3, 3, 1 / 11e-6),
        ("USB-6251", 250e3, 4, 1e6),
        ("USB-6251", 100e3, 2, 2e5),
        ("USB-6211", 1e3, 3, 1 / 14e-6),
        ("USB-6211", 80e3, 3, 20e6 / 83),
        ("PCIe-6321", 1e3, 3, 1 / 14e-6),
        ("PCIe-6321", 80e3, 3, 100e6 / 416),
    ],
)
def test_convert_clock_is_padded_if_the_sample_interval_allows_it(
    product: str, rate: float, channels: int, expected: float
) -> None:
    assert DEVICES[product].convert_rate(rate, channels) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("product", "expected"), [("USB-6251", 20e6 / 667), ("USB-6211", 20e6 / 667), ("PCIe-6321", 100e6 / 3333)]
)
def test_rate_is_coerced_to_the_timebase_of_the_card(product: str, expected: float) -> None:
    assert DEVICES[product].coerced_rate(30e3) == expected
