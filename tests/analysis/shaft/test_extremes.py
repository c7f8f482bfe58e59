"""Extremes without a few samples at either end are those that a full ranking gives."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.shaft.overall import trimmed_extremes


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.floats(-1e3, 1e3) | st.integers(-3, 3).map(float), min_size=1, max_size=400),
    st.integers(0, 30),
    st.integers(1, 40),
)
def test_trimmed_extremes_equal_those_of_sorting(values: list[float], excluded: int, repeats: int) -> None:
    row = np.tile(values, repeats)
    excluded = min(excluded, (row.size - 1) // 2)
    ranked = np.sort(row)
    low, high = trimmed_extremes(row[None], excluded)
    assert (low[0], high[0]) == (ranked[excluded], ranked[row.size - 1 - excluded])


def test_trimmed_extremes_of_motion_with_glitches_equal_those_of_sorting() -> None:
    random = np.random.default_rng(1)
    rows = np.sin(np.linspace(0.0, 600.0, 10_000)) * [[1.0], [2.0]] + 0.01 * random.standard_normal((2, 10_000))
    rows[:, random.integers(0, 10_000, 12)] += 30.0 * random.standard_normal((2, 12))
    low, high = trimmed_extremes(rows, 20)
    ranked = np.sort(rows, axis=1)
    np.testing.assert_array_equal(low, ranked[:, 20])
    np.testing.assert_array_equal(high, ranked[:, -21])
    assert np.ptp(rows[1]) > 2.0 * float(high[1] - low[1])


@pytest.mark.parametrize(("shape", "excluded"), [((2, 10), 5), ((10,), 0), ((2, 10), -1)])
def test_excluding_too_many_samples_is_refused(shape: tuple[int, ...], excluded: int) -> None:
    with pytest.raises(ValueError, match="samples, excluded"):
        trimmed_extremes(np.zeros(shape), excluded)
