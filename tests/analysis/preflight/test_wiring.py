"""The wiring checks on signals of good and faulty benches."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.preflight.check_result import Check, Finding, Verdict, WiringLimits, worst_verdict
from analysis.preflight.tacho_checks import TachoSignal, speed_limit_check, tacho_checks
from analysis.preflight.wiring import wiring_checks
from analysis.signals.header import Acquisition, Calibration, Channel, Device, Edge, Role, Tacho
from analysis.signals.units import RPM

FloatArray = NDArray[np.float64]

RATE = 20_000.0
N = 20_000
TIME = np.arange(N) / RATE
STEP = 10.48 / 32768  # V
CALIBRATION = Calibration((0.0, 1e-4), 0.5, 9.5, residual=1e-6, sensor="a", conditioner="b", date="2026-11-20")
TACHO = Tacho(threshold=2.2, hysteresis=1.0)


def channel(name: str, role: Role, number: int, angle: float = 0.0) -> Channel:
    probe = role is not Role.TACHO
    return Channel(
        name, role, f"ai{number}", -10.0, 10.0, (0.0, STEP), CALIBRATION if probe else None, angle,
        1.5 if probe else -math.inf, 8.5 if probe else math.inf,
    )  # fmt: skip


ACQUISITION = Acquisition(
    device=Device("simulated", "USB-6251", "", "simulated", simulated=True),
    rate=RATE,
    convert_rate=3 * RATE,
    channels=(
        channel("x", Role.PROBE_X, 0),
        channel("y", Role.PROBE_Y, 1, math.pi / 2),
        channel("tacho", Role.TACHO, 2),
    ),
    tacho=TACHO,
)


def noise(rms: float, seed: int) -> FloatArray:
    return rms * np.random.default_rng(seed).standard_normal(N)


def turning(speed_rpm: float = 1800.0, um: float = 5.0) -> dict[str, FloatArray]:
    """Return the voltages of a shaft on a circular forward orbit."""
    angle = speed_rpm * RPM * TIME
    return {
        "x": 5.0 + 0.01 * um * np.cos(angle) + noise(1e-3, 1),
        "y": 4.8 + 0.01 * um * np.cos(angle - math.pi / 2) + noise(1e-3, 2),
        "tacho": np.where(angle % (2 * math.pi) < math.pi, 4.2, 0.1) + noise(0.01, 3),
    }


def resting(level: float = 0.1) -> dict[str, FloatArray]:
    return {"x": 5.0 + noise(1e-3, 1), "y": 4.8 + noise(1e-3, 2), "tacho": level + noise(0.01, 3)}


def checked(volts: dict[str, FloatArray], acquisition: Acquisition = ACQUISITION) -> tuple[Check, ...]:
    codes = np.clip(np.rint(np.stack([volts["x"], volts["y"], volts["tacho"]]) / STEP), -32768, 32767)
    return wiring_checks(acquisition, codes.astype(np.int16))


def found(checks: tuple[Check, ...] | list[Check]) -> dict[str, Finding]:
    return {check.name: check.finding for check in checks if check.finding is not None}


def test_good_bench_passes_turning_and_at_rest() -> None:
    assert found(checked(turning())) == {}
    assert found(checked(resting())) == {"tacho levels": Finding.STILL}
    assert found(checked(resting(4.2))) == {"tacho levels": Finding.STILL}


@pytest.mark.parametrize(
    ("volts", "finding"),
    [
        (0.02 + noise(1e-4, 4), Finding.OPEN),
        (np.full(N, -0.01), Finding.OPEN),
        (np.full(N, 4.0), Finding.OPEN),
        (0.1 + noise(2e-3, 4), Finding.GAP_CLOSED),
        (1.4 + noise(1e-3, 4), Finding.GAP_CLOSED),
        (9.0 + noise(1e-3, 4), Finding.GAP_WIDE),
        (12.0 + noise(1e-3, 4), Finding.CLIPPED),
        (-5.0 + noise(1e-3, 4), Finding.REVERSED),
    ],
)
def test_probe_outside_its_gap_limits_has_a_specific_finding(volts: FloatArray, finding: Finding) -> None:
    assert found(checked(turning() | {"y": volts})) == {"probe y gap": finding}


def test_clipped_samples_and_samples_beyond_the_calibration_are_warnings() -> None:
    volts = turning()
    volts["x"][[100, 5000]] = 12.0
    checks = checked(volts)
    assert found(checks) == {"probe x clipping": Finding.CLIPPED, "probe x calibrated span": Finding.BEYOND_CALIBRATION}
    assert worst_verdict(checks) is Verdict.WARN
    narrow = replace(ACQUISITION.channels[0], calibration=replace(CALIBRATION, volts_low=5.0))
    half = checked(turning(), replace(ACQUISITION, channels=(narrow, *ACQUISITION.channels[1:])))
    (check,) = (check for check in half if check.name == "probe x calibrated span")
    assert float(check.advice.split(" %")[0]) == pytest.approx(50.0, abs=1.0)
    assert "extrapolated" in check.advice


@pytest.mark.parametrize(("um", "verdict"), [(0.5, Verdict.GOOD), (2.0, Verdict.WARN), (8.0, Verdict.FAIL)])
def test_hum_verdict_depends_on_its_amplitude(um: float, verdict: Verdict) -> None:
    hum = 0.01 * um * np.sin(2 * np.pi * 50.0 * TIME)
    volts = turning()
    checks = {check.name: check for check in checked(volts | {"x": volts["x"] + hum})}
    assert checks["probe x mains hum"].verdict is verdict
    assert checks["probe y mains hum"].verdict is Verdict.GOOD


def test_one_signal_on_two_inputs_is_bridged_turning_and_at_rest() -> None:
    for volts in (turning(), resting()):
        checks = found(checked(volts | {"y": volts["x"] + noise(1e-4, 5)}))
        assert checks["probes x and y apart"] is Finding.BRIDGED


def test_straight_line_orbit_is_not_bridged() -> None:
    line = 0.1 * np.cos(1800 * RPM * TIME)
    volts = turning(um=0.0)
    assert found(checked(volts | {"x": volts["x"] + line, "y": volts["y"] + line})) == {}


def test_backward_orbit_means_exchanged_probes() -> None:
    volts = turning()
    assert found(checked(volts | {"x": volts["y"], "y": volts["x"]})) == {"1X direction": Finding.PROBES_EXCHANGED}


def test_orbit_too_small_for_a_direction_passes() -> None:
    volts = turning(um=0.02)
    assert found(checked(volts | {"x": volts["y"], "y": volts["x"]})) == {}


def test_tacho_signal_at_a_probe_input_is_exchanged_or_bridged() -> None:
    volts = turning()
    exchanged = checked(volts | {"y": volts["tacho"], "tacho": volts["y"]})
    assert found(exchanged) == {"probe y signal": Finding.TACHO_EXCHANGED}
    assert "ai1 and ai2" in next(check.advice for check in exchanged if check.advice)
    assert found(checked(volts | {"y": volts["tacho"]})) == {"probe y signal": Finding.BRIDGED}


def interrupted(volts: FloatArray, losses: list[tuple[float, float]]) -> FloatArray:
    """Return a probe's voltage with an open input in intervals, (start, duration) in s."""
    lost = np.any([(start <= TIME) & (start + duration > TIME) for start, duration in losses], axis=0)
    return np.where(lost, 0.02 + noise(1e-4, 7), volts)


