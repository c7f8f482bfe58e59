"""The comparison of the tacho counter with the waveform."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.header import Edge, TachoCounter
from analysis.signals.snapshot import CounterReport, CounterState
from analysis.tacho.edges import CounterComparison

FloatArray = NDArray[np.float64]
COUNTER = TachoCounter("ctr0", "PFI0", Edge.RISING, 80e6, is_reference=False, max_difference=50e-6)
EDGES: FloatArray = 0.01 + 0.01 * np.arange(600.0)


def report(sampled: FloatArray, stamped: FloatArray, hop: float = 0.1) -> CounterReport:
    comparison = CounterComparison(COUNTER)
    for begin, end in pairwise(np.arange(0.0, 7.0, hop).tolist()):
        comparison.advance(
            sampled[(sampled > begin) & (sampled <= end)], stamped[(stamped > begin) & (stamped <= end)], end
        )
    return comparison.report(is_working=True)


@pytest.mark.parametrize("hop", [0.02, 0.1, 1.0])
def test_equal_edges_agree(hop: float) -> None:
    found = report(EDGES, EDGES + 2e-6, hop)
    assert found.state is CounterState.AGREES
    assert (found.missing, found.extra, found.out_of_tolerance) == (0, 0, 0)
    assert found.compared >= 550
    assert found.mean_difference == pytest.approx(2e-6)
    assert found.largest_difference == pytest.approx(2e-6)


def test_edge_without_a_timestamp_is_missing() -> None:
    found = report(EDGES, np.delete(EDGES, [100, 200, 201]))
    assert (found.state, found.missing, found.extra) == (CounterState.COUNT_DIFFERS, 3, 0)


def test_timestamp_without_an_edge_is_extra() -> None:
    stamped = np.sort(np.concatenate([EDGES, [2.005, 3.0000002, 4.00001]]))  # one between two, and two doubles
    found = report(EDGES, stamped)
    assert (found.state, found.missing, found.extra) == (CounterState.COUNT_DIFFERS, 0, 3)


def test_edges_out_of_tolerance_are_counted() -> None:
    stamped = EDGES.copy()
    stamped[[10, 20]] += 80e-6
    found = report(EDGES, stamped)
    assert (found.state, found.out_of_tolerance) == (CounterState.TIMES_DIFFER, 2)
    assert found.largest_difference == pytest.approx(80e-6)


@pytest.mark.parametrize("hop", [0.02, 0.1, 1.0])
@pytest.mark.parametrize(
    ("differ", "recent"),
    [(slice(0, 3), "none in the last 10 s"), (slice(2900, 2903), "3 of 1,000 in the last 10 s")],
)
def test_recent_message_counts_the_mismatches_of_the_last_ten_seconds(hop: float, differ: slice, recent: str) -> None:
    edges = 0.0103 + 0.01 * np.arange(3000.0)
    comparison = CounterComparison(COUNTER)
    stamped = np.delete(edges, differ)
    for begin, end in pairwise(np.arange(0.0, 30.0 + hop / 2, hop).tolist()):
        within = [(each > begin) & (each <= end) for each in (edges, stamped)]
        comparison.advance(edges[within[0]], stamped[within[1]], end)
    found = comparison.report(is_working=True)
    assert (found.state, found.missing, found.recent_message) == (CounterState.COUNT_DIFFERS, 3, recent)
    assert comparison.report(is_working=False).recent_message == ""
    comparison.restart(0.0)
    assert comparison.report(is_working=True).recent_message == "none in the last 10 s"


def test_silent_counter_misses_every_edge() -> None:
    found = report(EDGES, np.empty(0))
    assert found.missing >= 550
    assert np.isnan(found.mean_difference)
    assert report(np.empty(0), EDGES).extra >= 550
    assert report(np.empty(0), np.empty(0)).state is CounterState.AGREES


def test_counts_do_not_depend_on_the_hop_size() -> None:
    rng = np.random.default_rng(5)
    stamped = np.sort(np.concatenate([np.delete(EDGES, rng.integers(0, 600, 30)), rng.uniform(0, 6, 25)]))
    reports = [report(EDGES, stamped, hop) for hop in (0.05, 0.1, 0.25)]
    assert len({(found.compared, found.missing, found.extra, found.out_of_tolerance) for found in reports}) == 1


def test_edge_at_the_start_of_a_segment_is_ignored() -> None:
    comparison = CounterComparison(COUNTER)
    comparison.advance(np.empty(0), np.array([1e-4]), 1.0)  # the waveform shows only the end of that edge
    assert comparison.report(is_working=True).state is CounterState.AGREES


def test_failure_has_priority_over_mismatches() -> None:
    assert CounterComparison(COUNTER).report(is_working=False).state is CounterState.FAILED
