"""The simulated card: its codes show the configured bench."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.live.analyser import Analyser
from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import CODE_MAX, Role
from analysis.signals.units import RPM
from daq.config.rig import Rig, model_parameters
from daq.drivers.simulation.card import SimulatedCard
from model.dynamics.synchronous import synchronous_response

FloatArray = NDArray[np.float64]
RigFactory = Callable[..., Rig]

SPEED = 6000.0  # r/min, of the rig that the fixture writes
QUIET: dict[str, object] = {
    "speed_fluctuation": 0.0,
    "glitches_per_s": 0.0,
    "sensor_noise_um": 0.0,
    "tacho_jitter_us": 0.0,
    "tacho_noise_v": 0.0,
}


def steady(seconds: float, speed_rpm: float = SPEED) -> list[dict[str, float]]:
    """Return a profile at constant speed."""
    return [{"time_s": 0.0, "speed_rpm": speed_rpm}, {"time_s": seconds, "speed_rpm": speed_rpm}]


def taken(card: SimulatedCard, *portions: int) -> NDArray[np.int16]:
    """Return a card's whole run, read in blocks of these sizes in turn."""
    parts: list[NDArray[np.int16]] = []
    while not parts or parts[-1].shape[1]:
        parts.append(card.next_codes(portions[len(parts) % len(portions)]))
    return np.concatenate(parts, axis=1)


def displacements(card: SimulatedCard, codes: NDArray[np.int16]) -> FloatArray:
    """Return the displacement towards x and y, m."""
    rows = [card.acquisition.row(role) for role in (Role.PROBE_X, Role.PROBE_Y)]
    return np.stack([card.acquisition.channels[row].displacement(codes[row]) for row in rows])


def lines(card: SimulatedCard, displacement: FloatArray, orders: list[float]) -> NDArray[np.complex128]:
    """Return the vectors of orders, (n_orders, 2), m peak, fitted to the true angle at channel 0's sample times."""
    time = np.arange(displacement.shape[1]) / card.acquisition.rate
    angle, _ = card.speed_profile.angle_and_speed(time)
    columns = [np.ones_like(angle)] + [wave(order * angle) for order in orders for wave in (np.cos, np.sin)]
    fitted = np.linalg.lstsq(np.stack(columns, axis=1), displacement.T)[0]
    return np.asarray(fitted[1::2] - 1j * fitted[2::2])


def crossings(card: SimulatedCard, codes: NDArray[np.int16], *, rising: bool = True) -> FloatArray:
    """Return the times at which the tacho's voltage crosses its threshold, s, interpolated."""
    row = card.acquisition.row(Role.TACHO)
    volts = card.acquisition.channels[row].volts(codes[row]) - card.acquisition.tacho.threshold
    volts = volts if rising else -volts
    before = np.flatnonzero((volts[:-1] < 0) & (volts[1:] >= 0))
    part = -volts[before] / (volts[before + 1] - volts[before])
    return np.asarray((before + part) / card.acquisition.rate + row / card.acquisition.convert_rate)


def test_codes_do_not_depend_on_the_block_size(rig: RigFactory) -> None:
    bench = rig()
    whole = taken(SimulatedCard(bench), 1_000_000)
    assert whole.shape == (3, 40_000)
    np.testing.assert_array_equal(taken(SimulatedCard(bench), 777), whole)
    np.testing.assert_array_equal(taken(SimulatedCard(bench), 1, 8192, 20_000), whole)


def test_same_seed_gives_the_same_codes(rig: RigFactory) -> None:
    first, second = (SimulatedCard(rig(simulation={"seed": 7})).next_codes(4000) for _ in range(2))
    other = SimulatedCard(rig(simulation={"seed": 8})).next_codes(4000)
    np.testing.assert_array_equal(first, second)
    assert np.mean(first != other) > 0.5


def test_run_ends_with_the_profile(rig: RigFactory) -> None:
    card = SimulatedCard(rig(simulation={"profile": steady(0.5)}))
    assert card.n_samples == 10_000
    assert card.next_codes(9_000).shape == (3, 9_000)
    assert card.next_codes(9_000).shape == (3, 1_000)
    assert card.next_codes(9_000).shape == (3, 0)


def test_skipped_samples_do_not_change_the_rest(rig: RigFactory) -> None:
    bench = rig()
    whole = taken(SimulatedCard(bench), 40_000)
    card = SimulatedCard(bench)
    card.skip(12_345)
    np.testing.assert_array_equal(card.next_codes(5_000), whole[:, 12_345:17_345])
    assert card.n_read == 17_345


