"""Tacho edges from the waveform and from a counter."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.blocks import SampleBlock
from analysis.signals.header import Acquisition, Channel, Device, Edge, Role, Tacho, TachoCounter
from analysis.signals.snapshot import CounterState
from analysis.tacho.edges import MAX_TIMESTAMP_DELAY, TachoEdgeReader

RATE, TIMEBASE, DELAY = 10_000.0, 80e6, 3e-4
COUNTER = TachoCounter("ctr0", "PFI0", Edge.RISING, TIMEBASE, is_reference=True, max_difference=1e-4)
ACQUISITION = Acquisition(
    device=Device("simulated", "USB-6251", "1", "", simulated=True),
    rate=RATE,
    convert_rate=30_000.0,
    channels=tuple(
        Channel(role.value, role, f"ai{k}", -10.0, 10.0, (0.0, 1e-3))
        for k, role in enumerate((Role.PROBE_X, Role.PROBE_Y, Role.TACHO))
    ),
    tacho=Tacho(threshold=2.5, hysteresis=1.0, delay=DELAY, counter=COUNTER),
)
HOP = 500
EDGES: NDArray[np.float64] = 0.01 + 0.02 * np.arange(150.0)  # s, of 3 s
TICKS = np.floor(EDGES * TIMEBASE).astype(np.int64)
VOLTS = np.where(((np.arange(30_000) / RATE + 2 / 30_000.0) - EDGES[0]) % 0.02 < 0.01, 5.0, 0.0)


def acquisition(*, counter: TachoCounter | None = COUNTER) -> Acquisition:
    return replace(ACQUISITION, tacho=replace(ACQUISITION.tacho, counter=counter))


def block(first: int, n: int, ticks: NDArray[np.int64] | None) -> SampleBlock:
    return SampleBlock(np.zeros((3, n), np.int16), 0, first, 0, 0, ticks)


def taken(
    given: TachoEdgeReader, stamps: list[NDArray[np.int64] | None], size: int = 1000
) -> list[NDArray[np.float64]]:
    """Add blocks with their timestamps, and return the edges of each hop."""
    hops: list[NDArray[np.float64]] = []
    for k, ticks in enumerate(stamps):
        given.add_block(block(k * size, size, ticks))
        firsts = range(k * size, (k + 1) * size, HOP)
        hops += [given.read(VOLTS[first : first + HOP], first).edges for first in firsts]
    return hops


def in_blocks(ticks: NDArray[np.int64], size: int = 1000, late: int = 0) -> list[NDArray[np.int64] | None]:
    bounds = np.arange(0, VOLTS.size + 1, size) * TIMEBASE / RATE
    parts = [ticks[(ticks >= low) & (ticks < high)] for low, high in pairwise(bounds.tolist())]
    return [*[ticks[:0]] * late, *parts[: len(parts) - late]]


def test_timestamps_minus_the_delay_are_the_edges_of_their_hop() -> None:
    hops = taken(TachoEdgeReader(acquisition()), in_blocks(TICKS))
    np.testing.assert_allclose(np.concatenate(hops), EDGES - DELAY, atol=2 / TIMEBASE)
    for k, edges in enumerate(hops):
        assert ((edges + DELAY >= k * HOP / RATE) & (edges + DELAY < (k + 1) * HOP / RATE)).all()


@pytest.mark.parametrize("size", [500, 2000, 5000])
def test_edges_do_not_depend_on_the_block_size(size: int) -> None:
    small, large = (taken(TachoEdgeReader(acquisition()), in_blocks(TICKS, n), n) for n in (1000, size))
    assert all(np.array_equal(one, other) for one, other in zip(small, large, strict=True))


def test_late_timestamp_takes_effect_with_its_block() -> None:
    hops = taken(TachoEdgeReader(acquisition()), in_blocks(TICKS, late=2))
    assert all(edges.size == 0 for edges in hops[:4])
    known = np.concatenate(hops)
    np.testing.assert_allclose(known, EDGES[: known.size] - DELAY, atol=2 / TIMEBASE)
    assert known.size == np.count_nonzero(EDGES < 2.8)


def test_missing_timestamps_mean_no_edge_only_after_the_maximum_delay() -> None:
    given = TachoEdgeReader(acquisition())
    given.add_block(block(0, 10_000, TICKS[:5]))
    stretch = given.read(VOLTS[:10_000], 0)
    assert stretch.known == pytest.approx(1.0 - MAX_TIMESTAMP_DELAY)
    given.add_block(block(10_000, 10_000, TICKS[5:99]))
    assert given.read(VOLTS[10_000:20_000], 10_000).known == pytest.approx(EDGES[98])


def test_waveform_replaces_a_failed_counter_without_double_edges() -> None:
    stamps = in_blocks(TICKS)
    given = TachoEdgeReader(acquisition())
    hops = taken(given, [*stamps[:12], *[None] * 18])
    edges = np.concatenate(hops)
    np.testing.assert_allclose(edges, EDGES - DELAY, atol=1 / RATE)
    assert (np.diff(edges) > 0.019).all()
    report = given.report(VOLTS.size)
    assert report is not None
    assert report.state is CounterState.FAILED
    assert "samples" in report.message


def test_waveform_can_be_the_reference_and_timestamps_are_compared() -> None:
    other = replace(COUNTER, is_reference=False)
    stamps = in_blocks(np.delete(TICKS, [20, 30]))
    given, plain = TachoEdgeReader(acquisition(counter=other)), TachoEdgeReader(acquisition(counter=None))
    edges = np.concatenate(taken(given, stamps))
    np.testing.assert_allclose(edges, np.concatenate(taken(plain, [None] * 30)), rtol=0, atol=1e-12)
    report = given.report(VOLTS.size)
    assert report is not None
    assert (report.state, report.missing, report.extra) == (CounterState.COUNT_DIFFERS, 2, 0)
    assert report.message == "2 edges of the waveform without a timestamp"
    assert plain.report(VOLTS.size) is None


def test_new_segment_discards_earlier_timestamps() -> None:
    given = TachoEdgeReader(acquisition())
    given.add_block(block(0, 1000, TICKS[:9]))
    given.restart(0)
    given.add_block(block(0, 1000, None))
    assert given.read(np.zeros(1000), 0).edges.size == 0
    given.restart(0)
    given.add_block(block(0, 1000, TICKS[:4]))
    np.testing.assert_allclose(given.read(VOLTS[:1000], 0).edges, EDGES[:4] - DELAY, atol=2 / TIMEBASE)
