"""Report on chapter 3: reproduced and not reproduced numbers, to detect changes."""

import numpy as np
import pytest

from model.studies.thesis.chapter_3 import chapter_3
from model.studies.thesis.report import Chapter, Comparison


@pytest.fixture(scope="module")
def chapter() -> Chapter:
    return chapter_3()


def comparisons_at(chapter: Chapter, reading: str, place: str) -> list[Comparison]:
    return [c for c in chapter.comparisons if c.note.startswith(reading) and c.place == place]


def test_every_number_has_both_calibrations_and_a_reason_where_it_differs(chapter: Chapter) -> None:
    pairs = {(c.place, c.quantity, c.stated) for c in chapter.comparisons}
    assert len(chapter.comparisons) == 2 * len(pairs)
    for comparison in chapter.comparisons:
        assert comparison.note.startswith(("nominal", "thesis-like"))
        if not comparison.is_reproduced:
            assert len(comparison.note.split("; ", 1)[1]) > 5, comparison.quantity


@pytest.mark.parametrize("place", ["Fig. 3.2", "Fig. 3.3", "Fig. 3.6", "Fig. 3.7"])
def test_thesis_like_calibration_reproduces_equilibria_and_cavities(chapter: Chapter, place: str) -> None:
    comparisons = comparisons_at(chapter, "thesis-like", place)
    assert comparisons
    assert all(c.is_reproduced for c in comparisons)


def test_table_3_1_taken_literally_reproduces_none_of_the_inner_eccentricities(chapter: Chapter) -> None:
    eccentricities = [c for c in comparisons_at(chapter, "nominal", "Fig. 3.3") if "eccentricity" in c.quantity]
    assert len(eccentricities) == 3
    assert not any(c.is_reproduced for c in eccentricities)


@pytest.mark.parametrize(
    ("place", "words"),
    [("Fig. 3.5", "20 N"), ("Fig. 3.8", "start of the outer"), ("Fig. 3.9", "187"), ("Fig. 3.13", "30 N")],
)
def test_numbers_without_force_balance_are_not_reproduced(chapter: Chapter, place: str, words: str) -> None:
    [comparison] = [c for c in comparisons_at(chapter, "thesis-like", place) if words in c.quantity]
    assert not comparison.is_reproduced


def test_flows_at_1000_rad_s_are_not_reproduced_with_either_calibration(chapter: Chapter) -> None:
    flows = [c for c in chapter.comparisons if c.place == "Fig. 3.15" and c.quantity.startswith("mean flow")]
    assert len(flows) == 6
    assert not any(c.is_reproduced for c in flows)


def test_every_figure_is_computed_with_both_calibrations(chapter: Chapter) -> None:
    numbers = [figure.number for figure in chapter.figures]
    expected = ["3.2a", "3.2b", "3.3a", "3.3b", "3.4a", "3.4b", *(f"3.{n}" for n in range(5, 12))]
    expected += ["3.12a", "3.12b", "3.12c", "3.13", "3.14a", "3.14b", "3.14c", "3.15"]
    assert numbers == expected * 2
    for figure in chapter.figures:
        for curve in figure.curves:
            assert curve.x.shape == curve.y.shape
            assert np.all(np.isfinite(curve.y))


def test_figures_and_comparisons_have_the_same_values(chapter: Chapter) -> None:
    [inner] = [f for f in chapter.figures if f.number == "3.3a" and "thesis-like" in f.title]
    assert [float(curve.y[0]) for curve in inner.curves] == pytest.approx([0.116, 0.233, 0.353], abs=1e-3)
    [complete] = [f for f in chapter.figures if f.number == "3.5" and "nominal" in f.title]
    assert all(curve.x.size == 0 for curve in complete.curves)
    [flow] = [f for f in chapter.figures if f.number == "3.11" and "nominal" in f.title]
    assert flow.curves[0].y[:120] == pytest.approx(flow.curves[0].y[120:240], rel=1e-9)
