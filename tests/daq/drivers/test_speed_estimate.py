"""The trigger's speed estimate: declared reference, glitches and counter failure."""

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest

from analysis.signals.blocks import SampleBlock
from analysis.signals.header import Acquisition
from daq.config.rig import Rig
from daq.drivers.simulation.card import SimulatedCard
from daq.drivers.triggered import SpeedEstimator

RigFactory = Callable[..., Rig]

RATE = 20_000
BLOCK = RATE // 10
HELD = {"profile": [{"time_s": 0, "speed_rpm": 600}, {"time_s": 6, "speed_rpm": 600}], "speed_fluctuation": 0.0}


def acquisition_of(rig: RigFactory, reference: str = "counter", **tacho: object) -> Acquisition:
    return SimulatedCard(rig(simulation=HELD, tacho={"counter": {"reference": reference}} | tacho)).acquisition


def stamped(acquisition: Acquisition, edges: Iterable[float], end: float, *, fails_from: float = np.inf) -> list[float]:
    """Return the speed, r/min, at the end of each block with stamps at these times, s; the waveform is silent."""
    estimate, speeds = SpeedEstimator(acquisition), []
    ticks = np.round(np.array(list(edges)) * 80e6).astype(np.int64)
    silent = np.zeros((3, BLOCK), np.int16)
    for first in range(0, round(end * acquisition.rate), BLOCK):
        low, high = first * acquisition.ticks_per_sample, (first + BLOCK) * acquisition.ticks_per_sample
        within = ticks[(ticks >= low) & (ticks < high)]
        failed = first >= fails_from * acquisition.rate
        speeds.append(estimate.update(SampleBlock(silent, 0, first, 0, 0, None if failed else within)))
    return speeds


def test_speed_comes_from_the_declared_reference(rig: RigFactory) -> None:
    edges = np.arange(0.05, 3.0, 0.1)
    by_counter = stamped(acquisition_of(rig), edges, 3.0)
    assert by_counter[5:] == pytest.approx([600.0] * (len(by_counter) - 5), rel=1e-6)
    assert set(stamped(acquisition_of(rig, "samples"), edges, 3.0)) == {0.0}


def test_speed_comes_from_the_samples_after_a_counter_failure_until_the_next_segment(
    rig: RigFactory,
) -> None:
    chosen = rig(simulation=HELD, tacho={"counter": {"reference": "counter"}})
    card = SimulatedCard(chosen)
    estimate = SpeedEstimator(card.acquisition)
    speeds = []
    for k in range(40):
        codes = card.next_codes(BLOCK)
        speeds.append(
            estimate.update(SampleBlock(codes, 0, k * BLOCK, 0, 0, None if k >= 10 else np.empty(0, np.int64)))
        )
    assert set(speeds[:10]) == {0.0}
    assert speeds[20:] == pytest.approx([600.0] * 20, rel=1e-2)
    ticks = np.arange(1, 8) * 8_000_000
    assert estimate.update(SampleBlock(codes, 1, 0, 0, 0, ticks)) == pytest.approx(600.0)


@pytest.mark.parametrize("pulses", [1, 2])
@pytest.mark.parametrize("glitch", ["double", "missing", "none"])
def test_single_doubled_or_missing_edge_hardly_changes_the_speed(rig: RigFactory, pulses: int, glitch: str) -> None:
    acquisition = acquisition_of(rig)
    acquisition = replace(acquisition, tacho=replace(acquisition.tacho, pulses_per_revolution=pulses))
    edges = np.arange(0.05, 4.0, 0.1 / pulses)
    if pulses == 2:
        edges[::2] += 0.008  # marks that are not evenly spaced
    edges = {
        "double": np.insert(edges, 20, edges[20] - 0.03 / pulses),
        "missing": np.delete(edges, 20),
        "none": edges,
    }[glitch]
    speeds = stamped(acquisition, edges, 4.0)
    assert speeds[8:] == pytest.approx([600.0] * (len(speeds) - 8), rel=0.02)  # from one period: 12 % off


def test_two_edges_of_a_glitch_at_rest_give_no_speed(rig: RigFactory) -> None:
    assert set(stamped(acquisition_of(rig), [1.0, 1.001], 3.0)) == {0.0}


def test_standstill_is_detected_within_a_second(rig: RigFactory) -> None:
    speeds = stamped(acquisition_of(rig), np.arange(0.05, 2.0, 0.1), 4.0)
    assert speeds[19] == pytest.approx(600.0)
    assert set(speeds[31:]) == {0.0}
