"""Comparison of stated and computed numbers."""

import pytest

from model.studies.thesis.report import Comparison, Relation


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
    comparison = Comparison("Fig. 1", "a length", "m", 10.0, computed, 1.0, relation)
    assert comparison.is_reproduced is is_reproduced
    assert comparison.deviation == pytest.approx(computed - 10)


def test_comparison_without_computed_value_is_not_reproduced() -> None:
    comparison = Comparison("Fig. 1", "a length", "m", 10.0, None, 1.0)
    assert not comparison.is_reproduced
    assert comparison.deviation is None
