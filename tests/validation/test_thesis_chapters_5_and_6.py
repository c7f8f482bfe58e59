"""The report on chapters 5 and 6: what it reproduces and what it does not, so that neither changes unnoticed."""

import math

import numpy as np
import pytest

from daq.cli.model.report import Part, counts, page
from model.studies.run_up import INNER, OUTER, run_up
from model.studies.study import Surface
from model.studies.synchronous import stability
from model.studies.thesis_chapter_5 import chapter_5_comparisons
from model.studies.thesis_chapter_6 import (
    CASES,
    Outcome,
    chapter_6_comparisons,
    chapter_6_figures,
    trends,
)


@pytest.fixture(scope="module")
def outcomes() -> tuple[Outcome, ...]:
    # the same cases, at few speeds: what is compared is how the report judges
    speeds = np.array([500.0, 1200.0, 1300.0, 2400.0, 2500.0])
    found = []
    for case in CASES:
        parameters = case.parameters()
        found.append(Outcome(run_up(parameters, speeds, 20, 16), stability(parameters, speeds[[0, 2, 4]], 500.0)))
    return tuple(found)


def test_tables_5_2_and_5_3_and_the_counts_are_reproduced_but_for_entries_with_a_reason() -> None:
    comparisons = chapter_5_comparisons()
    by_place = {
        place: [c for c in comparisons if c.place == place] for place in ("Table 5.2", "Section 5.3", "Table 5.3")
    }
    assert {place: len(found) for place, found in by_place.items()} == {
        "Table 5.2": 4, "Section 5.3": 3, "Table 5.3": 170,
    }  # fmt: skip
    assert all(c.is_reproduced for c in by_place["Table 5.2"] + by_place["Section 5.3"])
    missed = [c for c in by_place["Table 5.3"] if not c.is_reproduced]
    assert len(missed) == 22
    assert all(c.note for c in missed)


def test_every_onset_of_chapter_6_stands_beside_the_stated_one_with_its_reason(outcomes: tuple[Outcome, ...]) -> None:
    comparisons = chapter_6_comparisons(outcomes)
    onsets = [c for c in comparisons if c.unit == "rad/s"]
    assert len(onsets) == 2 * len(CASES)
    for comparison in onsets:
        assert comparison.is_reproduced or "by eigenvalues" in comparison.note
    orders = [c for c in comparisons if c.unit == "X"]
    assert [c.stated for c in orders] == [0.2, 0.6]


def test_whirl_that_never_comes_counts_as_later_than_any() -> None:
    delays = next(
        one for one in trends(_with_onsets([1600.0, 2500.0, math.nan])) if one.text.startswith("more imbalance delays")
    )
    assert delays.is_reproduced
    assert delays.seen == "1,600 rad/s → 2,500 rad/s → none"
    other = next(one for one in trends(_with_onsets([1600.0, 1600.0, math.nan])) if one.text == delays.text)
    assert not other.is_reproduced


def _with_onsets(onsets: list[float]) -> tuple[Outcome, ...]:
    """Return outcomes of all cases, the first three with these onsets of the inner film."""
    speeds = np.arange(1000.0, 3001.0, 100.0)
    found = []
    for onset in [*onsets, *[2000.0] * (len(CASES) - 3)]:
        run = run_up(CASES[0].parameters(), speeds[:2], 1, 8)
        orders = run.orders
        spectrum = np.zeros((speeds.size, orders.size))
        spectrum[:, int(np.argmin(np.abs(orders - 1)))] = 2e-6
        if math.isfinite(onset):
            spectrum[speeds >= onset, int(np.argmin(np.abs(orders - 0.7)))] = 1e-6
        whole = type(run)(speeds, orders, spectrum, np.zeros((speeds.size, 2, 8)), np.full(speeds.size, 4e-6))
        assert whole.onset(INNER) == onset or math.isnan(onset)
        assert math.isnan(whole.onset(OUTER))
        found.append(Outcome(whole, stability(CASES[0].parameters(), np.array([300.0, 400.0]))))
    return tuple(found)


def test_page_holds_verdicts_reasons_and_pictures_and_fetches_nothing(outcomes: tuple[Outcome, ...]) -> None:
    comparisons = tuple(chapter_6_comparisons(outcomes))
    figures = tuple(chapter_6_figures(outcomes)[:1])
    assert isinstance(figures[0][1][0], Surface)
    part = Part("Chapter 6", "text", comparisons, figures, tuple(trends(outcomes)))
    text = page([part])
    assert text.count("<svg") == 1
    assert "not reproduced" in text
    assert 'href="http' not in text
    assert "src=" not in text
    good, total = counts(part)
    assert total == len(comparisons) + len(part.trends)
    assert 0 < good < total
    assert f"{good} of {total}" in text