@pytest.mark.parametrize(
    ("requested", "rate", "between_channels"),
    [
        (20_000.0, 20_000.0, 11e-6),  # 10 µs of padding fit
        (100_000.0, 100_000.0, 3.3e-6),  # evenly spaced, in ticks of 50 ns
        (200_000.0, 200_000.0, 1.65e-6),
        (333_333.0, 20e6 / 60, 1e-6),
        (30_000.0, 20e6 / 667, 11e-6),
    ],
)
def test_acquisition_reports_the_clocks_of_the_card(
    rig: RigFactory, requested: float, rate: float, between_channels: float
) -> None:
    acquisition = SimulatedCard(rig(timing={"rate_hz": requested})).acquisition
    assert acquisition.rate == pytest.approx(rate, rel=1e-12)
    assert 1 / acquisition.convert_rate == pytest.approx(between_channels, rel=1e-12)


def test_acquisition_describes_the_channels(rig: RigFactory) -> None:
    bench = rig()
    acquisition = SimulatedCard(bench).acquisition
    assert acquisition.device.simulated
    assert [channel.physical for channel in acquisition.channels] == ["ai0", "ai1", "ai2"]
    assert acquisition.channels[0].angle == pytest.approx(math.pi / 4)
    assert acquisition.channels[1].calibration == bench.calibrations["y"]
    assert acquisition.channels[1].gap_high == 9.0
    assert acquisition.channels[2].gap_high == math.inf
    assert acquisition.tacho == bench.tacho


def test_mean_gap_is_the_standing_gap_plus_the_sag(rig: RigFactory) -> None:
    card = SimulatedCard(rig(simulation=QUIET | {"gap_um": [500.0, 400.0], "sag_um": 30.0}))
    displacement = displacements(card, taken(card, 40_000))
    below = 30e-6 * math.sin(math.pi / 4)  # both probes are 45 degrees above the horizontal
    assert displacement.mean(axis=1) == pytest.approx([-500e-6 - below, -400e-6 - below], abs=0.05e-6)


def test_1x_is_the_models_response_plus_the_run_out(rig: RigFactory) -> None:
    with_run_out, without = (
        rig(simulation=QUIET | {"run_out_um": run_out, "second_order_um": 1.5}) for run_out in (2.0, 0.0)
    )
    vectors = []
    for bench in (with_run_out, without):
        card = SimulatedCard(bench)
        vectors.append(lines(card, displacements(card, taken(card, 40_000)), [1.0, 2.0]))
    response = synchronous_response(model_parameters(without.config), SPEED * RPM)
    lag = 1 / (2 * math.pi * 50_000.0)  # of the probes' conditioners
    late = np.exp(-1j * SPEED * RPM * (lag - np.array([0.0, 11e-6])))
    np.testing.assert_allclose(vectors[1][0], response.vectors * late, atol=0.01e-6)
    np.testing.assert_allclose(np.abs(vectors[0][0] - vectors[1][0]), 2e-6, rtol=0.01)
    np.testing.assert_allclose(np.abs(vectors[0][1]), 1.5e-6, rtol=0.01)


def test_probes_are_sampled_one_after_the_other(rig: RigFactory) -> None:
    """Two probes 90 degrees apart see a forward circle 90 degrees apart, plus the multiplexer's delay."""
    card = SimulatedCard(rig(simulation=QUIET | {"run_out_um": 20.0, "profile": steady(2.0, 18_000.0)}))
    ((x, y),) = lines(card, displacements(card, taken(card, 40_000)), [1.0])
    between = 18_000.0 * RPM / card.acquisition.convert_rate
    assert between == pytest.approx(math.radians(1.188))
    assert np.angle(y / x) + math.pi / 2 == pytest.approx(between, abs=math.radians(0.02))


@pytest.mark.parametrize("forward", [True, False])
def test_whirl_has_the_configured_order_amplitude_and_direction(rig: RigFactory, *, forward: bool) -> None:
    whirl = {"order": 0.49, "onset_rpm": 5000.0, "end_rpm": 9000.0, "amplitude_um": 12.0, "forward": forward}
    card = SimulatedCard(rig(simulation=QUIET | {"whirl": [whirl]}))
    x, y = lines(card, displacements(card, taken(card, 40_000)), [0.49, 1.0, 2.0])[0]
    assert abs(x) == pytest.approx(12e-6, rel=0.01)
    assert abs(y) == pytest.approx(12e-6, rel=0.01)
    assert math.degrees(np.angle(y / x)) == pytest.approx(-90.0 if forward else 90.0, abs=1.0)


