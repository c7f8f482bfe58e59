"""The simulated shaft whose motion is the rotor model's, integrated in time."""

from collections.abc import Callable

import numpy as np
import pytest

from daq.config.rig import Rig, model_parameters
from daq.drivers.factory import open_source
from daq.drivers.simulation.card import SimulatedCard
from daq.errors import DeviceError, DeviceFault
from model.dynamics.motion import ShaftMotion

RigFactory = Callable[..., Rig]

CLEAN: dict[str, object] = {
    "motion": "model",
    "glitches_per_s": 0.0,
    "sensor_noise_um": 0.0,
    "run_out_um": 0.0,
    "second_order_um": 0.0,
    "speed_fluctuation": 0.0,
    "profile": [{"time_s": 0.0, "speed_rpm": 8000.0}, {"time_s": 0.4, "speed_rpm": 9000.0}],
}


def test_interpolated_motion_matches_integration_at_every_sample(rig: RigFactory) -> None:
    bench = rig(simulation=CLEAN)
    card = SimulatedCard(bench)
    codes = card.next_codes(6000)
    seen = np.stack([card.acquisition.channels[row].displacement(codes[row]) for row in (0, 1)])

    rate, profile = card.acquisition.rate, card.speed_profile
    angle, speed = profile.angle_and_speed(np.arange(-4, 6000) / rate)
    shaft = ShaftMotion(model_parameters(bench.config), float(speed[0]), angle=float(angle[0]))
    path = shaft.advance(angle[1:], speed[1:], 1 / rate)[:, 3:]
    diagonal = np.array([[1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(2.0)  # the probes are at 45 and 135 degrees
    expected = diagonal @ path - 500e-6
    assert np.ptp(expected[0]) > 4e-6
    # remaining: integration error, the conditioner's 3 µs, the multiplexer's 11 µs, and the converter's resolution
    np.testing.assert_allclose(seen, expected, atol=0.15e-6)


def test_codes_of_the_model_do_not_depend_on_the_block_size(rig: RigFactory) -> None:
    bench = rig(simulation=CLEAN)
    whole = SimulatedCard(bench).next_codes(8000)
    card = SimulatedCard(bench)
    parts = [card.next_codes(n) for n in (1, 999, 3000, 4000)]
    np.testing.assert_array_equal(np.concatenate(parts, axis=1), whole)


def test_shaft_that_touches_the_wall_at_once_cannot_be_opened(rig: RigFactory) -> None:
    with pytest.raises(DeviceError, match="cannot start") as caught:
        open_source(rig(simulation=CLEAN, model={"viscosity_pa_s": 1e-9, "imbalance_kg_m": 1.5e-5}))
    assert caught.value.fault is DeviceFault.REJECTED
