"""Comparison of stated and computed numbers."""

import pytest

from model.studies.thesis.report import Comparison, Kind, Relation, Trend, Verdict, headline


@pytest.mark.parametrize(
    ("relation", "computed", "is_reproduced"),
    [
        (Relation.EQUAL, 10.9, True),
        (Relation.EQUAL, 9.1, True),
        (Relation.EQUAL, 11.1, False),
        (Relation.EQUAL, 8.9, False),
        (Relation.AT_MOST, 3.0, True),
        (Relation.AT_MOST, 11.1, False),
        (Relation.AT_LEAST, 30.0, True),
        (Relation.AT_LEAST, 8.9, False),
    ],
)
def test_comparison_is_reproduced_within_its_relation_and_tolerance(
    relation: Relation, computed: float, *, is_reproduced: bool
) -> None:
    comparison = Comparison("Fig. 1", "a length", "m", 10.0, computed, 1.0, relation=relation)
    assert (comparison.verdict is Verdict.REPRODUCED) is is_reproduced
    assert comparison.deviation == pytest.approx(computed - 10)


def test_comparison_without_computed_value_is_not_reproduced() -> None:
    comparison = Comparison("Fig. 1", "a length", "m", 10.0, None, 1.0)
    assert comparison.verdict is Verdict.DIFFERENT
    assert comparison.deviation is None


def test_headline_counts_each_statement_once_and_each_kind_apart() -> None:
    def stated(quantity: str, computed: float, kind: Kind = Kind.PREDICTION, calibration: str = "") -> Comparison:
        return Comparison("Fig. 1", quantity, "m", 10.0, computed, 1.0, kind=kind, calibration=calibration)

    comparisons = [
        stated("a", 10.0), stated("a", 10.0, calibration="fitted"),  # reproduced: one statement, not two
        stated("b", 20.0), stated("b", 10.0, calibration="fitted"),  # only with the fitted factor
        stated("c", 20.0), stated("c", 10.0, Kind.CALIBRATED, "fitted"),  # set the factor: no agreement
        stated("d", 10.0, Kind.BOUND), stated("e", 10.0, Kind.CALIBRATED),
    ]  # fmt: skip
    trends = [Trend("t", verdict, "") for verdict in Verdict]
    assert headline(comparisons, trends).split("; ") == [
        "1 of 3 predictions reproduced and 1 more with factors on the printed data",
        "1 of 1 bounds reproduced",
        "2 stated values set a factor and show nothing",
        "1 of 3 trends reproduced, 1 undecided",
    ]
