"""What the standards say of a vibration, for information."""

import math

from pydantic import Field

from analysis.live.summary import ProbeSummary
from analysis.signals.standards import figures
from daq.schemas.document import Document
from daq.schemas.units import finite, micrometres

VIBRATION = ("ISO 20816-3", "API 617")  # whose figures are limits of overall vibration


class StandardDocument(Document):
    """A figure of a standard beside the largest vibration, for information: none is written for floating rings."""

    standard: str = Field(description="Where it stands", examples=["ISO 20816-3"])
    name: str = Field(description="What it is called there", examples=["zone boundary A/B"])
    limit_peak_to_peak_um: float | None = Field(
        description="The figure at the speed of the largest vibration, µm peak-to-peak; null where its scope ends",
        examples=[39.1],
    )
    of_limit: float | None = Field(
        description="The run's largest overall vibration over the figure; null likewise", examples=[2.46]
    )
    scope: str = Field(
        description="What it is meant for",
        examples=["industrial machines above 15 kW that run at 120 to 30,000 r/min"],
    )
    source: str = Field(
        description="Where the figure was read", examples=["as the field quotes it; not checked against the text"]
    )


def standard_documents(probes: tuple[ProbeSummary, ...]) -> tuple[StandardDocument, ...]:
    """Return the figures at the speed of the largest vibration; none where that or its speed is unknown."""
    worst = max(probes, key=lambda probe: probe.largest_peak_to_peak, default=None)
    if worst is None or worst.largest is None or not 0.0 < worst.largest.speed < math.inf:
        return ()
    return tuple(
        StandardDocument(
            standard=figure.standard,
            name=figure.name,
            limit_peak_to_peak_um=micrometres(figure.limit),
            of_limit=finite(worst.largest_peak_to_peak / figure.limit),
            scope=figure.scope,
            source=figure.source,
        )
        for figure in figures(worst.largest.speed)
        if figure.standard in VIBRATION
    )
