"""Data of a recomputed chapter of the thesis: stated and computed numbers, and figures.

Numbers are in the printed unit of the thesis, which is given with each of them.
"""

from dataclasses import dataclass
from enum import Enum

from analysis.signals import FloatArray


class Relation(Enum):
    """Expected relation of the computed number to the stated one."""

    EQUAL = "="
    AT_MOST = "≤"
    AT_LEAST = "≥"


@dataclass(frozen=True, slots=True)
class Comparison:
    """A number stated in the thesis, and the computed one.

    Parameters
    ----------
    place : str
        Table, figure or page in the thesis.
    quantity : str
        Name of the quantity.
    unit : str
        Of both numbers.
    stated : float
        Value in the thesis.
    computed : float or None
        Computed value; None if it does not exist.
    tolerance : float
        Accepted difference, in the same unit.
    relation : Relation
        Expected relation of the computed value to the stated one.
    note : str
        Method of computation, or reason of a difference.
    """

    place: str
    quantity: str
    unit: str
    stated: float
    computed: float | None
    tolerance: float
    relation: Relation = Relation.EQUAL
    note: str = ""

    @property
    def deviation(self) -> float | None:
        """Computed minus stated value, in the unit; None without a computed value."""
        return None if self.computed is None else self.computed - self.stated

    @property
    def is_reproduced(self) -> bool:
        """Whether the computed number has the expected relation to the stated one, within the tolerance."""
        deviation = self.deviation
        if deviation is None:
            return False
        if self.relation is Relation.AT_MOST:
            return deviation <= self.tolerance
        if self.relation is Relation.AT_LEAST:
            return deviation >= -self.tolerance
        return abs(deviation) <= self.tolerance


@dataclass(frozen=True, slots=True)
class Curve:
    """A line of a figure.

    Parameters
    ----------
    label : str
        Legend entry.
    x, y : ndarray, shape (n_points,), may be none
        Values in the units of the axes; points that do not exist are omitted (a complete film has no rupture).
    """

    label: str
    x: FloatArray
    y: FloatArray


@dataclass(frozen=True, slots=True)
class Figure:
    """A recomputed figure of the thesis.

    Parameters
    ----------
    number : str
        Number in the thesis.
    title : str
        Content and calibration.
    x_label, y_label : str
        Axis labels with units.
    curves : tuple of Curve
        Curves of the figure.
    empty_text : str
        Text shown if no curve has a point.
    y_limits : tuple of float, length 2, optional
        Limits of the axis.
    """

    number: str
    title: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    empty_text: str = "nothing to draw"
    y_limits: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Chapter:
    """A recomputed chapter of the thesis.

    Parameters
    ----------
    title : str
        Number and subject.
    comparisons : tuple of Comparison
        All numbers stated in the chapter.
    figures : tuple of Figure
        All figures with computed curves.
    """

    title: str
    comparisons: tuple[Comparison, ...]
    figures: tuple[Figure, ...]
