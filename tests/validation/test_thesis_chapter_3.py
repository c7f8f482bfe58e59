"""Report on chapter 3: reproduced and not reproduced numbers, to detect changes."""

import numpy as np
import pytest

from model.studies.study import Plot
from model.studies.thesis.chapter_3 import chapter_3_comparisons, chapter_3_readings
from model.studies.thesis.chapter_3_cases import chapter_3_figures
from model.studies.thesis.report import Comparison, Kind, Verdict, headline


@pytest.fixture(scope="module")
def comparisons() -> list[Comparison]:
    return [comparison for reading in chapter_3_readings() for comparison in chapter_3_comparisons(reading)]


@pytest.fixture(scope="module")
def figures() -> list[tuple[str, Plot]]:
    found = []
    for reading in chapter_3_readings():
        for caption, (plot,) in chapter_3_figures(reading):
            assert isinstance(plot, Plot)
            found.append((caption, plot))
    return found


def comparisons_at(comparisons: list[Comparison], reading: str, place: str) -> list[Comparison]:
    return [c for c in comparisons if c.note.startswith(reading) and c.place == place]


def test_every_number_has_both_calibrations_and_a_reason_where_it_differs(comparisons: list[Comparison]) -> None:
    pairs = {(c.place, c.quantity, c.stated) for c in comparisons}
    assert len(comparisons) == 2 * len(pairs)
    for comparison in comparisons:
        assert comparison.note.startswith(("nominal", "thesis-like"))
        if comparison.verdict is not Verdict.REPRODUCED:
            assert len(comparison.note.split("; ", 1)[1]) > 5, comparison.quantity


@pytest.mark.parametrize("place", ["Fig. 3.2", "Fig. 3.3", "Fig. 3.6", "Fig. 3.7"])
def test_thesis_like_calibration_reproduces_equilibria_and_cavities(comparisons: list[Comparison], place: str) -> None:
    found = comparisons_at(comparisons, "thesis-like", place)
    assert found
    assert all(c.verdict is Verdict.REPRODUCED for c in found)


def test_table_3_1_taken_literally_reproduces_none_of_the_inner_eccentricities(comparisons: list[Comparison]) -> None:
    eccentricities = [c for c in comparisons_at(comparisons, "nominal", "Fig. 3.3") if "eccentricity" in c.quantity]
    assert len(eccentricities) == 3
    assert not any(c.verdict is Verdict.REPRODUCED for c in eccentricities)


@pytest.mark.parametrize(
    ("place", "words"),
    [("Fig. 3.5", "20 N"), ("Fig. 3.8", "start of the outer"), ("Fig. 3.9", "187"), ("Fig. 3.13", "30 N")],
)
def test_numbers_without_force_balance_are_not_reproduced(
    comparisons: list[Comparison], place: str, words: str
) -> None:
    [comparison] = [c for c in comparisons_at(comparisons, "thesis-like", place) if words in c.quantity]
    assert comparison.verdict is not Verdict.REPRODUCED


def test_flows_at_1000_rad_s_are_not_reproduced_with_either_calibration(comparisons: list[Comparison]) -> None:
    flows = [c for c in comparisons if c.place == "Fig. 3.15" and c.quantity.startswith("mean flow")]
    assert len(flows) == 6
    assert not any(c.verdict is Verdict.REPRODUCED for c in flows)


def test_every_figure_is_computed_with_both_calibrations(figures: list[tuple[str, Plot]]) -> None:
    numbers = [caption.split(":")[0].removeprefix("Fig. ") for caption, _ in figures]
    expected = ["3.2a", "3.2b", "3.3a", "3.3b", "3.4a", "3.4b", *(f"3.{n}" for n in range(5, 12))]
    expected += ["3.12a", "3.12b", "3.12c", "3.13", "3.14a", "3.14b", "3.14c", "3.15"]
    assert numbers == expected * 2
    for _, plot in figures:
        for curve in plot.series:
            assert curve.x.shape == curve.y.shape
            assert np.all(np.isfinite(curve.y))


def test_figures_and_comparisons_have_the_same_values(figures: list[tuple[str, Plot]]) -> None:
    def plotted(number: str, reading: str) -> Plot:
        [plot] = [plot for caption, plot in figures if caption.startswith(f"Fig. {number}:") and reading in caption]
        return plot

    inner = plotted("3.3a", "thesis-like")
    assert [float(curve.y[0]) for curve in inner.series] == pytest.approx([0.116, 0.233, 0.353], abs=1e-3)
    assert all(curve.x.size == 0 for curve in plotted("3.5", "nominal").series)
    flow = plotted("3.11", "nominal").series[0].y
    assert flow[:120] == pytest.approx(flow[120:240], rel=1e-9)


def test_headline_counts_35_statements_once_with_bounds_and_calibrated_values_apart(
    comparisons: list[Comparison],
) -> None:
    assert len({(c.place, c.quantity) for c in comparisons}) == 35
    assert sum(c.kind is Kind.BOUND for c in comparisons) == 2 * 6
    calibrated = {c.quantity for c in comparisons if c.kind is Kind.CALIBRATED}
    assert len(calibrated) == 2  # the flow that sets the scale, and the eccentricity that sets the inner film's factor
    predictions, bounds, others = headline(comparisons).split("; ")
    assert predictions == "7 of 28 predictions reproduced and 8 more with factors on the printed data"
    assert bounds == "5 of 6 bounds reproduced and 1 more with factors on the printed data"
    assert others == "2 stated values set a factor and show nothing"
