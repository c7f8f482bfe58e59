"""The edge detector of a tacho on known edges."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

import analysis
from analysis.signals.header import Edge, Tacho
from analysis.tacho.edges import edge_detector

TACHO = Tacho(threshold=2.0, hysteresis=1.0)


def trapezoid(n: int, period: float, rise: float, start: float) -> NDArray[np.float64]:
    """Return pulses of 0 to 4 V, half the period high, whose rising edges pass 2 V at start, start + period, …."""
    phase = (np.arange(n) - start + 0.25 * period) % period - 0.25 * period
    light = np.minimum(0.5 + phase / rise, 0.5 + (0.5 * period - phase) / rise)
    return np.asarray(4.0 * np.clip(light, 0.0, 1.0))


def test_edges_are_timed_between_the_samples() -> None:
    edges = edge_detector(TACHO).edges(trapezoid(5000, 101.3, 6.0, 40.7), 0)
    np.testing.assert_allclose(edges, 40.7 + 101.3 * np.arange(edges.size), atol=1e-9)
    assert edges.size == 49


def test_falling_edges_are_half_a_pulse_later() -> None:
    tacho = Tacho(threshold=2.0, hysteresis=1.0, edge=Edge.FALLING)
    edges = edge_detector(tacho).edges(trapezoid(1000, 100.0, 6.0, 30.25), 0)
    np.testing.assert_allclose(edges, 80.25 + 100.0 * np.arange(10), atol=1e-9)


def test_hysteresis_rejects_noise_on_a_slow_edge() -> None:
    wave = trapezoid(40_000, 1000.0, 300.0, 500.0) + 0.1 * np.random.default_rng(3).standard_normal(40_000)
    assert edge_detector(TACHO).edges(wave, 0).size == 40
    assert edge_detector(Tacho(threshold=2.0, hysteresis=0.0)).edges(wave, 0).size > 40


def test_edge_needs_the_lower_level_first() -> None:
    detector = edge_detector(TACHO)
    assert detector.edges(np.array([2.0, 3.0, 1.8, 3.0]), 0).size == 0
    np.testing.assert_allclose(detector.edges(np.array([1.0, 3.0]), 4), [4.5])


def test_flat_or_empty_waveform_has_no_edges() -> None:
    detector = edge_detector(TACHO)
    assert detector.edges(np.empty(0), 0).size == 0
    assert detector.edges(np.full(100, 2.0), 0).size == 0


def test_negative_hysteresis_is_refused() -> None:
    with pytest.raises(ValueError, match="hysteresis"):
        edge_detector(Tacho(threshold=2.0, hysteresis=-1.0))


@given(seed=st.integers(0, 2**32 - 1), cuts=st.lists(st.integers(0, 600), max_size=8))
def test_edges_do_not_depend_on_the_block_size(seed: int, cuts: list[int]) -> None:
    wave = 2.0 + np.cumsum(np.random.default_rng(seed).standard_normal(600)) * 0.4
    whole = edge_detector(TACHO).edges(wave, 1000)
    detector = edge_detector(TACHO)
    bounds = [0, *sorted(cuts), 600]
    pieces = [detector.edges(wave[a:b], 1000 + a) for a, b in itertools.pairwise(bounds)]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)


def test_every_detector_has_its_own_state() -> None:
    used, unused = edge_detector(TACHO), edge_detector(TACHO)
    used.edges(np.array([1.0, 1.0]), 0)
    assert unused.edges(np.array([3.0, 3.0]), 2).size == 0
    np.testing.assert_allclose(used.edges(np.array([3.0, 3.0]), 2), [1.5])


def test_only_the_factory_names_a_type_of_detector() -> None:
    root = Path(analysis.__file__).parents[1]
    files = [file for package in ("analysis", "daq", "model", "recordings") for file in (root / package).rglob("*.py")]
    naming = [file.name for file in files if "SchmittTrigger" in file.read_text(encoding="utf-8")]
    assert naming == ["edges.py"]