@pytest.mark.parametrize(
    ("speed_rpm", "amplitude"), [(4990.0, 0.0), (5050.0, 12e-6 * math.sqrt(0.1)), (5600.0, 12e-6), (9010.0, 0.0)]
)
def test_whirl_grows_with_the_root_of_the_distance_from_its_onset(
    rig: RigFactory, speed_rpm: float, amplitude: float
) -> None:
    whirl = {"order": 0.49, "onset_rpm": 5000.0, "end_rpm": 9000.0, "amplitude_um": 12.0}
    card = SimulatedCard(rig(simulation=QUIET | {"whirl": [whirl], "profile": steady(2.0, speed_rpm)}))
    vectors = lines(card, displacements(card, taken(card, 40_000)), [0.49, 1.0, 2.0])[0]
    np.testing.assert_allclose(np.abs(vectors), amplitude, atol=0.02e-6)


def test_probe_noise_has_the_configured_rms(rig: RigFactory) -> None:
    bench = QUIET | {"sensor_noise_um": 0.4, "run_out_um": 0.0, "second_order_um": 0.0}
    card = SimulatedCard(rig(simulation=bench, model={"imbalance_kg_m": 0.0}))
    assert displacements(card, taken(card, 40_000)).std(axis=1) == pytest.approx([0.4e-6, 0.4e-6], rel=0.03)


def test_glitches_have_the_configured_rate_and_height(rig: RigFactory) -> None:
    bench = QUIET | {"glitches_per_s": 20.0, "glitch_um": 10.0, "run_out_um": 0.0, "second_order_um": 0.0}
    card = SimulatedCard(rig(simulation=bench | {"profile": steady(10.0)}, model={"imbalance_kg_m": 0.0}))
    away = displacements(card, taken(card, 200_000))
    away -= np.median(away, axis=1, keepdims=True)
    assert 0.001 < np.mean(np.abs(away) > 0.5e-6) < 0.01
    assert 15e-6 < np.abs(away).max() < 50e-6


def test_converter_clips_if_the_probe_leaves_its_range(rig: RigFactory) -> None:
    channel = {"name": "x", "role": "probe_x", "physical": "ai0", "calibration": "probe-x.toml"}
    wired = [
        channel | {"range_v": 5.0, "gap_window_v": [1.0, 5.0]},
        channel | {"name": "y", "role": "probe_y", "physical": "ai1", "angle_deg": 90.0},
        {"name": "tacho", "role": "tacho", "physical": "ai2"},
    ]
    card = SimulatedCard(rig(channel=wired, simulation={"gap_um": [600.0, 600.0]}))
    codes = card.next_codes(2000)
    assert np.all(codes[0] == CODE_MAX)
    assert codes[1].max() < 0.7 * CODE_MAX


def test_device_polynomial_differs_from_range_over_codes(rig: RigFactory) -> None:
    channel = SimulatedCard(rig()).acquisition.channels[0]
    full = channel.volts(np.array([-32768, 0, 32767], dtype=np.int16))
    assert full[2] > 1.04 * channel.range_high
    assert full[0] < 1.04 * channel.range_low
    assert 1e-4 < full[1] < 1e-2


@pytest.mark.parametrize(("edge", "delay_s"), [("rising", 0.0), ("rising", 4e-4), ("falling", 4e-4)])
def test_tacho_crosses_its_threshold_a_delay_after_the_mark(rig: RigFactory, edge: str, delay_s: float) -> None:
    bench = {"profile": [{"time_s": 0.0, "speed_rpm": 3000.0}, {"time_s": 2.0, "speed_rpm": 15_000.0}]}
    tacho = {"edge": edge, "delay_s": delay_s, "mark_fraction": 0.4, "threshold_v": 3.0}
    card = SimulatedCard(rig(timing={"rate_hz": 100_000.0}, simulation=QUIET | bench, tacho=tacho))
    found = crossings(card, taken(card, 50_000), rising=edge == "rising")
    angle, _ = card.speed_profile.angle_and_speed(found - delay_s)
    off = np.angle(np.exp(1j * angle))
    assert 298 <= found.size <= 301  # 2 s at 9,000 r/min in the mean
    assert np.abs(off).max() < math.radians(0.1)


