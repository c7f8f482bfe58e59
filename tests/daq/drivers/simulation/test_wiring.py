"""Simulated wiring faults: what reaches the card's inputs, and when."""

import numpy as np
import pytest
from numpy.typing import NDArray

from daq.config.schema import Miswiring
from daq.drivers.simulation.card import SimulatedCard
from daq.drivers.simulation.wiring import (
    CONTACT_INTERVAL,
    CONTACT_LOSS,
    FAULTS,
    IntermittentContact,
    SensorRows,
)
from tests.daq.conftest import RigFactory

ROWS = SensorRows(0, 1, 2)
RATE = 20_000.0
TIME = np.arange(40_000) / RATE
INTERMITTENT: dict[str, object] = {"miswiring": "probe x intermittent"}


def sensors() -> NDArray[np.float64]:
    """Return three distinct voltages, shape (3, n)."""
    return np.stack([5.0 + np.sin(TIME), 4.0 + np.cos(TIME), 2.0 + np.sin(300.0 * TIME)])


def lost_samples(codes: NDArray[np.int16]) -> NDArray[np.bool_]:
    """Return where the voltage of probe x, range ±10 V, is that of an open input."""
    return np.asarray(np.abs(codes[0].astype(np.int64)) < 400)


def test_every_miswiring_has_a_fault() -> None:
    assert set(FAULTS) == set(Miswiring)


@pytest.mark.parametrize("miswiring", Miswiring)
def test_fault_changes_only_its_inputs_and_the_same_seed_gives_the_same_fault(miswiring: Miswiring) -> None:
    affected = {
        Miswiring.NONE: set(),
        Miswiring.BRIDGED: {0, 1},
        Miswiring.PROBES_EXCHANGED: {0, 1},
        Miswiring.HUM: {0, 1},
        Miswiring.TACHO_EXCHANGED: {0, 2},
    }
    row = {"probe x": 0, "probe y": 1, "tacho": 2}
    expected = affected.get(miswiring)
    if expected is None:
        expected = {number for name, number in row.items() if miswiring.value.startswith(name)}
    at_inputs, again = sensors(), sensors()
    for volts in (at_inputs, again):
        FAULTS[miswiring](ROWS, 5).apply(TIME, volts, np.random.default_rng(5))
    changed = {number for number in range(3) if not np.array_equal(at_inputs[number], sensors()[number])}
    assert changed == expected
    np.testing.assert_array_equal(again, at_inputs)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_contact_is_lost_for_short_intervals_of_the_configured_length(seed: int) -> None:
    time = np.arange(0.0, 20.0, 1e-4)
    lost = IntermittentContact(0, seed).is_lost(time)
    for interval in lost.reshape(-1, round(CONTACT_INTERVAL / 1e-4)):
        assert CONTACT_LOSS[0] - 2e-4 <= 1e-4 * np.count_nonzero(interval) <= 3 * CONTACT_LOSS[1] + 2e-4
    assert 0.03 < np.mean(lost) < 0.25
    starts = np.flatnonzero(np.diff(lost.astype(np.int8)) == 1)
    assert np.std(np.diff(starts)) > 0.3 * np.mean(np.diff(starts))  # not periodic


def test_lost_contact_does_not_depend_on_the_division_of_the_run() -> None:
    fault = IntermittentContact(0, 4)
    whole = fault.is_lost(TIME)
    for size in (1000, 777, 8192):
        parts = [fault.is_lost(TIME[first : first + size]) for first in range(0, TIME.size, size)]
        np.testing.assert_array_equal(np.concatenate(parts), whole)
    assert not np.array_equal(IntermittentContact(0, 5).is_lost(TIME), whole)


def test_codes_with_intermittent_contact_do_not_depend_on_the_block_size(rig: RigFactory) -> None:
    bench = rig(simulation=INTERMITTENT)
    whole = SimulatedCard(bench).next_codes(40_000)
    card = SimulatedCard(bench)
    np.testing.assert_array_equal(np.concatenate([card.next_codes(777) for _ in range(52)], axis=1), whole)
    np.testing.assert_array_equal(
        lost_samples(whole), IntermittentContact(0, bench.config.simulation.seed).is_lost(TIME)
    )
    correct = SimulatedCard(rig()).next_codes(40_000)
    np.testing.assert_array_equal(whole[1:], correct[1:])
    np.testing.assert_array_equal(whole[0][~lost_samples(whole)], correct[0][~lost_samples(whole)])
