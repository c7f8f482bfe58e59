"""How vibration is told: a line of the order spectrum at the two probes, and which way a whirl goes.

What the standards say of a vibration, for information.
"""

import math
from collections.abc import Sequence
from enum import StrEnum

from pydantic import Field

from analysis.live.summary import ProbeSummary
from analysis.signals.standards import standard_limits
from daq.schemas.units import Schema, degrees, finite, lag_degrees, micrometres


class Direction(StrEnum):
    """Which way a whirl goes round."""

    FORWARD = "forward"  # with the shaft
    BACKWARD = "backward"


def direction(*, is_forward: bool) -> Direction:
    """Return the word for a direction."""
    return Direction.FORWARD if is_forward else Direction.BACKWARD


class ProbeVectorsSchema(Schema):
    """One line of the order spectrum at the two probes."""

    amplitude_peak_x_um: float | None = Field(description="Amplitude at probe x, µm zero-to-peak", examples=[15.2])
    lag_x_deg: float | None = Field(
        description="Phase lag at probe x after the tacho's mark, 0 to 360 degrees", examples=[47.3]
    )
    amplitude_peak_y_um: float | None = Field(description="Amplitude at probe y, µm zero-to-peak", examples=[16.8])
    lag_y_deg: float | None = Field(
        description="Phase lag at probe y after the tacho's mark, 0 to 360 degrees", examples=[136.9]
    )


def probe_vectors_schema(vectors: Sequence[complex]) -> ProbeVectorsSchema:
    """Return the complex peak amplitudes of one line at the probes x and y, m, as a document."""
    x, y = (complex(vector) for vector in vectors)
    return ProbeVectorsSchema(
        amplitude_peak_x_um=micrometres(math.hypot(x.real, x.imag)),
        lag_x_deg=lag_degrees(x),
        amplitude_peak_y_um=micrometres(math.hypot(y.real, y.imag)),
        lag_y_deg=lag_degrees(y),
    )


class MeasuredProbeVectorsSchema(ProbeVectorsSchema):
    """One line of the measured order spectrum at the two probes, and how sure it is."""

    amplitude_sigma_um: float | None = Field(
        description="Standard deviation of either amplitude, from the noise beside the line, µm", examples=[0.05]
    )
    lag_sigma_x_deg: float | None = Field(
        description="Standard deviation of the lag at probe x, from noise and the tacho's jitter, degrees",
        examples=[0.3],
    )
    lag_sigma_y_deg: float | None = Field(description="The same at probe y, degrees", examples=[0.3])


def measured_probe_vectors_schema(
    vectors: Sequence[complex], sigma: float, phase_sigma: Sequence[float]
) -> MeasuredProbeVectorsSchema:
    """Return a line with the standard deviations of its amplitudes, m, and of its phases at x and y, rad."""
    return MeasuredProbeVectorsSchema(
        **probe_vectors_schema(vectors).model_dump(),
        amplitude_sigma_um=micrometres(sigma),
        lag_sigma_x_deg=degrees(phase_sigma[0]),
        lag_sigma_y_deg=degrees(phase_sigma[1]),
    )


VIBRATION = ("ISO 20816-3", "API 617")  # whose figures are limits of overall vibration


class StandardSchema(Schema):
    """A figure of a standard beside the largest vibration, for information: none is written for floating rings."""

    standard: str = Field(description="Where it stands", examples=["ISO 20816-3"])
    name: str = Field(description="What it is called there", examples=["zone boundary A/B"])
    limit_peak_to_peak_um: float | None = Field(
        description="The figure at the speed of the largest vibration, µm peak-to-peak; null where its scope ends",
        examples=[39.1],
    )
    limit_ratio: float | None = Field(
        description="The run's largest overall vibration over the figure; null likewise", examples=[2.46]
    )
    scope: str = Field(
        description="What it is meant for",
        examples=["industrial machines above 15 kW that run at 120 to 30,000 r/min"],
    )
    source: str = Field(
        description="Where the figure was read", examples=["as the field quotes it; not checked against the text"]
    )


def standard_schemas(probes: tuple[ProbeSummary, ...]) -> tuple[StandardSchema, ...]:
    """Return the figures at the speed of the largest vibration; none where that or its speed is unknown."""
    worst = max(probes, key=lambda probe: probe.largest_peak_to_peak, default=None)
    if worst is None or worst.largest is None or not 0.0 < worst.largest.speed < math.inf:
        return ()
    return tuple(
        StandardSchema(
            standard=figure.standard,
            name=figure.name,
            limit_peak_to_peak_um=micrometres(figure.limit),
            limit_ratio=finite(worst.largest_peak_to_peak / figure.limit),
            scope=figure.scope,
            source=figure.source,
        )
        for figure in standard_limits(worst.largest.speed)
        if figure.standard in VIBRATION
    )