def test_tacho_is_light_for_the_mark_fraction_of_the_turn(rig: RigFactory) -> None:
    card = SimulatedCard(rig(simulation=QUIET, tacho={"mark_fraction": 0.35, "pulses_per_revolution": 1}))
    codes = taken(card, 40_000)
    volts = card.acquisition.channels[2].volts(codes[2])
    assert np.mean(volts > 2.15) == pytest.approx(0.35, abs=0.005)
    assert volts.max() == pytest.approx(4.2, abs=0.001)
    assert volts.min() == pytest.approx(0.1, abs=0.001)


def test_tacho_gives_as_many_pulses_as_there_are_marks(rig: RigFactory) -> None:
    card = SimulatedCard(rig(simulation=QUIET, tacho={"pulses_per_revolution": 4, "response_time_s": 1e-4}))
    assert abs(crossings(card, taken(card, 40_000)).size - 4 * 200) <= 1


def test_tacho_jitter_has_the_configured_rms(rig: RigFactory) -> None:
    card = SimulatedCard(
        rig(
            timing={"rate_hz": 100_000.0},
            simulation=QUIET | {"tacho_jitter_us": 20.0, "profile": steady(5.0, 12_000.0)},
        )
    )
    found = crossings(card, taken(card, 50_000))
    angle, _ = card.speed_profile.angle_and_speed(found)
    late = np.angle(np.exp(1j * angle)) / (12_000.0 * RPM)
    assert late.std() == pytest.approx(20e-6, rel=0.1)
    assert late.mean() == pytest.approx(0.0, abs=3e-6)


def test_tacho_of_a_standing_shaft_is_constant(rig: RigFactory) -> None:
    card = SimulatedCard(rig(simulation=QUIET | {"profile": steady(1.0, 0.0)}))
    codes = taken(card, 20_000)
    assert np.ptp(codes[2]) == 0
    assert np.ptp(codes[0]) <= 1


def test_speed_fluctuates_and_drifts_as_configured(rig: RigFactory) -> None:
    bench = {"speed_fluctuation": 0.01, "fluctuation_time_s": 0.1, "speed_drift": 0.06, "profile": steady(60.0)}
    profile = SimulatedCard(rig(simulation=bench)).speed_profile
    _, speed = profile.angle_and_speed(np.linspace(0.0, 60.0, 6001))
    drifted = SPEED * RPM * (1 + 0.06 * np.linspace(0.0, 1.0, 6001))
    assert np.std(speed / drifted) == pytest.approx(0.01, rel=0.2)
    assert np.mean(speed / drifted) == pytest.approx(1.0, abs=0.003)


def test_angle_is_the_integral_of_the_speed_and_time_at_inverts_it(rig: RigFactory) -> None:
    profile = SimulatedCard(rig(simulation={"speed_fluctuation": 0.02})).speed_profile
    time = np.linspace(0.0, 2.0, 200_001)
    angle, speed = profile.angle_and_speed(time)
    turned = np.concatenate(([0.0], np.cumsum(0.5 * np.diff(time) * (speed[1:] + speed[:-1]))))
    np.testing.assert_allclose(angle - angle[0], turned, atol=1e-5)
    np.testing.assert_allclose(profile.time_at(angle[::100]), time[::100], atol=1e-9)
    assert np.isnan(profile.time_at(np.array([-1.0, 1e9]))).all()


def test_analyser_finds_the_configured_motion(rig: RigFactory) -> None:
    whirls = [{"order": 0.17, "onset_rpm": 5000.0, "end_rpm": 9000.0, "amplitude_um": 9.0}]
    bench = rig(timing={"rate_hz": 50_000.0}, simulation={"whirl": whirls, "profile": steady(3.0)})
    card = SimulatedCard(bench)
    analyser = Analyser(card.acquisition, bench.settings)
    codes = taken(card, 150_000)
    snapshots = analyser.add_block(SampleBlock(codes, segment=0, first_sample=0, host_time_ns=0))
    snapshots += analyser.end_segment(SegmentEnd(0, codes.shape[1], EndReason.FINISHED))
    last = snapshots[-1]
    assert last.frame is not None
    assert last.frame.whirl is not None
    assert last.speed == pytest.approx(SPEED * RPM, rel=0.01)
    assert last.frame.whirl.order == pytest.approx(0.17, abs=0.01)
    assert last.frame.whirl.amplitude == pytest.approx(9e-6, rel=0.05)
    assert last.frame.whirl.is_forward
    np.testing.assert_allclose(np.abs(last.frame.vectors[1]), 1.5e-6, rtol=0.05)
    assert last.gap_in_window.all()