IRREGULAR = [(0.1, 0.02), (0.15, 0.002), (0.61, 0.03)]


def test_intermittent_contact_is_reported_turning_and_at_rest() -> None:
    for volts in (turning(), resting()):
        checks = checked(volts | {"x": interrupted(volts["x"], IRREGULAR)})
        assert {name: finding for name, finding in found(checks).items() if name != "tacho levels"} == {
            "probe x contact": Finding.INTERMITTENT
        }
        (check,) = (check for check in checks if check.name == "probe x contact")
        assert check.value == "3 losses, 5.2 % of the time"
        assert "30 ms" in check.advice
        assert "ai0" in check.advice


def test_contact_lost_once_per_revolution_is_intermittent_while_the_tacho_pulses() -> None:
    volts = turning(600.0)
    every_turn = [(0.03 + 0.1 * turn, 0.01) for turn in range(10)]
    assert found(checked(volts | {"y": interrupted(volts["y"], every_turn)})) == {
        "probe y contact": Finding.INTERMITTENT
    }


def test_single_spike_to_zero_is_no_lost_contact() -> None:
    volts = turning()
    assert "probe x contact" not in found(checked(volts | {"x": interrupted(volts["x"], [(0.3, 0.0005)])}))


def test_quiet_tacho_pulses_at_a_probe_input_are_no_lost_contact() -> None:
    volts = turning()
    pulses = np.where(volts["tacho"] > 2.0, 4.2, 0.1)
    assert found(checked(volts | {"y": pulses, "tacho": volts["y"]})) == {"probe y signal": Finding.TACHO_EXCHANGED}
    dark = np.where((1800.0 * RPM * TIME) % (2 * math.pi) < 1.8 * math.pi, 4.2, 0.1)
    assert found(checked(volts | {"y": dark, "tacho": volts["y"]})) == {"probe y signal": Finding.TACHO_EXCHANGED}
    assert found(checked(volts | {"y": dark, "tacho": dark}))["probe y signal"] is Finding.BRIDGED


def test_silent_tacho_is_detected_by_the_motion_of_the_probes() -> None:
    assert found(checked(turning() | {"tacho": 0.1 + noise(0.01, 6)})) == {"tacho levels": Finding.SILENT}


def test_floating_tacho_is_between_its_switching_levels() -> None:
    assert found(checked(resting(2.3))) == {"tacho levels": Finding.LEVELS}


def tacho_findings(volts: FloatArray, tacho: Tacho = TACHO, full_range: float = 10.0) -> dict[str, Finding]:
    high = replace(ACQUISITION.channels[2], range_low=-full_range, range_high=full_range)
    signal = TachoSignal.from_codes(high, tacho, np.rint(volts / STEP).astype(np.int16), RATE)
    return found(tacho_checks(signal, WiringLimits(), motion=True))


