"""The Vold-Kalman filter on known envelopes."""

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.errors import BandLimitError, RecordTooShortError
from analysis.signals.header import Tacho
from analysis.tacho.pulse_record import pulse_record
from analysis.tacho.shaft_angle import shaft_angle
from analysis.vectors.vold_kalman import order_envelopes, probe_envelopes

FloatArray = NDArray[np.float64]

RATE = 5_000.0
TIME = np.arange(20_000) / RATE
ANGLE = 2 * np.pi * (60.0 * TIME + 0.5 * 60.0 * TIME**2)
INNER = slice(2500, -2500)


@pytest.mark.parametrize("how", [{"bandwidth": 4.0}, {"bandwidth_percent": 4.0}])
def test_joint_orders_are_tracked_as_their_amplitudes_change(how: dict[str, float]) -> None:
    truth = {1.0: 20 + 5 * np.sin(2 * np.pi * 0.4 * TIME), 2.0: 5.0 + 0 * TIME, 0.47: 8.0 + 0 * TIME}
    noise = 0.1 * np.random.default_rng(0).standard_normal(TIME.size)
    waveform = sum(a * np.cos(order * ANGLE + 0.3) for order, a in truth.items()) + noise
    found = order_envelopes(np.asarray(waveform), ANGLE, RATE, tuple(truth), **how)  # type: ignore[arg-type]
    for index, (order, amplitude) in enumerate(truth.items()):
        error = np.abs(found.envelopes[index])[INNER] - amplitude[INNER]
        assert np.sqrt(np.mean(error**2)) < 0.03
        assert np.abs(np.angle(found.envelopes[index][INNER] * np.exp(-0.3j))).max() < 0.03
        own = amplitude * np.cos(order * ANGLE + 0.3)
        assert np.abs(found.waveform(index) - own)[INNER].max() < 0.15
    assert np.std(found.residual[INNER]) == pytest.approx(0.1, rel=0.05)


def test_distant_orders_do_not_affect_each_other() -> None:
    waveform = 20 * np.cos(ANGLE) + 3 * np.cos(3 * ANGLE)
    found = order_envelopes(waveform, ANGLE, RATE, (1.0, 3.0), bandwidth=3.0)
    assert np.abs(np.abs(found.envelopes[0]) - 20)[INNER].max() < 0.05
    assert np.abs(np.abs(found.envelopes[1]) - 3)[INNER].max() < 0.05


def test_record_gives_the_envelopes_of_both_probes() -> None:
    rate = 40_000.0
    time = np.arange(160_000) / rate
    turns = 60.0 * time + 15.0 * time**2
    z = (20 + 3 * np.sin(2 * np.pi * 0.4 * time)) * np.exp(2j * np.pi * turns + 0.3j) + 8 * np.exp(
        0.94j * np.pi * turns
    )
    path = 35.0 * np.sqrt(0.2 + time)  # of the shaft in its clearance
    displacement = np.stack([z.real + path, z.imag - path])
    pulses = (np.sqrt(3_600.0 + 60.0 * np.arange(0, 480)) - 60.0) / 30.0
    angle = shaft_angle(pulse_record(pulses, Tacho(2.0, 1.0, response_time=1e-5)))
    times, (x, y) = probe_envelopes(displacement, rate, angle, (1.0, 0.47), bandwidth=4.0)
    assert 1_000.0 < 1.0 / np.diff(times).mean() < 2_500.0
    inner = (times > 0.5) & (times < 3.5)
    truth = 20 + 3 * np.sin(2 * np.pi * 0.4 * times)
    assert np.abs(np.abs(x.envelopes[0]) - truth)[inner].max() < 0.1
    assert np.abs(np.abs(y.envelopes[1]) - 8)[inner].max() < 0.1
    assert np.abs(np.angle(x.envelopes[0] * np.exp(-0.3j)))[inner].max() < 0.02  # theta is that of the tacho
    with pytest.raises(ValueError, match="displacement"):
        probe_envelopes(displacement[0], rate, angle, (1.0,), bandwidth=4.0)


@pytest.mark.parametrize("order", [0.1, 0.15, 0.22, 0.47])
def test_low_orders_have_no_bias_beside_a_moving_mean(order: float) -> None:
    rate = 20_000.0
    time = np.arange(100_000) / rate
    turns = 100.0 * time
    z = 20 * np.exp(2j * np.pi * turns) + 8 * np.exp(2j * np.pi * order * turns + 0.2j)
    noise = 0.5 * np.random.default_rng(0).standard_normal((2, time.size))
    displacement = np.stack([z.real, z.imag]) + noise + 35.0 * np.sqrt(0.2 + time)
    angle = shaft_angle(pulse_record(np.arange(0.0, 5.0, 0.01), Tacho(2.0, 1.0, response_time=1e-5)))
    times, probes = probe_envelopes(displacement, rate, angle, (1.0, order), bandwidth=2.0)
    inner = (times > 1.0) & (times < 4.0)
    for found in probes:
        error = np.abs(found.envelopes[1][inner]) - 8.0
        assert abs(error.mean()) < 2e-3 * 8.0
        assert np.sqrt(np.mean(error**2)) < 2.0 * np.median(found.sigma[1])


