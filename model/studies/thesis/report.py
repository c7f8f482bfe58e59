"""What a recomputed chapter of the thesis consists of: numbers stated beside computed ones, and curves to be drawn.

Numbers here stand in the unit that is named beside them, as the thesis prints them: they are for a report.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class Relation(Enum):
    """How a computed number should stand to the stated one."""

    EQUAL = "="
    AT_MOST = "≤"
    AT_LEAST = "≥"


@dataclass(frozen=True, slots=True)
class Comparison:
    """A number that the thesis states beside the one computed.

    Parameters
    ----------
    place : str
        Table, figure or page.
    quantity : str
        What the number is.
    unit : str
        Of both numbers.
    stated : float
        By the thesis.
    computed : float or None
        Here; none where there is no such thing.
    tolerance : float
        Difference up to which the two count as one, in the same unit.
    relation : Relation
        How the computed one should stand to the stated one.
    note : str
        How it was computed, or the reason why they differ.
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
        """Computed less stated, in the unit; none where nothing was computed."""
        return None if self.computed is None else self.computed - self.stated

    @property
    def is_reproduced(self) -> bool:
        """Whether the computed number stands to the stated one as it should, within the tolerance."""
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
        What tells it from the others.
    x, y : ndarray, shape (n_points,), may be none
        In the units of the figure's axes; only points that exist (a complete film has no rupture to draw).
    """

    label: str
    x: FloatArray
    y: FloatArray


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of the thesis, computed again.

    Parameters
    ----------
    number : str
        In the thesis.
    title : str
        What it shows and with which calibration.
    x_label, y_label : str
        Of the axes, with their units.
    curves : tuple of Curve
        Lines.
    empty_text : str
        Why there is none, where no curve has a point.
    y_limits : tuple of float, length 2, optional
        Ends of the axis.
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
    """A chapter of the thesis, computed again.

    Parameters
    ----------
    title : str
        Number and subject.
    comparisons : tuple of Comparison
        Every number it states.
    figures : tuple of Figure
        Every figure with computed curves.
    """

    title: str
    comparisons: tuple[Comparison, ...]
    figures: tuple[Figure, ...]