def test_tacho_faults_have_specific_findings() -> None:
    volts = turning()["tacho"]
    assert tacho_findings(volts) == {}
    assert tacho_findings(-volts) == {"tacho levels": Finding.REVERSED}
    assert tacho_findings(0.3 * volts) == {"tacho levels": Finding.LEVELS}
    assert tacho_findings(volts + 3.0) == {"tacho levels": Finding.LEVELS}
    assert tacho_findings(volts, full_range=4.2) == {"tacho levels": Finding.CLIPPED}
    assert "tacho noise" in tacho_findings(volts + noise(0.3, 8))


@pytest.mark.parametrize(("hysteresis", "is_warned"), [(0.3, True), (0.5, False), (2.0, False), (2.2, True)])
def test_unsuitable_hysteresis_is_a_warning(hysteresis: float, *, is_warned: bool) -> None:
    found = tacho_findings(turning()["tacho"], Tacho(threshold=2.15, hysteresis=hysteresis))
    assert found == ({"tacho hysteresis": Finding.LEVELS} if is_warned else {})


def test_wrong_mark_fraction_is_a_warning() -> None:
    thin = np.where(30.0 * TIME % 1.0 < 0.2, 4.2, 0.1) + noise(0.01, 9)
    assert tacho_findings(thin, replace(TACHO, mark_fraction=0.2)) == {}
    assert tacho_findings(thin, replace(TACHO, mark_fraction=0.8)) == {"tacho mark": Finding.REVERSED}
    assert tacho_findings(thin, replace(TACHO, mark_fraction=0.5)) == {"tacho mark": Finding.DUTY}


def test_random_periods_are_scatter_and_a_run_up_is_not() -> None:
    uneven = np.where((60.0 * TIME + 0.1 * np.cos(2 * np.pi * 30 * TIME)) % 1.0 < 0.5, 4.2, 0.1)
    assert tacho_findings(uneven) == {"tacho pulses": Finding.SCATTER}
    run_up = np.where((10.0 * TIME + 40.0 * TIME**2) % 1.0 < 0.5, 4.2, 0.1)
    assert tacho_findings(run_up) == {}


def test_uneven_mark_spacing_is_no_scatter() -> None:
    turn = 30.0 * TIME % 1.0
    two = np.where((turn < 0.15) | ((turn > 0.3) & (turn < 0.65)), 4.2, 0.1) + noise(0.01, 9)
    assert tacho_findings(two, replace(TACHO, pulses_per_revolution=2)) == {}
    assert tacho_findings(two) == {"tacho pulses": Finding.SCATTER}
    signal = TachoSignal.from_codes(
        ACQUISITION.channels[2],
        replace(TACHO, pulses_per_revolution=2),
        np.rint(two / STEP).astype(np.int16),
        RATE,
    )
    assert signal.angle is not None
    np.testing.assert_allclose(np.diff(signal.angle) * RATE, 2 * np.pi * 30.0, rtol=0.01)


def test_too_few_edges_give_no_speed() -> None:
    slow = np.where(1.5 * TIME % 1.0 < 0.5, 4.2, 0.1)
    assert tacho_findings(slow) == {"tacho pulses": Finding.STILL}


def test_speed_and_angle_follow_the_marks_of_either_edge() -> None:
    for edge in Edge:
        tacho = replace(TACHO, edge=edge, pulses_per_revolution=2)
        codes = np.rint(turning(3600.0)["tacho"] / STEP).astype(np.int16)
        signal = TachoSignal.from_codes(ACQUISITION.channels[2], tacho, codes, RATE)
        assert signal.speed == pytest.approx(1800 * RPM, rel=1e-3)
        assert signal.angle is not None
        assert np.diff(signal.angle) == pytest.approx(1800 * RPM / RATE, rel=0.02)


def test_speed_limit_is_that_of_the_shorter_of_light_and_dark() -> None:
    def verdict(speed_rpm: float, mark_fraction: float = 0.5, response_time: float = 1e-3) -> Verdict:
        tacho = replace(TACHO, mark_fraction=mark_fraction, response_time=response_time)
        return speed_limit_check(tacho, speed_rpm * RPM).verdict

    assert verdict(26_000) is Verdict.GOOD
    assert verdict(28_000) is Verdict.WARN
    assert verdict(31_000) is Verdict.FAIL
    assert verdict(6100, mark_fraction=0.1) is Verdict.FAIL
    assert verdict(6100, mark_fraction=0.9) is Verdict.FAIL
    assert verdict(5000, mark_fraction=0.1) is Verdict.GOOD
    assert verdict(200_000, response_time=0.0) is Verdict.GOOD


def test_samples_of_other_channels_are_refused() -> None:
    with pytest.raises(ValueError, match=r"codes: shape \(2, 5\)"):
        wiring_checks(ACQUISITION, np.zeros((2, 5), np.int16))


def test_check_has_a_finding_unless_it_passed() -> None:
    with pytest.raises(ValueError, match="expected a finding"):
        Check("a", "b", "c", Verdict.WARN)
    assert worst_verdict(()) is Verdict.GOOD