def test_hum_and_a_second_shaft_crossing_1x_do_not_affect_it() -> None:
    time = np.arange(20_000) / RATE
    angle = 2 * np.pi * (40.0 * time + 0.5 * 10.0 * time**2)  # passes 60 Hz after 2 s
    phases = (2 * np.pi * 60.0 * time, 0.8 * 2 * np.pi * (50.0 * time + 0.5 * 12.0 * time**2))
    noise = 0.2 * np.random.default_rng(0).standard_normal(time.size)
    waveform = 20 * np.cos(angle + 0.3) + 5 * np.cos(phases[0]) + 4 * np.cos(phases[1] + 1.0) + noise
    inner = slice(2_000, -2_000)
    alone = order_envelopes(waveform, angle, RATE, (1.0,), bandwidth=1.0)
    assert np.abs(np.abs(alone.envelopes[0]) - 20.0)[inner].max() > 3.0
    found = order_envelopes(waveform, angle, RATE, (1.0,), bandwidth=1.0, others=phases)
    error = (np.abs(found.envelopes[0]) - 20.0)[inner]
    assert np.abs(error).max() < 0.4
    assert [float(np.median(np.abs(row[inner]))) for row in found.envelopes[1:]] == pytest.approx([5.0, 4.0], abs=0.05)


@pytest.mark.parametrize("bandwidth", [4.0, 10.0])
def test_bandwidth_is_the_half_power_width(bandwidth: float) -> None:
    gains = []
    for beat in (0.0, 0.5 * bandwidth, 2.0 * bandwidth):
        waveform = np.cos(2 * np.pi * beat * TIME) * np.cos(ANGLE)
        envelope = order_envelopes(waveform, ANGLE, RATE, (1.0,), bandwidth=bandwidth).envelopes[0].real[INNER]
        gains.append(float(np.sqrt(2) * np.std(envelope)) if beat else float(envelope.mean()))
    assert gains[0] == pytest.approx(1.0, abs=1e-3)
    assert gains[1] == pytest.approx(np.sqrt(0.5), rel=0.02)
    assert gains[2] < 0.02


def test_stated_uncertainty_is_the_scatter_of_many_runs() -> None:
    random = np.random.default_rng(0)
    errors, stated = [], []
    for _ in range(12):
        waveform = 10 * np.cos(ANGLE) + random.standard_normal(TIME.size)
        found = order_envelopes(waveform, ANGLE, RATE, (1.0,), bandwidth=5.0)
        errors.append(np.abs(found.envelopes[0])[INNER] - 10)
        stated.append(found.sigma[0][INNER])
    assert np.std(errors) == pytest.approx(np.mean(stated), rel=0.1)


def test_the_filter_is_linear() -> None:
    one, two = np.random.default_rng(1).standard_normal((2, TIME.size))
    parts = [order_envelopes(w, ANGLE, RATE, (1.0, 2.0), bandwidth=20.0).envelopes for w in (one, two, 3 * one - two)]
    np.testing.assert_allclose(parts[2], 3 * parts[0] - parts[1], atol=1e-8)


@pytest.mark.parametrize(
    ("how", "says"),
    [
        ({"orders": (1.0,)}, "one of the two"),
        ({"orders": (1.0,), "bandwidth": 4.0, "bandwidth_percent": 4.0}, "one of the two"),
        ({"orders": (), "bandwidth": 4.0}, "orders"),
        ({"orders": (1.0, 1.0), "bandwidth": 4.0}, "all different"),
        ({"orders": (1.0,), "bandwidth": -1.0}, "bandwidth"),
    ],
)
def test_unsolvable_settings_are_refused(how: dict[str, object], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        order_envelopes(np.cos(ANGLE), ANGLE, RATE, **how)  # type: ignore[arg-type]  # what a caller may get wrong


@pytest.mark.parametrize(
    ("order", "bandwidth", "expected"),
    [(20.0, 4.0, "0.45 of the rate"), (1.0, 0.001, "decimate"), (1.0, RATE, "below")],
)
def test_settings_impossible_at_the_rate_are_refused(order: float, bandwidth: float, expected: str) -> None:
    with pytest.raises(BandLimitError, match=expected):
        order_envelopes(np.cos(ANGLE), ANGLE, RATE, (order,), bandwidth=bandwidth)


def test_record_too_short_to_resolve_two_orders_is_refused() -> None:
    angle = np.asarray(2 * np.pi * 100.0 * np.arange(30) / 10_000.0)
    with pytest.raises(RecordTooShortError, match="30 samples"):
        order_envelopes(np.cos(angle), angle, 10_000.0, (1.0, 2.0), bandwidth=20.0)


def test_waveforms_of_other_shapes_are_refused() -> None:
    with pytest.raises(RecordTooShortError):
        order_envelopes(np.zeros(5), np.arange(5.0), RATE, (1.0,), bandwidth=4.0)
    with pytest.raises(ValueError, match="shapes"):
        order_envelopes(np.zeros(50), np.arange(49.0), RATE, (1.0,), bandwidth=4.0)
    with pytest.raises(ValueError, match="phases that rise"):
        order_envelopes(np.full(50, np.nan), np.arange(50.0), RATE, (1.0,), bandwidth=4.0)
