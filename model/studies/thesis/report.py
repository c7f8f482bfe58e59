"""Stated and computed numbers of a recomputed chapter of the thesis, and how many of them are reproduced.

Numbers are in the printed unit of the thesis, which is given with each of them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum

from model.studies.study import Plot, Surface

Captioned = tuple[str, tuple[Plot | Surface, ...]]


class Relation(Enum):
    """Expected relation of the computed number to the stated one."""

    EQUAL = "="
    AT_MOST = "≤"
    AT_LEAST = "≥"


class Kind(Enum):
    """What agreement of a computed with a stated number shows."""

    PREDICTION = "prediction"
    BOUND = "bound"
    """An inequality or the limit of an axis: many values satisfy it."""
    CALIBRATED = "calibrated value"
    """A number used to set a factor of the computation: agreement shows nothing."""


class Verdict(Enum):
    """Whether a stated number or trend is reproduced."""

    REPRODUCED = "reproduced"
    DIFFERENT = "not reproduced"
    UNDECIDED = "undecided"
    """The motion is unstable, but the growth is too slow to show in the turns integrated."""


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
    note : str
        Method of computation, or reason of a difference.
    relation : Relation
        Expected relation of the computed value to the stated one.
    kind : Kind
        What agreement shows.
    calibration : str
        Name of the calibration of the computation; empty for the printed data.
    """

    place: str
    quantity: str
    unit: str
    stated: float
    computed: float | None
    tolerance: float
    note: str = ""
    relation: Relation = Relation.EQUAL
    kind: Kind = Kind.PREDICTION
    calibration: str = ""

    @property
    def deviation(self) -> float | None:
        """Computed minus stated value, in the unit; None without a computed value."""
        return None if self.computed is None else self.computed - self.stated

    @property
    def verdict(self) -> Verdict:
        """Whether the computed number has the expected relation to the stated one, within the tolerance."""
        if self.deviation is None:
            return Verdict.DIFFERENT
        excess = {
            Relation.EQUAL: abs(self.deviation),
            Relation.AT_MOST: self.deviation,
            Relation.AT_LEAST: -self.deviation,
        }[self.relation]
        return Verdict.REPRODUCED if excess <= self.tolerance else Verdict.DIFFERENT


@dataclass(frozen=True, slots=True)
class Trend:
    """A trend stated in words.

    Parameters
    ----------
    text : str
        Text of the trend.
    verdict : Verdict
        Whether the computation reproduces it.
    computed : str
        Computed values.
    """

    text: str
    verdict: Verdict
    computed: str


def headline(comparisons: Iterable[Comparison], trends: Sequence[Trend] = ()) -> str:
    """Return how many statements of a chapter are reproduced, each counted once and each kind apart.

    A statement counts as reproduced if it follows from the printed data. Those that agree only with a calibrated
    computation are counted apart; a value that set a factor of that computation never counts as its agreement.
    """
    statements: dict[tuple[str, str, float], list[Comparison]] = {}
    for one in comparisons:
        statements.setdefault((one.place, one.quantity, one.stated), []).append(one)
    groups: dict[Kind, list[set[str]]] = {kind: [] for kind in Kind}
    for found in statements.values():
        free = [one for one in found if one.kind is not Kind.CALIBRATED]
        if len(free) < len(found):
            groups[Kind.CALIBRATED].append(set())
        if free:
            groups[free[0].kind].append({one.calibration for one in free if one.verdict is Verdict.REPRODUCED})
    parts = []
    for kind in (Kind.PREDICTION, Kind.BOUND):
        literal, fitted = sum("" in found for found in groups[kind]), sum(bool(found) for found in groups[kind])
        more = f" and {fitted - literal} more with factors on the printed data" if fitted > literal else ""
        if groups[kind]:
            parts.append(f"{literal} of {len(groups[kind])} {kind.value}s reproduced{more}")
    if groups[Kind.CALIBRATED]:
        parts.append(f"{len(groups[Kind.CALIBRATED])} stated values set a factor and show nothing")
    if trends:
        verdicts = [one.verdict for one in trends]
        undecided = verdicts.count(Verdict.UNDECIDED)
        parts.append(
            f"{verdicts.count(Verdict.REPRODUCED)} of {len(trends)} trends reproduced"
            + (f", {undecided} undecided" if undecided else "")
        )
    return "; ".join(parts)
